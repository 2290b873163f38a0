"""Where runs live, unless the user says otherwise, and which is the newest."""

import os
from datetime import datetime
from pathlib import Path

from swarm.errors import ConfigError

RUNS = Path("runs")
LATEST = RUNS / "latest"  # link to the newest run of `swarm up`


def new_run(name: str) -> Path:
    """Make a folder for a run of this swarm, named after it and the time; nobody else has it.

    Raises:
        ConfigError: it cannot be made.
    """
    stem = f"{name}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    suffix = 1
    while True:
        path = RUNS / (stem if suffix == 1 else f"{stem}.{suffix}")
        try:
            RUNS.mkdir(parents=True, exist_ok=True)
            path.mkdir()
        except FileExistsError:
            if not RUNS.is_dir():
                raise ConfigError(f'"{RUNS}" is not a folder: expected one for the runs') from None
            suffix += 1
        except OSError as error:
            raise ConfigError(f'run folder "{path}" cannot be made: {error.strerror}') from None
        else:
            return path


def point_latest_to(path: Path) -> None:
    """Make :data:`LATEST` lead to a run in :data:`RUNS`."""
    draft = LATEST.with_name(f".latest-{os.getpid()}")
    draft.symlink_to(path.name)
    draft.replace(LATEST)


def check_own_folder(option: str, path: Path) -> None:
    """See that a folder to be written to is not the current one, by mistake (``--run ""``).

    Raises:
        ConfigError: it is.
    """
    if path.resolve() == Path.cwd():
        raise ConfigError(
            f"{option} names the current folder: expected a folder of its own, "
            f"e.g. {option} {RUNS / 'mine'}"
        )
