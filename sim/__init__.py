"""The worlds.  Importing this package registers every environment with Gymnasium.

``gymnasium.make("sim:GridWorld-v0", ...)`` imports it by itself.  Imports nothing of ours.
"""

from gymnasium.envs.registration import register

ENTRY_POINTS = {
    "Chain-v0": "sim.tabular.chain:Chain",
    "GridWorld-v0": "sim.tabular.gridworld:GridWorld",
}

for _name, _entry_point in ENTRY_POINTS.items():
    register(id=_name, entry_point=_entry_point)
