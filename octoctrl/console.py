"""Text for people: plans, runs and verdicts in a few aligned lines, and a live progress bar."""

from math import isfinite

import numpy as np


def execution_text(run):
    """Say in a few lines how a plan was carried out.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    str
    """
    recording, trace = run.recording, run.trace
    end = float(recording.time[-1])
    rate = run.statistics.get("wall_time")
    speed = f"   simulated in {rate:.1f} s" if isinstance(rate, int | float) else ""
    plant = run.plant if run.plant == run.plan.plant else f"{run.plant} (planned for {run.plan.plant})"
    lines = [f"run of '{run.plan.task.name}'   {end:.2f} s on arm {run.plan.arm.name}   plant {plant}   feedback {run.feedback}{speed}"]
    rows = [(event.phase, f"{event.planned:.2f} s", f"{event.actual:.2f} s", "met" if event.met else "not met") for event in run.events]
    lines += table(("phase", "planned end", "actual end", "goals"), rows) if rows else []
    last = f"twist {trace.twist[-1]:+.2f}   lifted writhe {trace.lifted_writhe[-1]:+.2f}   lifted link {trace.lifted_link[-1]:+.2f}"
    lines.append(
        f" at the end: {last}   net self-crossings {int(trace.net_crossings()[-1]):+d}   peak activation {recording.levels.max():.2f}"
    )
    lines.append(f" {run.status.value}" + (f" ({recording.note})" if recording.note else ""))
    return "\n".join(lines)


def verdict_text(verdict):
    """Write a verdict as a table.

    Parameters
    ----------
    verdict : Verdict

    Returns
    -------
    str
    """
    rows = []
    for check in verdict.checks:
        unit = f" {check.unit}" if check.unit else ""
        numbers = [f"{_number(value)}{unit}" if isfinite(value) else "never" for value in (check.value, check.limit)]
        rows.append((check.name, *numbers, _number(check.margin) if isfinite(check.margin) else "", "pass" if check.passed else "FAIL"))
    good = sum(check.passed for check in verdict.checks)
    return "\n".join([*table(("check", "value", "limit", "margin", ""), rows), f" VERDICT {verdict.status} ({good}/{len(verdict.checks)})"])


def comparison_text(comparison):
    """Write the errors of a run against its plan as a table.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    str
    """
    numbers = comparison.summary()
    rows = [
        (name.replace("_", " "), f"{numbers[f'{name}_rms']:.4f} turns", f"{numbers[f'{name}_max']:.4f} turns") for name in comparison.errors
    ]
    if "tip_rms" in numbers:
        rows.append(("tip", f"{1e3 * numbers['tip_rms']:.2f} mm", f"{1e3 * numbers['tip_max']:.2f} mm"))
    lines = table(("simulated - planned", "rms", "max"), rows)
    if comparison.delays:
        delays = [(key, f"{delay:.2f} s" if isfinite(delay) else "never") for key, delay in comparison.delays.items()]
        lines += ["", *table(("level passed", "time error"), delays)]
    return "\n".join(lines)


def table(headings, rows):
    """Align columns of text: the first to the left, the others to the right.

    Parameters
    ----------
    headings : tuple of str
    rows : list of tuple of str

    Returns
    -------
    list of str
    """
    widths = [max(len(row[column]) for row in [headings, *rows]) for column in range(len(headings))]
    lines = []
    for row in [headings, *rows]:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append((" " + "   ".join(cells)).rstrip())
    return lines


def plain(value):
    """Turn numbers of NumPy, infinities and tuples into what JSON knows; infinite and undefined numbers become None.

    Parameters
    ----------
    value : object

    Returns
    -------
    object
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, tuple | list):
        return [plain(inner) for inner in value]
    return value if isinstance(value, int | float | str | bool | None) else str(value)


class RichProgress:
    """A bar on standard error: label, share, what is going on, elapsed and remaining time.

    Nothing is shown where standard error is not a terminal; there each stretch of work is announced in one line.
    """

    def __init__(self):
        self._bar = self._task = None

    def start(self, label, total=None):
        """Show a bar for a stretch of work.

        Parameters
        ----------
        label : str
        total : float, optional
            Any unit.
        """
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self.stop()
        console = Console(stderr=True)
        if not console.is_terminal:
            console.print(label, highlight=False)
            return
        columns = [SpinnerColumn(), TextColumn("{task.description}")]
        columns += [BarColumn(), TaskProgressColumn()] if total else []
        columns += [TextColumn("{task.fields[note]}"), TimeElapsedColumn(), *([TimeRemainingColumn()] if total else [])]
        self._bar = Progress(*columns, console=console, transient=True)
        self._task = self._bar.add_task(label, total=total, note="")
        self._bar.start()

    def advance(self, done, note=""):
        """Move the bar.

        Parameters
        ----------
        done : float
            In the unit of the total.
        note : str
        """
        if self._bar is not None:
            self._bar.update(self._task, completed=done, note=note)

    def stop(self):
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
        self._bar = None


def _number(value):
    """At most four significant digits, whole numbers as such."""
    return f"{value:.0f}" if value == round(value) and abs(value) < 1e6 else f"{value:.4f}" if abs(value) >= 1e-3 else f"{value:.1e}"
