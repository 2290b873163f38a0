"""What all agents of a swarm must have in common, as short texts that two of them can compare.

Interface: :func:`agreed`.  Everything in a swarm file counts but what is one machine's own: how it
is reached, how long it waits, how often it writes, where its files lie.  A short value is its own
text, a long one its hash, so the list fits into a key (:mod:`swarm.wire.refusals`) and names what
differs.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from agent.config.experiment import SwarmFile

# One machine's own.
OWN = ("network", "timing", "quorum", "checkpoint_every", "training.threads", "modules")
OWN_OF_AGENT = ("endpoint", "namespace", "device")
SHORT = 24  # letters of a value that is shown as it is


def agreed(config: SwarmFile) -> tuple[tuple[str, str], ...]:
    """(key, value) of everything that must agree, in the order of the keys."""
    tables = msgspec.to_builtins(config)
    agents = tables.pop("agents")
    tables["members"] = [agent["id"] for agent in agents]
    tables["tasks"] = [
        _by_name({key: value for key, value in agent.items() if key not in OWN_OF_AGENT})
        for agent in agents
    ]
    return tuple(sorted((key, _shown(value)) for key, value in _leaves("", tables)))


def _by_name(value: Any) -> Any:
    """With absolute paths cut down to the file's name: where it lies is one machine's affair."""
    if isinstance(value, dict):
        return {key: _by_name(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_by_name(inner) for inner in value]
    return Path(value).name if isinstance(value, str) and value.startswith("/") else value


def _leaves(place: str, value: Any) -> Iterator[tuple[str, Any]]:
    if place in OWN:
        return
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _leaves(f"{place}.{key}" if place else key, inner)
    else:
        yield place, value


def _shown(value: Any) -> str:
    text = msgspec.json.encode(value, order="sorted").decode()
    if len(text) <= SHORT:
        return text
    return "#" + hashlib.blake2b(text.encode(), digest_size=6).hexdigest()
