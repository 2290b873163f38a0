"""``make bench``: every part of the house measures itself; the parts stand beside this file."""

from importlib import import_module

PARTS = ("indoor", "vehicle", "learning", "exchange", "fleet", "viewer")

for part in PARTS:
    import_module(f"tests.bench.{part}").main()
