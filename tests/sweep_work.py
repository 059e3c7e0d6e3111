"""What the workers of test_sweeps.py do; imports next to nothing, so that a worker is there at once."""

import os
import signal
from pathlib import Path


def held_back():
    """The signals that do not reach this process."""
    return set(signal.pthread_sigmask(signal.SIG_BLOCK, ()))


def square(job):
    """A run that may kill its worker, always or while a file is missing."""
    kill = job["changes"].get("kill")
    if kill == "always":
        os._exit(9)
    if kill and not Path(kill).exists():
        Path(kill).touch()
        os._exit(9)
    if job["changes"].get("fail"):
        raise ValueError("odd number")
    return {"index": job["index"], "key": job["key"], "status": "finished", "square": job["index"] ** 2}
