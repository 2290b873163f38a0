"""The command line in this process: a process of its own would take a second or two."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from deploy.cli import main as cli
from tests.notices import without_notices

Ended = tuple[int, str, str]
Run = Callable[..., Ended]


@pytest.fixture
def swarm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Run:
    """The command in this process, in an empty folder: exit code, output, mistakes."""

    def run(*arguments: str | Path) -> Ended:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("COLUMNS", "80")
        monkeypatch.setattr(sys, "argv", ["swarm", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capsys.readouterr()
        code = ended.value.code
        return (code if isinstance(code, int) else 0), said.out, without_notices(said.err)

    return run
