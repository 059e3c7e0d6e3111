"""Writing a file: asked for beforehand, written beside its place, moved into it when whole.

Whatever kills the writer, a file is either the old one or the new one, and two programs that write the same path do not disturb each other.
"""

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from .errors import OctoctrlError


def check_target(path: str | Path, *, overwrite: bool = False, suffixes: tuple[str, ...] = (".npz",)) -> Path:
    """Check a path that is to be written, before the work is done.

    Parameters
    ----------
    path : str or Path
    overwrite : bool
        Whether a file that exists may be replaced; one that is write-protected never is.
    suffixes : tuple of str
        Allowed ones.

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If the suffix is unknown, the folder is missing or cannot be written, or the file exists and may not be replaced.
    """
    path = check_suffix(path, suffixes)
    if path.exists():
        if path.is_dir():
            raise OctoctrlError(f"{path} is a folder; give the path of a file")
        if not overwrite:
            raise OctoctrlError(f"{path.name} exists; use -f to replace")
        if not path.stat().st_mode & 0o222:
            raise OctoctrlError(f"{path} is write-protected; remove it first or give another path")
    folder = path.resolve().parent
    if not folder.is_dir():
        raise OctoctrlError(f"folder {path.parent} does not exist; make it first")
    if not os.access(folder, os.W_OK):
        raise OctoctrlError(f"folder {path.parent} cannot be written; give a path in another one")
    return path


def check_suffix(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    """Check that a `path` ends in one of the `suffixes` that are known.

    Raises
    ------
    OctoctrlError
        If it does not.
    """
    path = Path(path)
    if path.suffix not in suffixes:
        what = f"unknown format '{path.suffix}'" if path.suffix else f"{path} does not say its format"
        raise OctoctrlError(f"{what}; use {' or '.join(suffixes)}")
    return path


@contextlib.contextmanager
def written_aside(path: str | Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; at the end, what was written there takes its place.

    A symbolic link goes on pointing where it does, and the file there is replaced; a file that is replaced leaves its mode to the new one.

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Path
        New, in the same folder, with the same suffix.

    Raises
    ------
    OctoctrlError
        If the file cannot be written; `path` is then as it was.
    """
    place = Path(path).resolve()
    part = place.with_name(f".{place.stem}.{secrets.token_hex(6)}.part{place.suffix}")
    try:
        yield part
        if place.exists():
            part.chmod(place.stat().st_mode & 0o777)
        os.replace(part, place)
    except OSError as error:
        raise OctoctrlError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
