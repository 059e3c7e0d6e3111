"""Packages that come with an extra only: imported where they are used, and missed in one sentence that says how to get them."""

import importlib
from typing import Any

from octoctrl.sim.errors import OctoctrlError


def extra(name: str, *modules: str) -> Any:
    """Import what an extra brings.

    Parameters
    ----------
    name : str
        Of the extra, as in ``pip install 'octoctrl[name]'``.
    *modules : str

    Returns
    -------
    module
        The first of the `modules`.

    Raises
    ------
    OctoctrlError
        If one is not installed; the message says the command.
    """
    try:
        first, *_ = [importlib.import_module(module) for module in modules]
        return first
    except ImportError as error:
        raise OctoctrlError(f"this needs {error.name or modules[0]}, which is not installed: pip install 'octoctrl[{name}]'") from None
