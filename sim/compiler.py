"""The one way in which a function becomes machine code.

Every kernel is compiled by :func:`kernel`: cached on disk; without fast-math reassociation (results must not depend on how a loop was
vectorised) but with fused multiply-add, one rounding instead of two in a fifth less time; with NumPy's division semantics (a zero
denominator gives inf or nan, which the divergence guard sees, and never an exception from inside the time loop); and without Python's
global lock, so that threads can simulate side by side.
"""

import logging

import numba

_log = logging.getLogger(__name__)


def kernel(function=None, **options):
    """Compile `function` with numba, cached on disk where a cache folder is writable.

    Parameters
    ----------
    function : callable
        Function of arrays and scalars; it must not allocate in its loops and must not raise.
    **options
        Further options of :func:`numba.njit`, for example ``inline="always"``.

    Returns
    -------
    callable
        The compiled dispatcher.

    Notes
    -----
    numba raises ``RuntimeError`` at decoration when neither the package folder nor the user's cache folder can be written
    (read-only installs without a home folder); the kernel is then compiled in memory and a warning names the remedy.
    """
    if function is None:
        return lambda inner: kernel(inner, **options)
    settings = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True} | options
    try:
        return numba.njit(cache=True, **settings)(function)
    except RuntimeError as error:
        _log.warning("compiled code is not kept between runs (%s); set NUMBA_CACHE_DIR to a writable folder", error)
        return numba.njit(**settings)(function)
