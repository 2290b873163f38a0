"""A wheel has all that a stranger needs: built once, unpacked, used from another folder."""

import os
import shutil
import subprocess
import sys
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PACKAGES = ("swarm", "agent", "sim", "deploy")
NEEDED = {".py", ".toml", ".safetensors", ".service", ".typed"}  # beside the Dockerfile


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel's content, built from a copy: setuptools writes into what it builds."""
    copy, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__", "*.png")
        )
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    code = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"
    subprocess.run(
        [sys.executable, "-c", code, str(folder)],
        cwd=copy,
        check=True,
        timeout=120,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "site")
    return folder / "site"


def test_every_file_that_is_read_is_in_it(unpacked: Path) -> None:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*"):
            if path.suffix in NEEDED or path.name == "Dockerfile":
                assert (unpacked / path.relative_to(ROOT)).is_file(), path
    assert not list(unpacked.glob("tests"))


def test_its_metadata_say_whose_it_is_and_how_it_may_be_used(unpacked: Path) -> None:
    (info,) = unpacked.glob("dcpg_swarm-*.dist-info")
    said = message_from_bytes((info / "METADATA").read_bytes())
    assert said["License-Expression"] == "Apache-2.0"
    assert "Apache License" in (info / "licenses" / "LICENSE").read_text()
    assert said["Author"] == "The dcpg-swarm maintainers"
    assert said["Keywords"]
    assert "Typing :: Typed" in said.get_all("Classifier", [])
    assert any(url.startswith("Paper") for url in said.get_all("Project-URL", []))
    assert "swarm = deploy.cli.__main__:main" in (info / "entry_points.txt").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["library"], ["gridworld-a", "kill", "drones-ppo"]),
        (["topology", "gridworld-a"], ["drone0-drone1", "spectral gap"]),
        (["--version"], ["swarm "]),
    ],
)
def test_it_works_by_name_from_any_folder(
    unpacked: Path, tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    code = (
        "import sys, deploy; from deploy.cli.main import main\n"
        f"assert deploy.__file__.startswith({str(unpacked)!r}), deploy.__file__\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(unpacked)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert all(word in done.stdout for word in words), done.stdout
