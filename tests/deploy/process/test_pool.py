"""Worker processes that leave Ctrl-C to us, and never outlive us."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from deploy.process.pool import pool
from tests.integration.harness import until

ROOT = Path(__file__).parents[3]


def alive(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def test_it_works_and_an_exception_ends_the_workers_in_the_middle_of_it() -> None:
    with pytest.raises(KeyError), pool(1) as workers:
        pid = workers.submit(os.getpid).result()
        os.kill(pid, signal.SIGINT)  # the terminal's Ctrl-C reaches everybody
        assert workers.submit(os.getpid).result() == pid
        workers.submit(time.sleep, 600)
        raise KeyError
    until(lambda: not alive(pid), "the worker has ended")


def test_workers_end_with_the_one_that_started_them() -> None:
    body = (
        "import os, time\nfrom deploy.process.pool import pool\n"
        "if __name__ == '__main__':\n"
        "    with pool(1) as workers:\n"
        "        print(workers.submit(os.getpid).result(), flush=True)\n"
        "        workers.submit(time.sleep, 600).result()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", body], cwd=ROOT, text=True, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    pid = int(process.stdout.readline())
    process.kill()
    process.wait()
    until(lambda: not alive(pid), "the worker has ended")
