"""Work on several cores: processes that leave Ctrl-C to us, and never outlive us."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import Any


@contextmanager
def pool(
    jobs: int, prepare: Callable[..., None] | None = None, *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """A pool that is ended at once where the block is left by an exception.

    Args:
        jobs: how many processes; 0 for one per core.
        prepare: called in each of them before any work, with these arguments.
    """
    workers = ProcessPoolExecutor(
        jobs or os.cpu_count() or 1,
        get_context("spawn"),
        initializer=_begin,
        initargs=(prepare, arguments),
    )
    try:
        yield workers
    except BaseException:
        for process in list((workers._processes or {}).values()):
            process.kill()
        raise
    finally:
        workers.shutdown(cancel_futures=True)


def _begin(prepare: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    """In a worker: Ctrl-C is for the one that started us, whose end is ours."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare(*arguments)


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
