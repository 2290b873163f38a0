"""What the agents of a run hold of the machine, read from /proc.

Resident memory counts the pages of libraries in every process that maps them; proportional memory
shares them out and is what one more agent costs.
"""

import re
from dataclasses import dataclass
from pathlib import Path

_KB = re.compile(r"^(Rss|Pss): +(\d+) kB", re.MULTILINE)


@dataclass(frozen=True)
class Holding:
    """One process's share.

    Attributes:
        resident, proportional: memory [MB].
        handles: open file descriptors.
        threads: of the process.
    """

    resident: float
    proportional: float
    handles: int
    threads: int


def holdings(run: Path) -> dict[str, Holding]:
    """What each agent holds that runs for a folder."""
    found = {}
    for process in Path("/proc").iterdir():
        if not process.name.isdigit():
            continue
        try:
            words = (process / "cmdline").read_bytes().decode().split("\0")
            if "--supervised" in words and str(run) in words:
                found[words[words.index("--id") + 1]] = _holding(process)
        except (OSError, KeyError):  # it has just ended
            continue
    return found


def _holding(process: Path) -> Holding:
    sizes = dict(_KB.findall((process / "smaps_rollup").read_text()))
    return Holding(
        resident=int(sizes["Rss"]) * 1.024e-3,
        proportional=int(sizes["Pss"]) * 1.024e-3,
        handles=len(list((process / "fd").iterdir())),
        threads=len(list((process / "task").iterdir())),
    )
