"""What a signal does, by what there is to put away."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.process.signals import StoppedError, stop_meanwhile, stopping_at_signals

ROOT = Path(__file__).parents[3]


def test_a_loop_is_told_and_the_signals_are_given_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with stop_meanwhile() as stop:
        assert not stop.is_set()
        signal.raise_signal(signal.SIGTERM)
        assert stop.is_set()
    assert signal.getsignal(signal.SIGINT) is before


def test_the_first_signal_stops_and_later_ones_do_not_disturb_a_landing() -> None:
    before = signal.getsignal(signal.SIGINT)
    with stopping_at_signals(patient=True):
        with pytest.raises(StoppedError):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGINT) is before


def test_no_library_swallows_it() -> None:
    assert not issubclass(StoppedError, Exception)


def program(body: str) -> subprocess.Popen[str]:
    """A program that takes signals as ours does, and says when it has come to its body's end."""
    begin = "import threading, time\nfrom deploy.process import signals\nsignals.end_at_signals()\n"
    return subprocess.Popen(
        [sys.executable, "-c", begin + body],
        cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def ended(process: subprocess.Popen[str], *numbers: signal.Signals) -> tuple[int, str]:
    """Exit code and last words of a program that gets these signals once it says so."""
    assert process.stdout is not None
    for number in numbers:
        assert process.stdout.readline() == "now\n"
        process.send_signal(number)
    _, words = process.communicate(timeout=60)
    return process.returncode, words


FOR_EVER = "print('now', flush=True)\ntime.sleep(600)\n"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_where_there_is_nothing_to_put_away_it_ends_at_once(
    number: signal.Signals, code: int
) -> None:
    assert ended(program(FOR_EVER), number) == (code, "swarm: stopped\n")


def test_it_ends_though_the_main_thread_does_not_listen() -> None:
    deaf = (
        "import signal\n"
        "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])\n"  # the watching thread has it
        "print('now', flush=True)\nthreading.Lock().acquire(); lock = threading.Lock()\n"
        "lock.acquire(); lock.acquire()\n"
    )
    assert ended(program(deaf), signal.SIGINT)[0] == 130


def test_work_that_does_not_unwind_in_time_is_left() -> None:
    body = (
        "signals.UNWIND = 0.2\n"
        "with signals.stopping_at_signals():\n"
        "    try:\n        print('now', flush=True); time.sleep(600)\n"
        "    finally:\n        time.sleep(600)\n"
    )
    assert ended(program(body), signal.SIGINT)[0] == 130


def test_a_second_signal_ends_what_is_being_put_away() -> None:
    body = (
        "with signals.stopping_at_signals():\n"
        "    try:\n        print('now', flush=True); time.sleep(600)\n"
        "    finally:\n        print('now', flush=True); time.sleep(600)\n"
    )
    assert ended(program(body), signal.SIGINT, signal.SIGINT)[0] == 130
