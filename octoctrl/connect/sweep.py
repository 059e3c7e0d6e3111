"""Sweeps: many runs over any executor, each a row in a file, so that what is killed goes on; a worker that dies loses nobody else's run.

An executor of `concurrent.futures` breaks as a whole when a worker dies, and does not say whose run it was. All runs that were under way
are then suspects: a new executor is made, and they run one by one. Whoever kills a worker twice is a row whose status is ``lost``.
"""

import contextlib
import multiprocessing
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

from octoctrl.sim.archives import check_source
from octoctrl.sim.errors import OctoctrlError, check_count

from ..progress import NullProgress, Progress
from .jobs import carry_out
from .rows import Rows, check_table, gather, write_table
from .sweep_file import read_sweep

MOST_BLAME = 2
"""So often a run may be under way, the last time alone, when its worker dies."""

WAITING = 64
"""Runs that are handed to an executor of the caller's at a time."""

Job = Mapping[str, Any]
Row = dict[str, Any]


def sweep(
    path: str | Path,
    *,
    jobs: int = 1,
    executor: Executor | Callable[[], Executor] | None = None,
    output: str | Path | None = None,
    share: tuple[int, int] = (1, 1),
    waiting: int | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Run a sweep, or what is missing of it.

    Parameters
    ----------
    path : str or Path
        Of the sweep file.
    jobs : int
        Processes, unless there is an executor.
    executor : Executor, or callable that makes one, optional
        Such as ``client.get_executor()`` of dask.distributed. One that breaks when a worker dies has to come as a callable.
    output : str or Path, optional
        Of the rows (.jsonl); beside the sweep file and called like it if omitted. The table (.csv) is written beside it.
    share : (int, int)
        ``(3, 30)`` does the third of thirty equal shares, with rows in a file of its own.
    waiting : int, optional
        How many runs are handed over at a time: twice the `jobs`, or 64.
    progress : Progress, optional

    Returns
    -------
    list of dict
        All rows that there are, by index.

    Raises
    ------
    OctoctrlError
        If the sweep file is wrong, or rows cannot be written.
    KeyboardInterrupt
        With a sentence that says how many runs are done; they are kept.
    """
    check_count("jobs", jobs, at_least=1)
    number, shares = share
    if not 1 <= number <= shares:
        raise OctoctrlError(f"share {number}/{shares}: the first number goes from 1 to the second, such as 3/30")
    path, display = check_source(path), progress or NullProgress()
    target = Path(output) if output is not None else path.with_suffix(".jsonl")
    if shares > 1:
        target = target.with_name(f"{target.stem}.{number}-of-{shares}{target.suffix}")
    check_table(target.with_suffix(".csv"))
    planned = [job for job in read_sweep(path).jobs() if job["index"] % shares == number - 1]
    with Rows(target) as rows:
        left = [job for job in planned if job["key"] not in rows.known]
        done = len(planned) - len(left)
        display.start(f"sweep of {len(planned)} runs", float(len(planned)))

        def put(row: Row) -> None:
            nonlocal done
            rows.add(row)
            done += 1
            display.advance(done, str(row["status"]))

        try:
            if executor is None:
                drive(left, lambda: Workers(jobs), put, waiting=waiting or 2 * jobs)
            else:
                drive(left, _maker(executor), put, waiting=waiting or WAITING)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"{done} of {len(planned)} runs are done and kept in {target}; start it again to go on") from None
        finally:
            display.stop()
            found = [rows.known[job["key"]] for job in planned if job["key"] in rows.known]
            write_table(target.with_suffix(".csv"), found)
    return found


def gathered(path: str | Path, output: str | Path | None = None) -> list[Row]:
    """Put the rows of all shares of the sweep file `path` together, in `output` and its table.

    Raises
    ------
    OctoctrlError
        If there are none.
    """
    target = Path(output) if output is not None else check_source(path).with_suffix(".jsonl")
    found = gather(target.parent, target.stem)
    with Rows(target) as rows:
        for key, row in found.items():
            if key not in rows.known:
                rows.add(row)
    ordered = sorted(found.values(), key=lambda row: int(row["index"]))
    write_table(target.with_suffix(".csv"), ordered)
    return ordered


def drive(
    jobs: Iterable[Job],
    make: Callable[[], contextlib.AbstractContextManager[Executor]],
    put: Callable[[Row], None],
    *,
    work: Callable[[Job], Row] = carry_out,
    waiting: int = WAITING,
) -> None:
    """Run jobs over an executor, which is made again when it breaks.

    Parameters
    ----------
    jobs : iterable of mapping
        Each with an ``index`` and a ``key``.
    make : callable
        A context that gives an executor.
    put : callable
        Takes the rows as they come.
    work : callable
        From job to row, known to the workers by name.
    waiting : int
        How many jobs are handed over at a time.
    """
    left, blame = {str(job["key"]): job for job in jobs}, Counter[str]()

    def done(key: str, row: Row) -> None:
        del left[key]
        put(row)

    while left:
        with make() as executor:
            for key in _under_way_when_broken(executor, left, blame, done, work, waiting):
                blame[key] += 1


def _under_way_when_broken(
    executor: Executor,
    left: Mapping[str, Job],
    blame: Counter[str],
    done: Callable[[str, Row], None],
    work: Callable[[Job], Row],
    waiting: int,
) -> list[str]:
    """Run what is left, suspects first and one by one; returns what was under way when the executor broke, or nothing."""
    ahead = sorted(left, key=lambda key: -blame[key])
    running: dict[Future[Row], str] = {}
    try:
        while ahead or running:
            while ahead and len(running) < (1 if blame[ahead[0]] or any(blame[key] for key in running.values()) else waiting):
                key = ahead.pop(0)
                running[executor.submit(work, left[key])] = key
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                key = running[future]
                try:
                    row = future.result()
                except BrokenExecutor:
                    if len(running) == 1 and blame[key] + 1 >= MOST_BLAME:
                        done(key, lost(left[key], "its worker died"))
                        return []
                    raise
                except Exception as error:  # the executor's own: a run that fails comes back as a row
                    row = lost(left[key], f"{type(error).__name__}: {error}")
                del running[future]
                done(key, row)
    except BrokenExecutor:
        return list(running.values())
    except BaseException:
        for future in running:
            future.cancel()
        raise
    return []


def lost(job: Job, why: str) -> Row:
    """The row of a `job` that no worker brings back, and `why`."""
    return {"index": job["index"], "key": job["key"], **job["changes"], "status": "lost", "note": " ".join(why.split())}


class Workers(ProcessPoolExecutor):
    """Processes that Ctrl-C does not reach, not even while they start: it ends this one, which ends them without a word."""

    def __init__(self, jobs: int) -> None:
        # Forked processes would share the threads and locks of this one.
        super().__init__(jobs, mp_context=multiprocessing.get_context("spawn"))

    def submit(self, *work: Any, **more: Any) -> Future[Any]:
        """Start a process for the `work`, if there is one to start; it inherits what signals are held back."""
        with _interrupts_held_back():
            return super().submit(*work, **more)

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> None:
        processes: list[Any] = list((self._processes or {}).values())
        manager: Any = self._executor_manager_thread
        self.shutdown(wait=kind is None, cancel_futures=True)  # first, for who waits in a pool that breaks may not have been cancelled
        if kind is not None:
            for process in processes:
                process.terminate()
            if manager is not None:
                manager.join()


@contextlib.contextmanager
def _interrupts_held_back() -> Iterator[None]:
    if not hasattr(signal, "pthread_sigmask"):  # on Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _maker(executor: Executor | Callable[[], Executor]) -> Callable[[], contextlib.AbstractContextManager[Executor]]:
    if not isinstance(executor, Executor):
        return executor
    given, used = executor, iter([True])

    def once() -> contextlib.AbstractContextManager[Executor]:
        if not next(used, False):
            raise OctoctrlError(
                "the executor broke when a worker died; give a callable that makes one, such as lambda: ProcessPoolExecutor(8)"
            )
        return contextlib.nullcontext(given)

    return once
