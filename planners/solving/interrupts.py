"""Ctrl-C while planning: kept until the next simulation of the model, at most some milliseconds, and raised there.

CasADi calls Python and numpy calls CasADi; an exception that a signal raises amid these is lost or comes back as another error.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_pending = threading.Event()


def heed() -> None:
    """Raise the KeyboardInterrupt of a Ctrl-C that has come, if this thread is the one that it is meant for."""
    if _pending.is_set() and threading.current_thread() is threading.main_thread():
        _pending.clear()
        raise KeyboardInterrupt


@contextmanager
def interrupts_kept() -> Iterator[None]:
    """Keep Ctrl-C for `heed`, which is called at the end as well; handlers of the user's own, and other threads, are left alone."""
    usual = signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is not usual:
        yield
        return

    def keep(_number: int, _frame: Any) -> None:
        _pending.set()

    signal.signal(signal.SIGINT, keep)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        heed()
