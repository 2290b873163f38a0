"""Ports that are held: for the one they are meant for, against everybody else."""

import socket
from pathlib import Path

import pytest

from deploy.process import ports
from deploy.process.ports import hold, hold_free, is_free
from swarm.errors import ConfigError

HOST = "127.0.0.1"
STREAM, DATAGRAM = socket.SOCK_STREAM, socket.SOCK_DGRAM


@pytest.mark.parametrize("kind", [STREAM, DATAGRAM])
def test_nobody_chooses_what_is_held_until_it_is_let_go(kind: socket.SocketKind) -> None:
    with hold_free(HOST, 3, kind) as held:
        for other in (STREAM, DATAGRAM):
            assert hold(HOST, held.numbers[1:2], other) is None
    again = hold(HOST, held.numbers, kind)
    assert again is not None
    with again:
        assert again.numbers == held.numbers


def test_a_listener_comes_in_beside_the_holder_and_only_one() -> None:
    with hold_free(HOST, 1) as held:
        (port,) = held.numbers
        assert is_free(HOST, port)
        with socket.create_server((HOST, port)):
            socket.create_connection((HOST, port)).close()
            assert not is_free(HOST, port)
            assert hold(HOST, [port]) is None
        with socket.create_server((HOST, port)):  # it comes back after its end, still held
            assert hold(HOST, [port]) is None
        with socket.socket() as stranger, pytest.raises(OSError, match="in use"):
            stranger.bind((HOST, port))


def test_a_datagram_listener_comes_in_beside_the_holder() -> None:
    with hold_free(HOST, 1, DATAGRAM) as held, socket.socket(socket.AF_INET, DATAGRAM) as user:
        user.bind((HOST, held.numbers[0]))
        assert hold(HOST, held.numbers, DATAGRAM) is None


def test_what_somebody_listens_on_is_not_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    with hold_free(HOST, 2) as held:
        first = held.numbers[0]
    monkeypatch.setattr(ports, "LOWEST", first)
    monkeypatch.setattr(ports, "_first_ephemeral", lambda: first + 2)
    with socket.create_server((HOST, first)), pytest.raises(ConfigError, match="no 1 free port"):
        hold_free(HOST, 1)  # the only candidate is taken


def test_chosen_ports_are_none_that_the_kernel_hands_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with hold_free(HOST, 4) as held:
        assert ports.LOWEST <= held.numbers[0] < held.numbers[-1] < ports._first_ephemeral()
    monkeypatch.setattr(ports, "EPHEMERAL", tmp_path / "not Linux")
    assert ports._first_ephemeral() == ports.USUAL_EPHEMERAL


def test_a_host_that_is_none_is_one_line() -> None:
    with pytest.raises(ConfigError, match=r'host "no\.such\.host\.invalid"'):
        hold("no.such.host.invalid", [12_345])
    with pytest.raises(ConfigError, match="is no address of this machine"):
        hold_free("192.0.2.1", 1)
