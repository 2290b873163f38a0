"""The agent's side of a drone that speaks MAVLink, whoever's autopilot flies it.

Interface: :class:`Vehicle` with :class:`Timing` and :class:`Limits`.

``connection`` opens what a connection string names; ``dialects`` holds what PX4 and ArduPilot want
differently; ``safety`` decides, as a pure function, whether to go on, hold or land; ``state`` keeps
the newest telemetry; ``vehicle`` runs the one thread that owns socket and codec, and offers the
verbs.
"""

from agent.vehicle.safety import Limits, Timing
from agent.vehicle.state import VehicleState
from agent.vehicle.vehicle import Vehicle

__all__ = ["Limits", "Timing", "Vehicle", "VehicleState"]
