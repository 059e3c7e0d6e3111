"""What feedback holds on its planned course: twist and lifted writhe, and in each phase the numbers that its goals read.

Rows are values r_i of a shape, each with an error e_i that costs as much as a usual correction (see `design`): a tenth of a goal's
tolerance, or all of it where a band leaves room, but no less than what the shape is not known by,

    e_i^2 = (TIGHT tolerance)^2 + |dr_i/dq noise|^2

because the side on which a straight arm has its suckers, and the place of a bend that is not there yet, are worth no correction. The weight
1 / e_i^2 grows with the square of the time since the phase began, until the goal has to hold; from then on the goal itself is aimed at,
where the plan keeps to a third of the tolerance.
"""

from functools import partial
from itertools import pairwise
from math import inf
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..asking.goals.measured import ScalarGoal
from ..asking.task import Task
from ..contracts import Expression, Floats, Goal, Outputs, When
from ..model.output_kernels import LINK, OUTPUTS, TWIST, WRITHE
from ..model.readings import Rows, residual_function, rows_function
from ..model.reduced import ReducedModel

TOPOLOGY_ERROR, LOOSE = 0.01, 0.05
"""Error of lifted writhe or twist, turns, that costs as much as a correction: where a goal of the task reads topology, and where none
does."""

TIGHT = 0.1
"""Share of a goal's tolerance that does."""

EARLY = 0.05
"""Share of a phase that counts as its begin."""


class _Row(NamedTuple):
    """Rows of a goal: begin and end of its phase and from when on it has to hold, s; the error; what is held, and what is missed."""

    begin: float
    end: float
    full: float
    error: float
    values: Rows
    misses: Rows

    def share(self, times: Floats) -> Floats:
        """Share of the full weight at `times`, s: it grows towards the time from which the goal has to hold, and is 0 in other phases."""
        ramp = np.clip((times - self.begin) / max(self.full - self.begin, 1e-9), EARLY, 1.0) ** 2
        return np.where((times > self.begin - 1e-9) & (times < self.end + 1e-9), ramp, 0.0)


class Along(NamedTuple):
    """What is held along a plan: values (T, R), slopes (T, R, n), weights 1 / e^2 (T, R), and the way to the values from what is aimed
    at (T, R).
    """

    values: Floats
    slopes: Floats
    weights: Floats
    aims: Floats


class Held:
    """The rows of a task on a model; the first two are twist and lifted writhe, turns.

    Parameters
    ----------
    task : Task
    edges : tuple of float, s
        Planned begins of the phases, and the end of the last.
    model : ReducedModel
    """

    def __init__(self, task: Task, edges: tuple[float, ...], model: ReducedModel) -> None:
        self._model, self._pole = model, task.convention.pole
        self._rows, topological = list[_Row](), False
        for phase, (begin, end) in zip(task.phases, pairwise(edges), strict=True):
            for goal in (goal for goal in phase.goals if getattr(goal, "steered", True)):
                function = rows_function(partial(_numbers, goal), model.arm, model.sections)
                if _is_topology(function):
                    topological = True
                else:
                    full = begin if goal.when is When.THROUGHOUT else max(end - goal.hold, begin)
                    until = inf if phase is task.phases[-1] else end
                    misses = residual_function([goal], model.arm, model.sections)
                    self._rows.append(_Row(begin, until, full, _error(goal), Rows(function), Rows(misses)))
        self.topology_error = TOPOLOGY_ERROR if topological else LOOSE

    def along(self, times: Floats, strains: Floats, noise: Floats) -> Along:
        """What is held on planned strains (T, S, 4) whose error is `noise` (n,)."""
        count = len(strains)
        outputs, by_strains = self._model.outputs(strains, self._pole)
        by_strains = by_strains.reshape(count, len(OUTPUTS), -1)
        values, slopes = [outputs[:, [TWIST, WRITHE]]], [by_strains[:, [TWIST, WRITHE]]]
        weights, aims = [np.full((count, 2), self.topology_error**-2)], [np.zeros((count, 2))]
        for row in self._rows:
            read, first, second = row.values(outputs, strains)
            values.append(read)
            slopes.append(first @ by_strains + second)
            unknown = np.square(slopes[-1] * noise).sum(axis=2)
            share = row.share(times)[:, None]
            weights.append(share / (row.error**2 + unknown))
            aims.append((times > row.full - 1e-9)[:, None] * row.misses(outputs, strains)[0])
        return Along(*(np.concatenate(parts, axis=1) for parts in (values, slopes, weights, aims)))

    def seen(self, outputs: Floats, strains: Floats, expected: Floats) -> Floats:
        """Values (R,) of measured outputs and strains (S, 4), with writhe and link on the branch next to the `expected` ones."""
        outputs = outputs.copy()
        outputs[[WRITHE, LINK]] -= 2 * np.round((outputs[WRITHE] - expected[1]) / 2)
        return np.concatenate([outputs[[TWIST, WRITHE]], *(row.values(outputs[None], strains[None])[0][0] for row in self._rows)])


def _numbers(goal: Goal, outputs: Outputs) -> list[Expression]:
    """What of a goal is held."""
    return [goal.read(outputs)] if isinstance(goal, ScalarGoal) else goal.residuals(outputs)


def _error(goal: Goal) -> float:
    """What costs as much as a correction: of a band, which leaves room, the whole tolerance."""
    return goal.tolerance * (1.0 if isinstance(goal, ScalarGoal) and goal.band[0] < goal.band[1] else TIGHT)


def _is_topology(function: ca.Function) -> bool:
    """Whether rows read nothing but twist, writhe and link of the whole arm."""
    by_outputs, by_strains = function.jac_sparsity(0, 0), function.jac_sparsity(0, 1)
    return by_strains.nnz() == 0 and set(by_outputs.get_col()) <= {TWIST, WRITHE, LINK}
