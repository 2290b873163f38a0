"""An agent on a machine whose clock is not set yet waits, says so, and starts."""

import logging
import threading
import time
from datetime import timedelta
from pathlib import Path

import pytest

from agent.daemon.clock import await_clock
from agent.daemon.notify import Systemd
from deploy.images import certs
from swarm.errors import ConfigError, TooEarlyError
from swarm.wire.security import Security


class Waits(threading.Event):
    """An event whose time passes at once: something happens instead."""

    def __init__(self, meanwhile: object) -> None:
        super().__init__()
        self.meanwhile, self.waited = meanwhile, 0

    def wait(self, timeout: float | None = None) -> bool:
        self.waited += 1
        assert callable(self.meanwhile)
        self.meanwhile()
        return self.is_set()


def made(folder: Path, force: bool = False) -> Security:
    certs.make_certificates(folder, {"drone0": ()}, force=force)
    return Security(*(str(folder / name) for name in ("ca.pem", "{agent}.pem", "{agent}.key")))


@pytest.fixture
def early(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Security:
    """Certificates that begin tomorrow."""
    made(tmp_path)  # an authority whose time has come
    monkeypatch.setattr(certs, "BACKDATED", timedelta(days=-1))
    return made(tmp_path, force=True)


def test_it_waits_says_so_and_starts(
    early: Security,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    with pytest.raises(
        TooEarlyError, match=r"is not valid yet by this machine's clock, which says"
    ):
        early.check("drone0")
    monkeypatch.setattr(certs, "BACKDATED", timedelta(days=1))
    stop = Waits(lambda: made(tmp_path, force=True))  # as if a day had passed
    with caplog.at_level(logging.WARNING):
        assert await_clock(early, "drone0", stop, Systemd({}))
    assert stop.waited == 1
    (said,) = caplog.messages
    assert said.endswith("UTC; waiting until the clock is set")


def test_told_to_stop_it_does_not_wait_on(early: Security) -> None:
    stop = Waits(print)
    stop.meanwhile = stop.set
    assert not await_clock(early, "drone0", stop, Systemd({}))


def test_a_file_that_will_not_do_is_no_matter_of_time(tmp_path: Path) -> None:
    begun = time.monotonic()
    with pytest.raises(ConfigError, match="does not exist"):
        await_clock(Security("a", "b", "c"), "drone0", threading.Event(), Systemd({}))
    assert time.monotonic() - begun < 30
