"""Where two threads wait for each other: a barrier of two counts, by atomic loads and stores.

numba knows none on the processor, so they are written in LLVM's terms. Each thread publishes how often it has come (release: all that it
has written before is seen by who reads the count) and waits until the other has come as often (acquire). While it waits it pauses, and
after some pauses it lets others run: with one core for both, the other could not come otherwise.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import llvmlite.ir as ir
import numpy as np
from numba import typeof, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from ..compiler import kernel
from .parts import Part

Integers = NDArray[np.int64]

APART = 16
"""Places from one count to the next: two cache lines, as processors fetch them in pairs."""
FAR_APART = 128
"""Numbers between what the two threads send."""
PATIENCE = 100
"""Pauses before a thread lets others run."""
LEFT = 2 * APART
"""Place that says that a thread will not come any more."""


class Crew(NamedTuple):
    """What a thread does, and what it shares with the other one.

    Attributes
    ----------
    part : Part
        Of the arm.
    number, threads : int
        Which thread it is, of how many.
    counts : (3 APART,) int64
        How often either thread has come, and whether one has left.
    findings : (threads, 3) int64
        What the guard found in each part, in which family and where.
    sends, takes : (n,) int64
        Places in the buffer of what the other thread needs to know, and of what this one does, in the other's order.
    bounds : (stages + 1,) int64
        Where those of a stage begin.
    mail : (2, n or more) of the buffer's kind
        What either thread has sent.
    """

    part: Part
    number: int
    threads: int
    counts: Integers
    findings: Integers
    sends: Integers
    takes: Integers
    bounds: Integers
    mail: np.ndarray


def cores() -> int:
    """Cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def crews(parts: tuple[Part, ...], kind: Any, border: tuple[Integers, Integers, Integers] | None = None) -> tuple[Crew, ...]:
    """One for each part, of buffers of a `kind`; `border` is what they exchange: places to send and to take (parts, n), and bounds."""
    threads, nothing = len(parts), np.zeros(0, dtype=np.int64)
    counts, findings = np.zeros(3 * APART, dtype=np.int64), np.zeros((threads, 3), dtype=np.int64)
    sends, takes, bounds = ([nothing] * threads, [nothing] * threads, nothing) if border is None else border
    mail = np.zeros((2, len(sends[0]) + FAR_APART), dtype=kind)
    return tuple(Crew(part, k, threads, counts, findings, sends[k], takes[k], bounds, mail) for k, part in enumerate(parts))


def together(advance: Any, jobs: tuple[tuple[Any, ...], ...]) -> Any:
    """Call ``advance(*job)``, which begins with `meet`, in a thread for each of one or two jobs, which end with their crew.

    The other thread lasts as long as the call. An interrupt waits for the end of the call; one that comes before it has begun leaves the
    other thread where it waits for this one, with nothing done.
    """
    if len(jobs) == 1:
        return advance(*jobs[0])
    if not advance.signatures:  # while it is being compiled nobody waits
        advance.compile(tuple(map(typeof, jobs[0])))
    counts = jobs[0][-1].counts
    counts[:] = 0

    def leave(_: Any = None) -> None:
        counts[LEFT] = 1

    with ThreadPoolExecutor(1) as pool:
        try:
            other = pool.submit(lambda: advance(*jobs[1]))
            other.add_done_callback(leave)
            found = advance(*jobs[0])
            other.result()
        except BaseException:
            leave()
            raise
    return found


_in_llvm: Any = intrinsic


def _place(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.gep(make_array(signature.args[0])(context, builder, arguments[0]).data, [arguments[1]])


@_in_llvm
def _load(typing: Any, counts: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load_atomic(_place(context, builder, signature, arguments), "acquire", 8)

    return types.int64(counts, types.int64), generate


@_in_llvm
def _store(typing: Any, counts: Any, place: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store_atomic(arguments[2], _place(context, builder, signature, arguments), "release", 8)
        return context.get_dummy_value()

    return types.void(counts, types.int64, types.int64), generate


@_in_llvm
def _pause(typing: Any) -> Any:
    """Leave the core to its other thread for a moment, where the processor has an instruction for it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        processor = builder.module.triple.split("-")[0]
        if processor in ("x86_64", "i386", "i686"):
            kind = ir.FunctionType(ir.VoidType(), [])
            builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.x86.sse2.pause"), [])
        elif processor in ("aarch64", "arm64"):
            kind = ir.FunctionType(ir.VoidType(), [ir.IntType(32)])
            builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.aarch64.hint"), [ir.IntType(32)(1)])
        return context.get_dummy_value()

    return types.void(), generate


_yield = types.ExternalFunction("sched_yield", types.int32())
_posix = os.name == "posix"


@kernel
def meet(crew: Crew) -> None:
    """Wait until the other thread, if there is one, has come here as well, or has left."""
    if crew.threads == 1:
        return
    counts, own, other = crew.counts, crew.number * APART, (1 - crew.number) * APART
    turn = _load(counts, own) + 1
    _store(counts, own, turn)
    waited = 0
    while _load(counts, other) < turn and not _load(counts, LEFT):
        waited += 1
        if waited < PATIENCE or not _posix:
            _pause()
        else:
            _yield()


@kernel
def exchange(b: Any, crew: Any, stage: Any) -> None:
    """Wait for the other thread, if there is one, and take from it what this one needs to know in a stage."""
    if crew.threads == 1:
        return
    begin, end, own, other = crew.bounds[stage], crew.bounds[stage + 1], crew.number, 1 - crew.number
    for n in range(begin, end):
        crew.mail[own, n] = b[crew.sends[n]]
    meet(crew)
    for n in range(begin, end):
        b[crew.takes[n]] = crew.mail[other, n]
