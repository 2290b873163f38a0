"""``swarm certs``: what it makes, what it leaves alone, what it refuses."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from agent.config.experiment import load
from deploy.images.certs import hosts_of, make_certificates
from swarm.errors import ConfigError
from tests.deploy.cli.test_main import FILE, ROOT

AGENTS = {"drone0": ("10.0.0.7",), "drone1": ("drone1.local",)}


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_makes_an_authority_and_a_certificate_each(tmp_path: Path) -> None:
    assert make_certificates(tmp_path, AGENTS, days=30) == ["drone0", "drone1", "observer"]
    names = {f"{n}.{end}" for n in ("ca", "drone0", "drone1", "observer") for end in ("pem", "key")}
    assert set(contents(tmp_path)) == names
    assert all(file.stat().st_mode & 0o777 == 0o600 for file in tmp_path.glob("*.key"))
    authority = x509.load_pem_x509_certificate((tmp_path / "ca.pem").read_bytes())
    certificate = x509.load_pem_x509_certificate((tmp_path / "drone0.pem").read_bytes())
    certificate.verify_directly_issued_by(authority)
    (name,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    assert name.value == "drone0"
    hosts = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert hosts.get_values_for_type(x509.DNSName) == ["localhost"]
    assert list(map(str, hosts.get_values_for_type(x509.IPAddress))) == [
        "127.0.0.1",
        "::1",
        "10.0.0.7",
    ]
    usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert set(usage) == {ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH}
    basic = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value
    assert not basic.ca
    days = (certificate.not_valid_after_utc - certificate.not_valid_before_utc).days
    assert days == 31  # a day of it past, for slow clocks


def test_again_adds_what_is_missing_and_leaves_the_rest(tmp_path: Path) -> None:
    make_certificates(tmp_path, {"drone0": ()})
    before = contents(tmp_path)
    assert make_certificates(tmp_path, {"drone0": (), "drone1": ()}) == ["drone1"]
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert make_certificates(tmp_path, {"drone0": (), "drone1": ()}) == []
    assert contents(tmp_path) == after


def test_force_renews_under_the_same_authority(tmp_path: Path) -> None:
    make_certificates(tmp_path, {"drone0": ()})
    before = contents(tmp_path)
    assert make_certificates(tmp_path, {"drone0": ()}, force=True) == ["drone0", "observer"]
    after = contents(tmp_path)
    unchanged = {name for name in before if after[name] == before[name]}
    assert unchanged == {"ca.pem", "ca.key"}


@pytest.mark.parametrize("name", ["observer", "ca", "a/b", ""])
def test_names_that_mean_something_else_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="expected"):
        make_certificates(tmp_path, {name: ()})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("lost", ["ca.key", "ca.pem"])
def test_half_an_authority_is_refused(tmp_path: Path, lost: str) -> None:
    make_certificates(tmp_path, {"drone0": ()})
    (tmp_path / lost).unlink()
    with pytest.raises(ConfigError, match=lost):
        make_certificates(tmp_path, {"drone1": ()})


def test_a_key_of_another_authority_is_refused(tmp_path: Path) -> None:
    make_certificates(tmp_path / "one", {"drone0": ()})
    make_certificates(tmp_path / "two", {"drone0": ()})
    (tmp_path / "one" / "ca.key").write_bytes((tmp_path / "two" / "ca.key").read_bytes())
    with pytest.raises(ConfigError, match="does not belong"):
        make_certificates(tmp_path / "one", {"drone1": ()})


def test_hosts_come_from_the_file_and_from_options() -> None:
    config = load(FILE, ["agents.1.endpoint=tcp/[fd00::7]:7447", "network.host=lab"])
    hosts = hosts_of(config, "drone8", ["drone8=10.0.0.8", "all.local"])
    assert hosts["drone0"] == {"lab", "all.local"}
    assert hosts["drone1"] == {"fd00::7", "all.local"}
    assert hosts["drone8"] == {"10.0.0.8", "all.local"}
    with pytest.raises(ConfigError, match='--host "drone9=h"'):
        hosts_of(config, "", ["drone9=h"])
    with pytest.raises(ConfigError, match="expected a swarm file or --agents"):
        hosts_of(None)


def test_the_command_says_what_goes_where(
    tmp_path: Path, swarm: Callable[..., tuple[int, str, str]]
) -> None:
    code, out, err = swarm("certs", tmp_path / "c", FILE, "--agents", "drone4", "--days", "7")
    assert (code, err) == (0, "")
    assert "drone0, drone1, drone2, drone3, drone4, observer" in out.replace("\n", " ")
    assert "[network.security]" in out
    assert f'certificate = "{tmp_path / "c"}/{{agent}}.pem"' in out
    assert "nothing was missing" in swarm("certs", tmp_path / "c", FILE)[1]


def test_a_machine_without_cryptography_still_flies_and_is_told() -> None:
    code = (
        "import sys; sys.modules['cryptography'] = None\n"
        "import agent.daemon.process, deploy.diagnose.doctor\n"
        "import deploy.launch.up, deploy.cli.main\n"
        "sys.argv = ['swarm', 'certs', 'x', '--agents', 'drone0']\n"
        "deploy.cli.main.main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert 'pip install "cryptography' in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
