"""Every command of README and of the guides runs, page by page, as :mod:`.pages` reads them."""

import os
import re
import subprocess
import sys
import tomllib
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
    """Run a block in a folder, with `swarm` on the path and Python's as the project's."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command, cwd=folder, env=os.environ | {"PATH": path}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=LIMIT, check=False,
    )  # fmt: skip
    said = f"{done.stdout[-1500:]}\n{done.stderr[-1500:]}"
    assert done.returncode == 0, f"{block.place}: exit code {done.returncode}\n{said}"
    assert "Traceback" not in done.stderr, f"{block.place}:\n{said}"


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
