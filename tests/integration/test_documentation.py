"""Every command of README and of the guides runs, page by page, as :mod:`.pages` reads them."""

import os
import re
import signal
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from tests.integration.pages import Block, PageError, blocks_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "deploy" / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
FOLDERS = ("deploy", "tests", "sim", ".venv")
LIMIT = 300.0  # [s] for one block on a machine with other things to do
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A folder that looks like a clone after `make run`; what is written there stays there."""
    for name in (
        "deploy",
        "tests",
        "sim",
        "Makefile",
        "requirements.lock",
        "pyproject.toml",
        ".venv",
    ):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_of_a_page_runs(page: Path, copy: Path) -> None:
    for block in blocks_of(page):
        if block.file:
            (copy / block.file).write_text(block.text + "\n")
        if block.test:
            run(block, ["bash", "-euo", "pipefail", "-c", block.test], copy)
        elif block.kind == "sh":
            run(block, ["bash", "-euo", "pipefail", "-c", block.text], copy)
        elif block.kind == "python":
            run(block, [sys.executable, "-c", block.text], copy)
        elif block.kind == "toml":
            tomllib.loads(block.text)


def run(block: Block, command: list[str], folder: Path) -> None:
    """Run a block in a folder, with `swarm` on the path; nothing that it started outlives it."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with (folder / "said").open("w+") as said:
        process = subprocess.Popen(
            command, cwd=folder, env=os.environ | {"PATH": path}, stdin=subprocess.DEVNULL,
            stdout=said, stderr=said, start_new_session=True,
        )  # fmt: skip
        try:
            code = process.wait(LIMIT)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        said.seek(0)
        text = said.read()
    assert code == 0, f"{block.place}: exit code {code} (None: after {LIMIT:.0f} s)\n{text[-3000:]}"
    assert "Traceback" not in text, f"{block.place}:\n{text[-3000:]}"


def test_readme_is_short_and_links_lead_somewhere() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150
    index = (DOCS / "README.md").read_text()
    for page in PAGES:
        for target in LINK.findall(page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
        assert page.name == "README.md" or f"({page.name})" in index


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("\n    swarm up x\n", "page.md:2: an indented block"),
        ("```\nswarm up x\n```\n", 'page.md:1: a block of ""'),
        ("```sh\nsudo swarm up x\n```\n", "page.md:1: needs root or docker"),
        ("<!-- test: true -->\n\n```sh\ntrue\n```\n", "page.md:2: a comment directly above no"),
        ("| `swarm status` | x |\n|---|---|\n", "page.md:1: nothing above the table runs"),
        ("<!-- what -->\n```sh\ntrue\n```\n", "page.md:2: expected <!-- test"),
    ],
)
def test_a_block_that_nobody_can_test_is_a_mistake(text: str, named: str, tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(text)
    with pytest.raises(PageError) as told:
        blocks_of(tmp_path / "page.md")
    assert named in str(told.value)
