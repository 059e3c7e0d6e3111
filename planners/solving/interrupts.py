"""Ctrl-C and termination while planning: kept until the next simulation of the model, at most some milliseconds, and treated there.

CasADi calls Python and numpy calls CasADi; an exception that a signal's handler raises amid these is lost or comes back as another error.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

KEPT = (signal.SIGINT, signal.SIGTERM)

_pending: list[Callable[[], Any]] = []
"""What is left to be called, by signals that have come."""


def heed() -> None:
    """Call the handler of the first signal that has come, if this is the thread that handles them; it may raise, as that of Ctrl-C does."""
    if _pending and threading.current_thread() is threading.main_thread():
        treat = _pending[0]
        _pending.clear()
        treat()


@contextmanager
def interrupts_kept() -> Iterator[None]:
    """Keep signals that a Python function handles for `heed`, which is called at the end as well; other threads are left alone."""
    usual: dict[int, Callable[..., Any]] = {number: handler for number in KEPT if callable(handler := signal.getsignal(number))}
    if threading.current_thread() is not threading.main_thread():
        usual = {}

    def keep(number: int, _frame: Any) -> None:
        _pending.append(partial(usual[number], number, None))

    for number in usual:
        signal.signal(number, keep)
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        heed()
