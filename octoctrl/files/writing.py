"""Files that are either the old one or the new one: written beside their place under a name of their own, then moved into it."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from octoctrl.sim.errors import OctoctrlError


@contextlib.contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """Give a place beside `path` to write to, and move it to `path` at the end; after a failure nothing is left of it.

    Parameters
    ----------
    path : Path

    Yields
    ------
    Path
        Of a new, empty file in the same folder.

    Raises
    ------
    OctoctrlError
        If the folder cannot be written or the disk is full.
    """
    target = Path(os.path.realpath(path))
    part = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        os.close(handle)
        part = Path(name)
        yield part
        # A temporary file is its owner's alone; a finished one has the permissions that a new file gets here.
        mask = os.umask(0)
        os.umask(mask)
        part.chmod(0o666 & ~mask)
        os.replace(part, target)
    except OSError as error:
        raise OctoctrlError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        if part is not None:
            part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> Path:
    """Write a text file (UTF-8) aside and move it to `path`, which is returned."""
    with written_aside(path) as part:
        part.write_text(text, encoding="utf-8")
    return path
