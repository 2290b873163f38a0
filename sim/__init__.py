"""The worlds.  Importing this package registers every environment with Gymnasium.

``gymnasium.make("sim:GridWorld-v0", ...)`` imports it by itself.  Imports nothing of ours.
"""

from gymnasium.envs.registration import register

ENTRY_POINTS = {
    "CartPoleVariant-v0": "sim.cartpole:CartPoleVariant",
    "Chain-v0": "sim.tabular.chain:Chain",
    "GridWorld-v0": "sim.tabular.gridworld:GridWorld",
    "IndoorFlight-v0": "sim.indoor.flight.env:IndoorFlight",
}
VECTOR_ENTRY_POINTS = {
    "IndoorFlight-v0": "sim.indoor.flight.vector:IndoorFlights",
}

MOST_STEPS = {
    "CartPoleVariant-v0": 500,
}

for _name, _entry_point in ENTRY_POINTS.items():
    register(
        id=_name,
        entry_point=_entry_point,
        vector_entry_point=VECTOR_ENTRY_POINTS.get(_name),
        max_episode_steps=MOST_STEPS.get(_name),
    )
