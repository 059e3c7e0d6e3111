"""The one way in which a function becomes machine code.

Every kernel is compiled by :func:`kernel`: cached on disk; without fast-math reassociation (results must not depend on how a loop was
vectorised) but with fused multiply-add, one rounding instead of two in a fifth less time; with NumPy's division semantics (a zero
denominator gives inf or nan, which the divergence guard sees, and never an exception from inside the time loop); without Python's
global lock, so that threads can simulate side by side; and in the precision of its arguments, see `Constants`.
"""

import hashlib
import logging
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import Lock
from types import CellType, CodeType
from typing import Any

import numba
import numpy as np
from numba.core import ir, types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, PassManager, register_pass
from numba.core.typed_passes import NopythonTypeInference
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

_log = logging.getLogger(__name__)

BUILDING = Lock()
"""Held while compiled code is put together, so that plants in several threads share it."""


@register_pass(mutates_CFG=False, analysis_only=False)
class Constants(FunctionPass):
    """Give the constants of a function single precision if one of its arguments has it.

    One source so serves both precisions. A Python float is double, and what it meets would be promoted to double with it: literals, and
    floats and tuples of floats in closures and modules become single here. Whole numbers stay what they are, as they may be indices: in
    a kernel a number is written with its point where it meets reals.
    """

    _name = "constants"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Replace the constants in the untyped code of the function."""
        if not any(map(_is_single, state.args)):
            return False
        for block in state.func_ir.blocks.values():
            for assignment in block.find_insts(ir.Assign):
                if isinstance(assignment.value, ir.Const | ir.Global | ir.FreeVar):
                    assignment.value.value = _single(assignment.value.value)
        return True


class _Compiler(CompilerBase):
    """numba's own compiler, with `Constants` before it infers types."""

    def define_pipelines(self) -> list[PassManager]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        place = [item[0] for item in passes.passes].index(NopythonTypeInference)
        passes.passes.insert(place, (Constants, "precision of constants"))
        passes.finalize()
        return [passes]


def _is_single(kind: Any) -> bool:
    parts: Any = kind if isinstance(kind, types.BaseTuple) else ()
    return any(map(_is_single, parts)) or getattr(kind, "dtype", kind) == types.float32


def _single(value: Any) -> Any:
    if type(value) is float:
        return np.float32(value)
    return tuple(map(_single, value)) if type(value) is tuple else value


def kernel(function: Callable[..., Any] | None = None, **options: Any) -> Any:
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
    Without a folder that can be written (read-only installs without a home folder) the kernel is compiled in memory, and a warning names
    the remedy.
    """
    if function is None:
        return lambda inner: kernel(inner, **options)
    settings: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True, "pipeline_class": _Compiler} | options
    if function.__closure__ is not None:
        # Machine code of variants that were compiled in different processes could otherwise bear one name, and a process that loads both
        # would run one for the other: numba tells them apart by counting.
        function.__qualname__ += f"_{fingerprint(function)[:12]}"
    compiled = numba.njit(**settings)(function)
    try:
        compiled._cache = _Cache(function, settings)
    except RuntimeError:
        _say_that_nothing_is_kept()
    return compiled


def borrowing_kernel(function: Callable[..., Any]) -> Any:
    """`kernel` for a function that makes no array of its own, nor assigns one array to another.

    numba counts references to the arrays that a function takes from a tuple or cuts from an array, every time, with locked instructions.
    The caller holds them all, so that nothing is lost where nobody counts: a step of the reduced model takes a fifth less time.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
        The compiled dispatcher.
    """
    return kernel(function, _nrt=False)


def by_address(kernels: tuple[Any, ...], *arguments: Any) -> NDArray[np.int64]:
    """Addresses of kernels that return nothing, compiled for arguments like these, for `call`; before them, what these arguments are.

    A loop that calls other kernels by name is compiled together with all of them, again at every level. By address each kernel is
    compiled once, for all loops that call it.
    """
    return _addresses(kernels, tuple(map(numba.typeof, arguments)))


@cache
def _addresses(kernels: tuple[Any, ...], kinds: tuple[Any, ...]) -> NDArray[np.int64]:
    results = [item.get_compile_result(types.void(*kinds)) for item in kernels]
    places = [result.library.get_pointer_to_function(result.fndesc.llvm_func_name) for result in results]
    return np.array([_number(kinds), *places], dtype=np.int64)


def _number(kinds: tuple[Any, ...]) -> int:
    return int(hashlib.sha256(str(kinds).encode()).hexdigest()[:15], 16)


_in_llvm: Any = intrinsic


@_in_llvm
def call(typing: Any, addresses: Any, which: Any, arguments: Any) -> Any:
    """Call the kernel number `which` of `by_address` with a tuple of arguments, in compiled code.

    Raises
    ------
    TypeError
        If it is compiled for arguments of other types.
    """
    kinds = tuple(arguments)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        table = make_array(addresses)(context, builder, values[0]).data
        with builder.if_then(builder.icmp_signed("!=", builder.load(table), table.type.pointee(_number(kinds))), likely=False):
            context.call_conv.return_user_exc(builder, TypeError, ("a kernel is called with other types than it is compiled for",))
        place = builder.load(builder.gep(table, [builder.add(values[1], values[1].type(1))]))
        kernel = builder.inttoptr(place, context.call_conv.get_function_type(types.none, kinds).as_pointer())
        given = [builder.extract_value(values[2], k) for k in range(len(kinds))]
        context.call_conv.call_function(builder, kernel, types.none, kinds, given)
        return context.get_dummy_value()

    return types.void(addresses, types.int64, arguments), generate


@cache
def _say_that_nothing_is_kept() -> None:
    _log.warning("compiled code is not kept between runs, for no folder of its own can be written; set NUMBA_CACHE_DIR to one that can")


class _Index(IndexDataCacheFile):
    """Index of the code on disk; one that names types which have moved since it was written is as good as none.

    Code lies under a name of its own. numba counts, so that a process could run the code of another that began before the source
    was changed.
    """

    def save(self, key: tuple[Any, ...], data: Any) -> None:
        """Keep the code `data` of a function of this `key`, first the code and then the entry that leads to it."""
        name = f"{self._index_name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)
        self._save_index(self._load_index() | {key: name})

    def _load_index(self) -> dict[Any, str]:
        try:
            return super()._load_index()
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            return {}


class _Cache(FunctionCache):
    """Code on disk, found again by what a function is made of.

    numba's own key holds the functions of a closure under identities that are new in every process, so that a loop made of other kernels
    would be compiled at every start; and it misses changes of functions in other files.
    """

    def __init__(self, function: Callable[..., Any], settings: dict[str, Any]) -> None:
        super().__init__(function)
        place = self._impl
        self._cache_file = _Index(self._cache_path, place.filename_base, place.locator.get_source_stamp())
        self._settings = _options(settings)

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        # What is compiled for `by_address`, with the result that it has, is what a call of the same arguments runs.
        return getattr(sig, "args", sig), codegen.magic_tuple(), (self._settings, fingerprint(self._py_func))


def cache_folder(function: Callable[..., Any]) -> Path | None:
    """Where compiled code of functions of the same file is kept, or None if no folder can be written.

    Parameters
    ----------
    function : callable
        Any Python function of the file.
    """
    try:
        return Path(FunctionCache(function).cache_path)
    except RuntimeError:
        return None


_EMPTY = CellType()
"""What a function holds that is not yet defined: itself, while it is being decorated."""


def fingerprint(function: Callable[..., Any]) -> str:
    """Digest of a function, of all functions that it calls, and of the constants that they use.

    Parameters
    ----------
    function : callable

    Returns
    -------
    str
        The same in every process, another one if any of that changes.
    """
    return _digest(function, {})


def _digest(value: Any, known: dict[Any, str]) -> str:
    function = getattr(value, "py_func", value)
    if not hasattr(function, "__code__"):
        return _constant(value)
    if function not in known:
        known[function] = "itself"  # for a function that calls itself
        code, names = function.__code__, function.__globals__
        used = [cell.cell_contents for cell in function.__closure__ or () if cell != _EMPTY]
        used += [names[name] for name in code.co_names if name in names]
        parts = [code.co_code.hex(), str(code.co_names), *map(_constant, code.co_consts), *(_digest(item, known) for item in used)]
        parts.append(_options(getattr(value, "targetoptions", {})))
        known[function] = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return known[function]


def _options(settings: dict[str, Any]) -> str:
    return repr(sorted((name, sorted(value) if isinstance(value, set) else value) for name, value in settings.items()))


def _constant(value: Any) -> str:
    if isinstance(value, CodeType):
        return value.co_code.hex() + "".join(map(_constant, value.co_consts))
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
    if isinstance(value, tuple):
        return f"({','.join(_digest(item, {}) for item in value)})"
    if isinstance(value, bool | int | float | complex | str | bytes | np.generic | None):
        return repr(value)
    return f"{type(value).__module__}.{getattr(value, '__qualname__', getattr(value, '__name__', type(value).__qualname__))}"
