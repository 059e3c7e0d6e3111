"""Trajectory optimisation with CasADi: from unknowns that meet the goals to the cheapest ones near them that still do.

    minimise    nominal_weight sum ((p - p_task) / scale)^2 / 2  +  time_weight sum T
                + sum over drives of  effort_weight int a^2 dt  +  smoothness_weight int (da/dt)^2 dt
                + prices of what the model was not identified on: levels that change faster, both oblique families at once
    subject to  |misses(p)| <= BAND tolerances,    u(p) >= OPENING at every guarded step,    lower <= p <= upper

The compiled step and outputs stand inside as a function with exact first derivatives. CasADi's sequential quadratic programming gets the
exact Hessian of the objective and leaves out the curvature of the constraints (Gauss-Newton): from a point that meets the goals three
iterations are usual, where the interior point method IPOPT took ten. Constraints are met on coarse steps; their distance from fine ones
is taken along as a constant, and renewed where the optimiser has ended until that changes nothing any more.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .problem import Grid, Problem, Reading
from .search import COARSE, ENOUGH, FINE

Floats = NDArray[np.float64]

SMOOTHNESS = np.pi**2 / 8
"""Integral of (da/dt)^2 over a raised-cosine ramp, times ramp over level^2."""

STEEPEST = np.pi / 2
"""Largest da/dt of a raised-cosine ramp, times ramp over level."""

FAST_PRICE, MIXED_PRICE = 4.5, 450.0
"""Price of the squared excess of a level's rate over what was identified, relative to that, and of the product of both squared oblique
levels."""

BAND = 0.1
"""Share of a tolerance within which goals are held: less than a plan may use, for the plant will add its own."""

OPENING = 0.25
"""Smallest u of an optimised path on coarse steps."""

PRECISION, VIOLATION, ITERATIONS = 5e-3, 1e-2, 8
"""Optimality of the unknowns in units of their scale, violation of constraints in tolerances, and how many iterations there may be."""

ROUNDS, SETTLED = 3, 0.05
"""How often the distance from fine steps is renewed at most, and its change, in tolerances, that is let pass."""


@dataclass(frozen=True, slots=True)
class Optimised:
    """Where the optimiser ended: unknowns, with phases on samples of the plant, their reading on fine steps, iterations, what it said."""

    x: Floats
    reading: Reading
    iterations: int
    word: str


def objective(problem: Problem, level_rate: float) -> ca.Function:
    """The price of a task's unknowns.

    Parameters
    ----------
    problem : Problem
    level_rate : float, 1/s
        Fastest change of a level that the model was identified on; 0 if on none.

    Returns
    -------
    casadi.Function
        ``(unknowns,) -> price``
    """
    task, p = problem.task, ca.SX.sym("p", len(problem.names))
    begins, primitives = problem.primitives(ca.vertsplit(p))
    end = problem.present.clock + ca.sum1(p[: len(task.phases)])
    price = task.nominal_weight / 2 * ca.sumsqr((p - problem.start) / problem.box.scale) + task.time_weight * end
    order = [phase.name for phase in task.phases]
    active = []
    for drive, primitive in zip(task.drives, primitives, strict=True):
        until = begins[drive.ends] if drive.ends else end
        price += task.effort_weight * primitive.effort(until - begins[drive.begins])
        on = set(range(order.index(drive.begins), order.index(drive.ends) if drive.ends else len(order)))
        for template in primitive.templates():
            active.append((on, template))
            for ramp in ("rise", "fall") if drive.ends else ("rise",):
                if hasattr(template, ramp):
                    seconds = getattr(template, ramp)
                    price += task.smoothness_weight * SMOOTHNESS * template.level**2 / seconds
                    if level_rate > 0:
                        price += FAST_PRICE * ca.fmax(STEEPEST * template.level / seconds / level_rate - 1, 0.0) ** 2
    for (one, first), (other, second) in combinations(active, 2):
        if one & other and {first.groups, second.groups} == {("R-OM",), ("L-OM",)}:
            price += MIXED_PRICE * (first.level * second.level) ** 2
    return ca.Function("price", [p], [price])


class _Constraints(ca.Callback):
    """Misses and openings as a function of the scaled unknowns, with its own Jacobian; remembers what a user's interrupt raised."""

    def __init__(self, problem: Problem, grid: Grid, rows: int) -> None:
        ca.Callback.__init__(self)
        self.problem, self.grid, self.rows = problem, grid, rows
        self.raised: BaseException | None = None
        # CasADi asks for it more than once and keeps none of them alive.
        self.own_jacobian = _Jacobian(self)
        self.construct("constraints", {})

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(len(self.problem.names), 1)

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.rows, 1)

    def read(self, z: Any, slopes: bool) -> Reading:
        """The reading at scaled unknowns."""
        if self.raised is not None:
            raise self.raised
        try:
            # What the quadratic programmes give leaves the bounds by rounding.
            box = self.problem.box
            return self.problem.read(np.clip(np.asarray(z).ravel() * box.scale, box.lower, box.upper), self.grid, slopes)
        except BaseException as error:  # KeyboardInterrupt too, which the optimiser would take for a point without a value
            self.raised = error
            raise

    def eval(self, arguments: Sequence[Any]) -> list[ca.DM]:
        reading = self.read(arguments[0], False)
        return [ca.DM(np.concatenate([reading.misses, reading.openings]))]

    def has_jacobian(self) -> bool:
        return True

    def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> ca.Callback:
        return self.own_jacobian


class _Jacobian(ca.Callback):
    def __init__(self, constraints: _Constraints) -> None:
        ca.Callback.__init__(self)
        self.constraints = constraints
        self.construct("constraint_slopes", {})

    def get_n_in(self) -> int:
        return 2

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.constraints.rows if index else len(self.constraints.problem.names), 1)

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.constraints.rows, len(self.constraints.problem.names))

    def eval(self, arguments: Sequence[Any]) -> list[ca.DM]:
        reading = self.constraints.read(arguments[0], True)
        return [ca.DM(np.concatenate([reading.miss_slopes, reading.opening_slopes]) * self.constraints.problem.box.scale)]


class _Watch(ca.Callback):
    """Ends the optimisation between two iterations when time is up or a user has interrupted."""

    def __init__(self, constraints: _Constraints, stop: Callable[[], bool], tell: Callable[[int], None]) -> None:
        ca.Callback.__init__(self)
        unknowns, rows = len(constraints.problem.names), constraints.rows
        self.sizes = {"x": unknowns, "lam_x": unknowns, "g": rows, "lam_g": rows, "f": 1}
        self.constraints, self.stop, self.tell, self.count = constraints, stop, tell, 0
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.sizes.get(ca.nlpsol_out(index), 0), 1)

    def eval(self, arguments: Sequence[Any]) -> list[float]:
        self.count += 1
        try:
            self.tell(self.count)
        except BaseException as error:
            self.constraints.raised = error
        return [float(self.constraints.raised is not None or self.stop())]


def optimise(
    problem: Problem,
    start: Floats,
    fine: Reading,
    price: ca.Function,
    stop: Callable[[], bool],
    tell: Callable[[int], None] = lambda _count: None,
) -> Optimised:
    """Minimise the price from unknowns that meet the goals.

    Parameters
    ----------
    problem : Problem
    start : (n,) float64
    fine : Reading
        Of `start`, on fine steps.
    price : casadi.Function
        Of `objective`.
    stop : callable
        Whether time is up.
    tell : callable
        Told the number of iterations.

    Returns
    -------
    Optimised
        Which may miss goals: whoever asks checks it.

    Raises
    ------
    KeyboardInterrupt
        As a user's interrupt arrives.
    """
    grid, fine_grid = problem.grid(start, COARSE), problem.grid(start, FINE)
    reading = problem.read(start, grid)
    rows, openings = len(reading.misses) + len(reading.openings), reading.openings
    constraints = _Constraints(problem, grid, rows)
    watch = _Watch(constraints, stop, tell)
    solve = _solver(problem, constraints, watch, price)
    scale, box, x, offset = problem.box.scale, problem.box, start, np.full(len(reading.misses), inf)
    lower, upper, count = box.lower, box.upper, len(problem.task.phases)
    word, iterations = "", 0
    # Where the search could not come nearer, to ask for more would leave the optimiser nothing to do.
    left = np.abs(reading.misses + problem.offset((grid, reading), (fine_grid, fine)))
    band = np.where(left > ENOUGH, left, BAND)
    for turn in range(ROUNDS):
        if x is not start:
            reading, fine_grid = problem.read(x, grid), problem.grid(x, FINE)
            fine = problem.read(x, fine_grid)
        before, offset = offset, problem.offset((grid, reading), (fine_grid, fine))
        if stop() or (lower is not box.lower and np.abs(offset - before).max(initial=0.0) < SETTLED and fine.worst < ENOUGH):
            break
        low = np.concatenate([-band - offset, np.minimum(OPENING, openings)])
        high = np.concatenate([band - offset, np.full(rows - len(offset), inf)])
        try:
            found = solve(x0=x / scale, lbx=lower / scale, ubx=upper / scale, lbg=low, ubg=high)
        except RuntimeError as error:
            if constraints.raised is not None:
                raise constraints.raised from None
            return Optimised(x, fine, iterations, str(error).strip().rpartition("\n")[2])
        if constraints.raised is not None:
            raise constraints.raised
        x = np.clip(np.asarray(found["x"]).ravel() * scale, box.lower, box.upper)
        if turn == ROUNDS - 2:
            # From now on phases end where the plant knows its shape; what that moves the other unknowns make up for.
            x[:count] = problem.on_samples(x[:count])
            lower, upper = box.lower.copy(), box.upper.copy()
            lower[:count] = upper[:count] = x[:count]
        stats = solve.stats()
        word, iterations = str(stats["return_status"]), iterations + int(stats["iter_count"])
        if not stats["success"]:
            break
    return Optimised(x, problem.read(x, problem.grid(x, FINE)), iterations, word)


def _solver(problem: Problem, constraints: _Constraints, watch: _Watch, price: ca.Function) -> ca.Function:
    """CasADi's solver in unknowns divided by their scale; the callbacks must outlive it."""
    count, scale = len(problem.names), problem.box.scale
    z, none, factor, multipliers = ca.MX.sym("z", count), ca.MX.sym("p", 0), ca.MX.sym("f"), ca.MX.sym("g", constraints.rows)
    x = ca.SX.sym("x", count)
    hessian = ca.Function("hessian", [x], [ca.densify(ca.hessian(price(x * scale), x)[0])])
    options: dict[str, Any] = {
        "qpsol": "daqp", "qpsol_options": {"print_time": False, "error_on_fail": False},
        "hess_lag": ca.Function("nlp_hess_l", [z, none, factor, multipliers], [factor * hessian(z)]), "iteration_callback": watch,
        "max_iter": ITERATIONS, "max_iter_ls": 3, "tol_du": PRECISION, "tol_pr": VIOLATION, "calc_lam_p": False, "error_on_fail": False,
        "show_eval_warnings": False, "print_header": False, "print_iteration": False, "print_status": False, "print_time": False,
    }  # fmt: skip
    task: dict[str, Any] = {"x": z, "f": price(z * scale), "g": constraints(z)}
    return ca.nlpsol("planner", "sqpmethod", task, options)
