"""A whole swarm as a child process: ``swarm up`` run to its end by a study or a test.

Interface: :func:`command` and :func:`swarm_up`.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from swarm.errors import SwarmError


def command(file: Path, run: Path, *options: str | Path) -> list[str]:
    """``swarm up FILE`` into a run folder, without a recording."""
    words = ["up", file, "--run", run, "--no-record", *options]
    return [sys.executable, "-m", "deploy.cli", *map(str, words)]


def swarm_up(
    file: Path, run: Path, *options: str | Path, limit: float, host: Sequence[str] = ()
) -> str:
    """Run a swarm to its end.

    Args:
        file: the swarm file.
        run: its run folder.
        options: more of ``swarm up``'s.
        limit: for all of it [s].
        host: words before the command, such as :func:`deploy.chaos.namespaces.inside` gives.

    Returns:
        What it printed.

    Raises:
        SwarmError: it failed, and its last line says why; or it took too long.
    """
    try:
        done = subprocess.run(
            [*host, *command(file, run, *options)],
            capture_output=True, text=True, timeout=limit, check=True,
        )  # fmt: skip
    except subprocess.CalledProcessError as error:
        last = (error.stderr or error.stdout).strip().splitlines()[-1:]
        raise SwarmError(f"{file}: swarm up failed: {' '.join(last)}") from None
    except subprocess.TimeoutExpired:
        raise SwarmError(f"{file}: swarm up took longer than {limit:.0f} s") from None
    return done.stdout
