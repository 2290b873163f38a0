"""The worlds.  Importing this package registers every environment with Gymnasium.

``gymnasium.make("sim:GridWorld-v0", ...)`` imports it by itself.  Imports nothing of ours.
"""

from gymnasium import register

register(
    id="IndoorFlight-v0",
    entry_point="sim.indoor.env:IndoorFlight",
    vector_entry_point="sim.indoor.vector:IndoorFlights",
)
