"""The agent's side of a drone that speaks MAVLink, whoever's autopilot flies it.

Interface: :class:`Vehicle` with :class:`Timing` and :class:`Limits`.

From the wire upwards: ``connection`` opens what a connection string names; ``link`` frames, signs
and records; ``state`` keeps the newest telemetry; ``conversation`` has the one thread, asks and
waits; ``dialects`` holds what PX4 and ArduPilot want differently; ``safety`` decides, as a pure
function, whether to go on, hold or land; ``helm`` says what is streamed; ``vehicle`` offers the
verbs; ``body`` makes a drone the body of an environment.
"""

from agent.vehicle.safety import Limits, Timing
from agent.vehicle.state import VehicleState
from agent.vehicle.vehicle import Vehicle

__all__ = ["Limits", "Timing", "Vehicle", "VehicleState"]
