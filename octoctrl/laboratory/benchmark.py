"""The stability laboratory as a part of the benchmark: a small study, or one of 6,000 runs."""

from pathlib import Path
from tempfile import TemporaryDirectory

from ..bench.benchmark import Table
from .endings import Verdict
from .studies import matrix, study


def stability(full=False):
    """Verdicts of random runs of the rod, by kind; ``octoctrl stability`` does the same with more to choose, and can be interrupted.

    Parameters
    ----------
    full : bool
        6,000 runs instead of 300.

    Returns
    -------
    Table
    """
    with TemporaryDirectory() as folder:
        outcomes = study(Path(folder) / "outcomes.jsonl", 6000 if full else 300)
    undetected, unstable = (sum(outcome.verdict == name for outcome in outcomes) for name in ("UNDETECTED", "UNSTABLE"))
    return Table(
        name="stability",
        title="Stability laboratory",
        note=f"{len(outcomes)} random runs: {undetected} undetected failures, {unstable} unstable steps; see docs/stability.md.",
        columns=("kind", *(verdict.value for verdict in Verdict)),
        formats=("", *("d" for _ in Verdict)),
        rows=tuple((kind, *row.values()) for kind, row in matrix(outcomes).items()),
    )
