"""Security settings: strict, files that must fit, and an access control that can be read."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from agent.config.experiment import load
from deploy.images.certs import make_certificates
from swarm.errors import ConfigError
from swarm.wire.keys import Keys
from swarm.wire.security import OBSERVER, Party, Security, access_control, read_certificate

FILE = Path(__file__).parents[3] / "deploy" / "library" / "swarms" / "gridworld-a.toml"
MEMBERS = ("drone0", "drone1", "drone2")
KEYS = Keys("s")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make_certificates(tmp_path, dict.fromkeys(MEMBERS, ()))
    return tmp_path


def files(folder: Path) -> Security:
    return Security(f"{folder}/ca.pem", f"{folder}/{{agent}}.pem", f"{folder}/{{agent}}.key")


def test_off_by_default() -> None:
    config = load(FILE)
    assert config.network.security.settings(config.party("drone0")) == {}
    assert config.endpoint("drone0").startswith("tcp/")


def test_relative_paths_begin_at_the_swarm_file(tmp_path: Path) -> None:
    file = tmp_path / "swarm.toml"
    table = '\n[network.security]\nca = "c/ca.pem"\ncertificate = "/x/{agent}.pem"\nkey = "k"\n'
    file.write_text(FILE.read_text() + table)
    config = load(file)
    own = config.network.security.files_of("drone1")
    assert own.ca == str(tmp_path.resolve() / "c" / "ca.pem")
    assert own.certificate == "/x/drone1.pem"
    assert config.endpoint("drone0").startswith("tls/")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["network.security.ca=c"], "expected ca, certificate and key together"),
        (['network.security={ca="c",certificate="c",key="k",users="u"}'], "expected either"),
        (["network.security.cert=c"], 'unknown key "network.security.cert"'),
        (
            ['network.security={ca="c",certificate="c",key="k"}', "agents.1.id=observer"],
            'agents.1.id = "observer"',
        ),
        (
            ['network.security={ca="c",certificate="c",key="k"}', "agents.1.endpoint=tcp/h:1"],
            'agents.1.endpoint = "tcp/h:1": expected tls/',
        ),
        (["agents.1.endpoint=tls/h:1"], 'agents.1.endpoint = "tls/h:1": expected tcp/'),
    ],
)
def test_a_mistake_in_the_file_is_named(settings: list[str], words: str) -> None:
    with pytest.raises(ConfigError, match=words.replace(".", r"\.")) as caught:
        load(FILE, settings)
    assert "\n" not in str(caught.value)


def test_good_files_are_read(folder: Path) -> None:
    for name in (*MEMBERS, OBSERVER):
        files(folder).check(name)
    certificate = read_certificate(files(folder).files_of("drone1"))
    assert certificate.name == "drone1"
    assert certificate.hosts == ("localhost", "127.0.0.1", "::1")


def spoil(folder: Path, how: str) -> None:
    """Do something to the files of drone0."""
    certificate, key = folder / "drone0.pem", folder / "drone0.key"
    match how.split():
        case ["no", name]:
            (folder / name).unlink()
        case ["folder", name]:
            (folder / name).unlink()
            (folder / name).mkdir()
        case ["junk", name]:
            (folder / name).write_text("junk\n")
        case ["other", "key"]:
            key.write_bytes((folder / "drone1.key").read_bytes())
        case ["other", "agent"]:
            key.write_bytes((folder / "drone1.key").read_bytes())
            certificate.write_bytes((folder / "drone1.pem").read_bytes())
        case ["other", "authority"]:
            make_certificates(folder / "foreign", {"drone0": ()})
            for file in (certificate, key):
                file.write_bytes((folder / "foreign" / file.name).read_bytes())
        case ["expired"]:
            make_certificates(folder, {"drone0": ()}, days=-1, force=True)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("no ca.pem", 'ca "{}/ca.pem" does not exist'),
        ("no drone0.pem", 'certificate "{}/drone0.pem" does not exist'),
        ("no drone0.key", 'key "{}/drone0.key" does not exist'),
        ("folder drone0.key", 'key "{}/drone0.key" cannot be read'),
        ("junk ca.pem", 'ca "{}/ca.pem" holds no certificate'),
        ("junk drone0.pem", 'certificate "{}/drone0.pem" holds no certificate'),
        ("junk drone0.key", 'key "{}/drone0.key" holds no private key'),
        ("other key", 'key "{}/drone0.key" does not belong to certificate "{}/drone0.pem"'),
        ("other agent", 'certificate "{}/drone0.pem" is of "drone1": expected one of "drone0"'),
        ("other authority", 'certificate "{}/drone0.pem" is not signed by ca "{}/ca.pem"'),
        ("expired", 'certificate "{}/drone0.pem" has expired'),
    ],
)
def test_files_that_will_not_do_are_named_in_one_line(folder: Path, how: str, words: str) -> None:
    spoil(folder, how)
    with pytest.raises(ConfigError) as caught:
        files(folder).check("drone0")
    assert words.replace("{}", str(folder)) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("drone0:one\ndrone1\n", "line 2: expected name:password"),
        ("drone1:two\n", 'has no line of "drone0"'),
    ],
)
def test_passwords_that_will_not_do_are_named(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "users.txt").write_text(text)
    with pytest.raises(ConfigError, match=words):
        Security(users=str(tmp_path / "users.txt")).check("drone0")


def test_passwords_become_settings(tmp_path: Path) -> None:
    (tmp_path / "users.txt").write_text("drone0:with:colon\nobserver:two\n")
    security = Security(users=str(tmp_path / "users.txt"))
    settings = security.settings(Party("drone0", KEYS, MEMBERS))
    assert settings["transport/auth/usrpwd/user"] == "drone0"
    assert settings["transport/auth/usrpwd/password"] == "with:colon"


# --- access control ---------------------------------------------------------------------------


def allowed(rules: dict[str, Any], peer: str, flow: str, message: str, key: str) -> bool:
    """Whether a rule of this peer includes the key; Zenoh judges so."""
    subjects = {s["id"] for s in rules["subjects"] if peer in s["cert_common_names"]}
    applied = {r for p in rules["policies"] if subjects & set(p["subjects"]) for r in p["rules"]}
    return any(
        rule["id"] in applied
        and flow in rule["flows"]
        and message in rule["messages"]
        and any(zenoh.KeyExpr(own).includes(zenoh.KeyExpr(key)) for own in rule["key_exprs"])
        for rule in rules["rules"]
    )


SAYS: dict[str, Callable[[str], str]] = {
    "put": KEYS.params,
    "liveliness_token": KEYS.alive,
    "declare_queryable": KEYS.state,
    "reply": KEYS.status,
}


@pytest.mark.parametrize("message", SAYS)
def test_everybody_speaks_for_himself_alone(message: str) -> None:
    key = SAYS[message]
    rules = access_control(Party("drone0", KEYS, MEMBERS))
    for peer in (*MEMBERS, OBSERVER, "mallory"):
        for named in (*MEMBERS, OBSERVER, "*", "drone$*"):
            assert allowed(rules, peer, "ingress", message, key(named)) == (
                peer == named and peer in MEMBERS
            )
            assert allowed(rules, peer, "egress", message, key(named)) == (
                named == "drone0" and peer != "mallory"
            )


def test_an_observer_says_nothing_and_members_ask_everything() -> None:
    watching = access_control(Party(OBSERVER, KEYS, MEMBERS))
    assert not any(
        allowed(watching, peer, "egress", message, key(named))
        for peer in MEMBERS
        for named in (*MEMBERS, OBSERVER)
        for message, key in SAYS.items()
    )
    for me in ("drone0", OBSERVER):
        rules = access_control(Party(me, KEYS, MEMBERS))
        for flow in ("ingress", "egress"):
            for peer in (*MEMBERS, OBSERVER):
                assert allowed(rules, peer, flow, "query", KEYS.state())
                assert allowed(rules, peer, flow, "declare_subscriber", KEYS.params())
                assert allowed(rules, peer, flow, "liveliness_query", KEYS.alive())
            assert not allowed(rules, "mallory", flow, "query", KEYS.state())


def test_every_key_names_its_agent_where_access_control_looks() -> None:
    own = zenoh.KeyExpr(KEYS.own("drone0"))
    for key in (
        KEYS.alive("drone0"),
        KEYS.params("drone0"),
        KEYS.state("drone0"),
        KEYS.status("drone0"),
        KEYS.telemetry("drone0"),
    ):
        assert own.includes(zenoh.KeyExpr(key))
        assert Keys.identity(key) == ("s", "drone0")
