"""``@compiled``: how this room compiles (:mod:`sim.kernels`)."""

from pathlib import Path

from sim.kernels import Kernels

compiled = Kernels(Path(__file__).parent, "indoor").compiled
