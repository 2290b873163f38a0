"""The worlds that come with the house: one page each, found by name.

`indoor-long`, `indoor-cloud`, `indoor-frogeyes` and `indoor-pyramid` follow the floor plans of
PEDRA's worlds of these names (shapes and moods, not copies); `indoor-techno` and `indoor-vanleer`
are for generalisation and never trained on.
"""

from importlib import import_module

from sim.indoor.content.plan import Plan

TRAINED = ("indoor-long", "indoor-cloud", "indoor-frogeyes", "indoor-pyramid")
UNSEEN = ("indoor-techno", "indoor-vanleer")
NAMES = TRAINED + UNSEEN


def known(name: str) -> bool:
    """Whether this is one of ours."""
    return name in NAMES


def plan(name: str) -> Plan:
    """The plan that a world's page draws."""
    page = import_module(f"sim.indoor.content.scenes.{name.removeprefix('indoor-')}")
    drawn: Plan = page.draw()
    return drawn
