"""What is still being made, as parts in a folder beside its file: a kill at any moment leaves all that was done.

``run.npz.parts/000000.npz`` says how it began, every further part what has come since, and what is needed to go on. A part is moved into
its place when it is whole and on the disk. The folder belongs to one process at a time, and goes when the file is there. While there is a
file, it is what counts; a folder without one is what was broken off.
"""

import contextlib
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from octoctrl.sim.errors import OctoctrlError

from .store import check_file, load, save
from .writing import make_folder

SUFFIX = ".parts"


def folder_of(path: str | Path) -> Path:
    """The folder of parts of the file at `path`, or `path` itself if it is one."""
    path = Path(path)
    return path if path.suffix == SUFFIX else path.parent / (path.name + SUFFIX)


def parts_in(folder: Path) -> list[Path]:
    """The parts in a `folder`, in order; none if there is no such folder."""
    return sorted(folder.glob("[0-9]" * 6 + ".npz"))


def load_parts(folder: Path) -> list[Any]:
    """What the parts in a `folder` hold, in order."""
    return [load(part) for part in parts_in(folder)]


def load_joined(folder: Path) -> Any:
    """What the parts in a `folder` come to; the first knows how they are joined.

    Raises
    ------
    OctoctrlError
        If they are damaged, or none.
    """
    items = load_parts(folder)
    if not items or not callable(getattr(items[0], "joined", None)):
        raise OctoctrlError(f"{folder} holds no run, or is damaged")
    return items[0].joined(items[1:])


def check_parts(path: str | Path, *, overwrite: bool = False) -> Path:
    """Check the `path` of a file that is to be made in parts; `overwrite` allows for an old file, and for the parts of another.

    Raises
    ------
    OctoctrlError
        As `check_file` does, or if there are parts that may not be replaced.
    """
    path = check_file(path, overwrite=overwrite)
    if parts_in(folder_of(path)) and not overwrite:
        raise OctoctrlError(
            f"{folder_of(path)} holds a run that was broken off; go on with: octoctrl run --resume {path}, or begin anew with -f"
        )
    return path


class Parts:
    """The folder of parts of a file, held by this process; leave it by `finish` or `close`, or as a context.

    Parameters
    ----------
    path : str or Path
        The file that is to be.
    overwrite : bool
        Whether the file, and parts of a run that was broken off, may be replaced.
    resume : bool
        Whether to go on with the parts that are there.

    Attributes
    ----------
    path, folder : Path

    Raises
    ------
    OctoctrlError
        If the path is no good, another process holds the folder, there are parts that may not be replaced, or none to go on with.
    """

    def __init__(self, path: str | Path, *, overwrite: bool = False, resume: bool = False) -> None:
        self.path = check_parts(path, overwrite=overwrite or resume)
        self.folder = folder_of(self.path)
        known = parts_in(self.folder)
        if resume and not known:
            held = "exists: nothing was broken off" if self.path.exists() else "does not exist"
            raise OctoctrlError(f"{self.folder} holds no parts to go on with, and {self.path} {held}; run the plan anew")
        make_folder(self.folder)
        self._lock = hold(self.folder / "lock", self.path)
        self._next = len(known) if resume else 0
        if not resume:
            self._clear()

    def __enter__(self) -> "Parts":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def load(self) -> list[Any]:
        """What the parts hold that are there, in order."""
        return load_parts(self.folder)

    def append(self, item: Any) -> None:
        """Write `item` as the next part; from the first on, an old file at `path` is gone."""
        save(self.folder / f"{self._next:06d}.npz", item, overwrite=True)
        self._next += 1
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()

    def finish(self) -> None:
        """Take the folder away: the file is there."""
        self._clear()
        self._next = 0
        self.close()

    def close(self) -> None:
        """Let go of the folder, which stays if anything has come since the first part."""
        if self._next <= 1:
            self._clear()
            with contextlib.suppress(OSError):
                (self.folder / "lock").unlink()
                self.folder.rmdir()
        os.close(self._lock) if self._lock >= 0 else None
        self._lock = -1

    def _clear(self) -> None:
        for old in (*parts_in(self.folder), *self.folder.glob(".[0-9]*.part.npz")):
            old.unlink()


def hold(lock: Path, path: Path) -> int:
    """A descriptor that holds the file `lock` until it is closed or the process ends, however it ends.

    Raises
    ------
    OctoctrlError
        If another process holds it; the message is about `path`.
    """
    handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
    with contextlib.suppress(ImportError):  # where there are no such locks
        import fcntl

        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            raise OctoctrlError(f"{path} is being written by another process; wait for it, or give another path") from None
    return handle
