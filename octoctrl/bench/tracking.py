"""Planned against simulated: every shipped task of free motion on one rod and on the full arm, under every controller."""

from collections.abc import Sequence
from itertools import groupby

from octoctrl.sim.plants import check_plant

from ..carrying.planning import plan
from ..tables import Table
from .planning import CONTROLLERS, FOLLOWED, TIME_LIMIT, goals_met

PLANTS = ("rod", "assembly-coarse-mixed")
FULL = "assembly-mixed"
WITHIN = {"writhe_rms": 0.10, "twist_rms": 0.05}
"""How far the plant may be from the plan, root mean square over the run, turns."""


def tracking(*, full: bool = False, plants: Sequence[str] | None = None, names: Sequence[str] = FOLLOWED) -> Table:
    """How far plants are from the plans of the shipped tasks.

    Parameters
    ----------
    full : bool
        The full arm with all nodes of its rings, too.
    plants : sequence of str, optional
        Names of plants instead.
    names : sequence of str
        Tasks.

    Returns
    -------
    Table
    """
    chosen = [check_plant(name) for name in plants or ((*PLANTS, FULL) if full else PLANTS)]
    rows: list[tuple[str | float | bool | None, ...]] = []
    for modelled_as, alike in groupby(chosen, lambda row: row.modelled_as):
        found = {name: plan(name, plant=modelled_as, time_limit=TIME_LIMIT) for name in names}
        for row in alike:
            for name, made in found.items():
                for feedback in CONTROLLERS:
                    met, values = goals_met(made, feedback, plant=row.name, allow_unsolved=True)
                    errors = [values[key] for key in WITHIN]
                    within = all(error <= limit for error, limit in zip(errors, WITHIN.values(), strict=True))
                    rows.append((name, row.name, made.status.name.lower(), feedback, _word(met), values["worst"], *errors,
                                 100 * values["tip_rms"], _word(within)))  # fmt: skip
    limits = " and ".join(f"{limit:.2f} of {key.removesuffix('_rms')}" for key, limit in WITHIN.items())
    return Table(
        name="tracking",
        title="Planned against simulated",
        note="Each task planned on the reduced model of its plant and carried out on it. Worst goal in tolerances; errors against the "
        f"plan, root mean square over the run, turns and percent of the arm's length; within: {limits}.",
        columns=("task", "plant", "plan", "feedback", "goals met", "worst goal", "writhe rms", "twist rms", "tip rms [%]", "within"),
        formats=("", "", "", "", "", ".2f", ".3f", ".3f", ".1f", ""),
        rows=tuple(rows),
    )


def _word(value: bool) -> str:
    return "yes" if value else "no"
