"""The import arrows of the house: agent -> swarm; deploy -> agent, swarm, sim; nothing else.

Only ``deploy/viewer.py`` and the rooms under ``deploy/viewer/`` import Rerun.
"""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ALLOWED = {
    "swarm": {"swarm"},
    "sim": {"sim"},
    "agent": {"agent", "swarm"},
    "deploy": {"deploy", "agent", "swarm", "sim"},
}
FILES = sorted(file for package in ALLOWED for file in (ROOT / package).rglob("*.py"))


def imported_packages(file: Path) -> set[str]:
    """Top-level names of everything that a file imports, wherever in the file it does so."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file.relative_to(ROOT)}: relative import"
            names.add((node.module or "").split(".")[0])
    return names


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_imports_follow_the_arrows(file: Path) -> None:
    package = file.relative_to(ROOT).parts[0]
    imported = imported_packages(file)
    assert imported & set(ALLOWED) <= ALLOWED[package]
    if package == "swarm":
        assert "torch" not in imported
    if "rerun" in imported:
        assert file.relative_to(ROOT).parts[:2] in {("deploy", "viewer.py"), ("deploy", "viewer")}
