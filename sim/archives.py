"""Archives: a JSON header and named arrays in one .npz file, without pickle. One writer, and one reader of files that may be damaged."""

import json
import os
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import OctoctrlError
from .writing import check_suffix, written_aside

Arrays = Mapping[str, NDArray[Any]]

SWELLING, ALLOWANCE = 200, 1 << 26
"""An archive may hold so many times the bytes of its file, and so many more; what says that it holds more is not read at all."""


def write_archive(path: str | Path, header: Mapping[str, Any], arrays: Arrays) -> None:
    """Write a header and arrays aside and move them to a path.

    Parameters
    ----------
    path : str or Path
        Checked before, see `octoctrl.sim.writing.check_target`.
    header : mapping
        Plain values.
    arrays : mapping of str to array
        None is called ``header``.

    Raises
    ------
    OctoctrlError
        If it cannot be written.
    """
    text = np.frombuffer(json.dumps(header, allow_nan=False).encode(), dtype=np.uint8)
    with written_aside(path) as part, open(part, "wb") as file:
        np.savez(file, allow_pickle=False, header=text, **arrays)
        file.flush()
        os.fsync(file.fileno())


def check_source(path: str | Path, advice: str = "") -> Path:
    """Check that a file is there to be read.

    Parameters
    ----------
    path : str or Path
    advice : str
        How to come by one, for the message.

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If there is none, or a folder in its place.
    """
    path = Path(path)
    if path.is_dir():
        raise OctoctrlError(f"{path} is a folder; give the path of a file")
    if not path.exists():
        raise OctoctrlError(f"{path} does not exist{f'; {advice}' if advice else ''}")
    return path


def read_archive(path: str | Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]] | None:
    """Read an archive that anyone may have written, or damaged.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    (dict, dict of str to array) or None
        Header and arrays; None if it is no archive, or damaged.

    Raises
    ------
    OctoctrlError
        If there is no such file, its suffix is another, or it may not be read.
    """
    path = check_source(check_suffix(path, (".npz",)))
    try:
        with open(path, "rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about what is damaged
            return _read(file, path.stat().st_size)
    except PermissionError as error:
        raise OctoctrlError(f"{path} cannot be read: {error.strerror}") from None
    except (Exception, RecursionError):
        # Whatever zipfile, zlib, NumPy and JSON make of bytes that nobody meant: their own errors are of a dozen kinds.
        return None


def swells(claimed: int, size: int) -> bool:
    """Whether a file of so many bytes (`size`) cannot mean the bytes that it claims (`claimed`) to hold."""
    return not 0 <= claimed <= SWELLING * size + ALLOWANCE


def _read(file: Any, size: int) -> tuple[dict[str, Any], dict[str, NDArray[Any]]] | None:
    with zipfile.ZipFile(file) as archive:
        if swells(sum(item.file_size for item in archive.infolist()), size):
            return None
    file.seek(0)
    with np.load(file, allow_pickle=False) as loaded:
        arrays = {name: loaded[name] for name in loaded.files}
    header = json.loads(arrays.pop("header").tobytes())
    if not isinstance(header, dict) or not all(isinstance(array, np.ndarray) for array in arrays.values()):
        return None
    return header, arrays
