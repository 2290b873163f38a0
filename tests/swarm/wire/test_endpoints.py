"""Endpoints are read and written with IPv6, and what is none is told the right form."""

import pytest

from swarm.errors import ConfigError
from swarm.wire.endpoints import check_host, endpoint, host_and_port, plain_host


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("tcp/10.0.0.7:7450", "10.0.0.7", 7450),
        ("tls/[::1]:7450", "::1", 7450),
        ("tcp/[fe80::1%eth0]:1", "fe80::1%eth0", 1),
        ("tcp/drone0:65535", "drone0", 65535),
        ("tcp/127.0.0.1:7450#iface=eth0", "127.0.0.1", 7450),
    ],
)
def test_an_endpoint_is_read(text: str, host: str, port: int) -> None:
    assert host_and_port(text) == (host, port)
    assert text.startswith(endpoint(text[:3], host, port))


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("tcp://10.0.0.7:7450", "expected tcp/10.0.0.7:7450"),
        ("udp/10.0.0.7:7450", "expected tcp/10.0.0.7:7450 (agents speak tcp or tls)"),
        ("udp://drone0:1", "expected tcp/drone0:1 (agents speak tcp or tls)"),
        ("tls://[::1]:7450", "expected tls/[::1]:7450"),
        ("tcp/::1:7450", "expected tcp/[::1]:7450"),
        ("::1", "expected tcp/[::1]:7450"),
        ("10.0.0.7:7450", "expected tcp/10.0.0.7:7450"),
        ("10.0.0.7", "expected tcp/10.0.0.7:7450"),
        ("tcp/drone0:99999", "expected tcp/drone0:7450 (ports are 1 to 65535)"),
        ("tcp/:7450", "expected one like tcp/10.0.0.7:7450"),
        ("", "expected one like tcp/10.0.0.7:7450"),
    ],
)
def test_what_is_none_is_told_the_right_form(text: str, right: str) -> None:
    with pytest.raises(ConfigError) as error:
        host_and_port(text)
    assert str(error.value) == f'endpoint "{text}": {right}'


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "[::1]", "fe80::1%eth0", "drone-0.local"])
def test_hosts(host: str) -> None:
    check_host("network.host", host)


@pytest.mark.parametrize("host", ["", "tcp://10.0.0.1", "tcp/10.0.0.1:7", "10.0.0.1:7450", "a b"])
def test_an_endpoint_is_no_host(host: str) -> None:
    with pytest.raises(ConfigError, match="expected an address or a host name"):
        check_host("network.host", host)


def test_one_address_is_written_in_many_ways() -> None:
    assert plain_host("0:0:0:0:0:0:0:1") == plain_host("::1") == "::1"
    assert plain_host("Drone0") == "drone0"
