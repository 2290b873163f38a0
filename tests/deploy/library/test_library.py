"""Names stand for files of the library; a path wins; what is near a mistake is told."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from deploy.cli.library import app
from deploy.library import FAULTS, KINDS, POLICIES, SWARMS, about, entries, find, named
from swarm.errors import ConfigError


def test_a_name_is_a_file_of_the_library_and_a_path_wins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for kind, name in ((SWARMS, "gridworld-a"), (FAULTS, "kill"), (POLICIES, "drones-ppo")):
        assert find(Path(name), kind).read_bytes()[:1]
        assert find(Path(name), kind).name == name + kind.suffix
    assert find(Path("some/where"), SWARMS) == Path("some/where")
    assert find(Path("missing.toml"), SWARMS) == Path("missing.toml")
    (tmp_path / "gridworld-a").mkdir()  # a run folder, say
    assert find(Path("gridworld-a"), SWARMS) == Path("gridworld-a")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gridwurld-a", ['no swarm file "gridwurld-a"', "did you mean gridworld-a"]),
        ("cart", ["did you mean cartpole?"]),
        ("zzz", ['no swarm file "zzz": expected a path or a name; "swarm library" lists them']),
        ("mine", ['did you mean "mine.toml"?']),
    ],
)
def test_an_unknown_name_is_one_line_with_what_is_near(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text('name = "mine"\n')
    with pytest.raises(ConfigError) as error:
        find(Path(name), SWARMS)
    assert all(word in str(error.value) for word in words), error.value
    assert "\n" not in str(error.value)


def test_everything_in_it_says_what_it_is_about_and_no_copy_hides_another() -> None:
    for kind in KINDS:
        assert entries(kind)
        if kind is not POLICIES:
            assert all(about(path) for path in entries(kind))
    files = [path.name for kind in KINDS for path in entries(kind)]
    assert len(files) == len(set(files))
    assert {path.suffix for path in named("drones-ppo")} == {".toml", ".safetensors"}
    assert [path.name for path in named("drones-ppo.toml")] == ["drones-ppo.toml"]


def test_it_is_listed_shown_and_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def library(*arguments: str) -> str:
        done = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert done.exit_code == 0
        return done.stdout

    monkeypatch.chdir(tmp_path)
    listed = library().splitlines()
    for name in ("gridworld-a ", "kill ", "drones-ppo "):
        assert any(line.startswith(f"  {name}") and len(line) > 40 for line in listed)
    assert set(json.loads(library("--json"))) == {"swarms", "faults", "policies"}
    shown = library("show", "drones-ppo")
    assert 'name = "drones-ppo"' in shown
    assert "licence       Apache-2.0" in shown
    assert library("copy", "gridworld-a") == "gridworld-a.toml\n"
    source = find(Path("gridworld-a"), SWARMS)
    assert Path("gridworld-a.toml").read_bytes() == source.read_bytes()
    with pytest.raises(ConfigError, match=r'"gridworld-a\.toml" exists'):
        library("copy", "gridworld-a")
    with pytest.raises(ConfigError, match='the library has no "gridworld"'):
        library("show", "gridworld")
