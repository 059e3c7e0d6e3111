"""Trajectory optimisation: choose phase durations, levels and ramps so that every phase ends with its goals met.

    minimise    nominal_weight sum ((p - p_task) / scale)^2 / 2  +  time_weight sum T
                + sum over drives of  effort_weight int a^2 dt  +  smoothness_weight int (da/dt)^2 dt
    subject to  |goals(p)| <= tolerances / 3,    lower <= p <= upper,    p = (durations T, free numbers of the drives)

The unknowns are some ten numbers; the reduced model is simulated inside the constraints, with exact derivatives from its own sensitivity
steps. IPOPT solves it with the exact Hessian of the objective and without the curvature of the constraints (Gauss-Newton), which costs
nothing and leads every reasonable guess to the same plan. What the arm cannot do is refused before anything is solved.
"""

from copy import copy
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from time import perf_counter

import casadi as ca
import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import check_number
from octoctrl.sim.topology.trace import TopologyTrace

from ..asking.schedule import Schedule
from ..asking.task import miss_in_phase
from ..contracts import When
from ..model.readings import residual_function
from .plan import GoalReport, Plan, PlanReport, PlanStatus
from .reachability import unreachable

MODEL_STEP, FEWEST_STEPS = 0.15, 4
"""Step of the reduced model in a phase of its nominal duration, s, and the fewest steps of a phase."""

SMOOTHNESS = np.pi**2 / 8
"""Integral of (da/dt)^2 over a raised-cosine ramp, times ramp over level^2."""

PRECISION = 5e-3
"""Optimality to which the unknowns are found, in units of their scale; goals are met to a thousandth of that."""

GOAL_SHARE = 1 / 3
"""Share of a goal's tolerance that the plan may use; the rest is left to the plant."""

LEVEL_SCALE, TIME_SCALE = 0.1, 0.5
"""A change that counts as large: of a level, and of a time or speed relative to the task's own."""

PREDICTION_STEP = 0.05
"""Step with which the finished plan is simulated again, s."""


class PhaseProblem:
    """A task as functions of one vector: durations first, then the free numbers of the drives in order.

    Parameters
    ----------
    task : Task
    model : ReducedModel
    """

    def __init__(self, task, model):
        task = task.on(model.arm)
        self.task, self.model = task, model
        self.steps = [max(FEWEST_STEPS, round(phase.duration / MODEL_STEP)) for phase in task.phases]
        self.ends = np.cumsum(self.steps)
        self.names = [f"{phase.name}.duration" for phase in task.phases]
        lower = [phase.shortest for phase in task.phases]
        upper = [phase.longest for phase in task.phases]
        start = [phase.duration for phase in task.phases]
        for drive in task.drives:
            made = drive.at(dict.fromkeys((phase.name for phase in task.phases), 0.0), {})
            for number, (low, high) in drive.bounds().items():
                self.names.append(f"{drive.name}.{number}")
                lower.append(low)
                upper.append(high)
                start.append(getattr(made, number))
        self.lower, self.upper, self.start = np.array(lower), np.array(upper), np.array(start)
        levels = np.array([name.endswith("level") for name in self.names])
        self.scale = np.where(levels, LEVEL_SCALE, TIME_SCALE * self.start)
        self._build()
        self._take_goals(task)

    def with_goals(self, task):
        """The same problem with the goals of `task`, which differs in nothing else."""
        other = copy(self)
        other._take_goals(task)
        return other

    def _take_goals(self, task):
        self.task, self.rows, tolerances = task, [], []
        for end, steps, phase in zip(self.ends, self.steps, task.phases, strict=True):
            for goal in phase.goals:
                # All steps of the phase, or the last of those that the goal must hold for in a phase of nominal duration.
                held = steps if goal.when is When.THROUGHOUT else int(np.ceil(steps * min(goal.hold / phase.duration, 1.0))) + 1
                instants = np.arange(end - min(held, steps) + 1, end + 1)
                function = residual_function([goal], self.model.arm, self.model.sections).map(len(instants))
                self.rows.append((instants, function))
                tolerances += [goal.tolerance] * function.size1_out(0) * len(instants)
        self.band = GOAL_SHARE * np.array(tolerances)

    def _build(self):
        p = ca.SX.sym("p", len(self.names))
        begins, primitives = self._primitives(ca.vertsplit(p))
        activation = Schedule(primitives=tuple(primitives), duration=1.0).activation()
        durations = p[: len(self.task.phases)]
        lengths = ca.vertcat(*(ca.repmat(durations[index] / steps, steps) for index, steps in enumerate(self.steps)))
        ends = ca.cumsum(lengths)
        edges, count, sections, lag = self.model.edges, lengths.shape[0], self.model.sections, self.model.lag
        # Rows: step, group, section, as the reduced model wants them after one reshape.
        levels = ca.SX(count * len(MUSCLE_GROUPS) * sections, 1)
        for group in activation.groups:
            column = MUSCLE_GROUPS.index(group)
            for section in range(sections):
                values = [activation.compose(ca, group, ends[step] - lag, edges[section], edges[section + 1]) for step in range(count)]
                rows = [(step * len(MUSCLE_GROUPS) + column) * sections + section for step in range(count)]
                levels[rows] = ca.vertcat(*values)
        inputs = ca.vertcat(lengths, levels)
        self.inputs = ca.Function("inputs", [p], [inputs])
        slopes = ca.jacobian(inputs, p)
        self.input_slopes = ca.Function("input_slopes", [p], [slopes])
        task = self.task
        objective = task.nominal_weight / 2 * ca.sumsqr((p - self.start) / self.scale) + task.time_weight * ca.sum1(durations)
        end = ca.sum1(durations)
        for drive, primitive in zip(task.drives, primitives, strict=True):
            until = begins[drive.ends] if drive.ends else end
            objective += task.effort_weight * primitive.effort(until - begins[drive.begins])
            for template in primitive.templates():
                for ramp in ("rise", "fall") if drive.ends else ("rise",):
                    if hasattr(template, ramp):
                        objective += task.smoothness_weight * SMOOTHNESS * template.level**2 / getattr(template, ramp)
        self.objective = ca.Function("objective", [p], [objective])
        self.hessian = ca.Function("hessian", [p], [ca.hessian(objective, p)[0]])

    def _primitives(self, values):
        """Phase begins (dict) and primitives for numbers or symbols `values`."""
        values = list(values)
        begins, now = {}, 0.0
        for phase in self.task.phases:
            begins[phase.name] = now
            now = now + values.pop(0)
        primitives = [drive.at(begins, {number: values.pop(0) for number in drive.bounds()}) for drive in self.task.drives]
        return begins, primitives

    def schedule(self, p):
        """Phase begins and the schedule of the vector `p`."""
        begins, primitives = self._primitives(float(value) for value in p)
        return begins, Schedule(primitives=tuple(primitives), duration=float(sum(p[: len(self.task.phases)])))

    def _horizon(self, p):
        inputs = np.asarray(self.inputs(p)).ravel()
        count = self.ends[-1]
        return inputs[:count], inputs[count:].reshape(count, len(MUSCLE_GROUPS), self.model.sections)

    def simulate(self, p):
        """Motion of the reduced model under `p`."""
        lengths, levels = self._horizon(p)
        return self.model.simulate(levels, lengths)

    def misses(self, p):
        """Residuals of the goals at the instants at which they have to hold, (R,)."""
        return self._residuals(self.simulate(p).strains)[0]

    def miss_slopes(self, p):
        """Residuals (R,) and their exact derivatives (R, numbers)."""
        lengths, levels = self._horizon(p)
        slopes = np.asarray(self.input_slopes(p))
        count = len(lengths)
        motion, strain_slopes = self.model.sensitivities(
            levels, slopes[count:].reshape(*levels.shape, -1), lengths, slopes[:count].reshape(count, -1)
        )
        values, by_strains, instants = self._residuals(motion.strains)
        return values, np.einsum("rsc,rscp->rp", by_strains, strain_slopes[instants])

    def _residuals(self, strains):
        """Residuals (R,), derivatives by the strains (R, S, 4) and instants (R,) of all goals."""
        needed = np.unique(np.concatenate([instants for instants, _ in self.rows])) if self.rows else np.empty(0, dtype=int)
        found, found_slopes, when = [np.empty(0)], [np.empty((0, *strains.shape[1:]))], [np.empty(0, dtype=int)]
        if len(needed):
            outputs, output_slopes = self.model.outputs(strains[needed], self.task.convention.pole)
        for instants, function in self.rows:
            place, count = np.searchsorted(needed, instants), len(instants)
            values, by_outputs, by_strains = function(outputs[place].T, strains[instants].reshape(-1, strains.shape[2]).T)
            by_outputs, by_strains = (np.asarray(part).reshape(-1, count, part.shape[1] // count) for part in (by_outputs, by_strains))
            total = by_strains.reshape(*by_strains.shape[:2], *strains.shape[1:])
            found.append(np.asarray(values).ravel())
            found_slopes.append((total + np.einsum("rto,tosc->rtsc", by_outputs, output_slopes[place])).reshape(-1, *strains.shape[1:]))
            when.append(np.tile(instants, len(by_outputs)))
        return np.concatenate(found), np.concatenate(found_slopes), np.concatenate(when)


class _Slopes(ca.Callback):
    """Derivative of the goals, for CasADi."""

    def __init__(self, problem):
        super().__init__()
        self.problem = problem
        self.construct("goal_slopes", {})

    def get_n_in(self):
        return 2

    def get_sparsity_in(self, index):
        return ca.Sparsity.dense(len(self.problem.band if index else self.problem.names), 1)

    def get_sparsity_out(self, index):
        return ca.Sparsity.dense(len(self.problem.band), len(self.problem.names))

    def eval(self, arguments):
        return [ca.DM(self.problem.miss_slopes(np.asarray(arguments[0]).ravel())[1])]


class _Goals(ca.Callback):
    """The goals as a function of the unknowns, for CasADi, with their own derivative."""

    def __init__(self, problem):
        super().__init__()
        self.problem = problem
        self.slopes = _Slopes(problem)
        self.construct("goals", {})

    def get_sparsity_in(self, index):
        return ca.Sparsity.dense(len(self.problem.names), 1)

    def get_sparsity_out(self, index):
        return ca.Sparsity.dense(len(self.problem.band), 1)

    def eval(self, arguments):
        return [ca.DM(self.problem.misses(np.asarray(arguments[0]).ravel()))]

    def has_jacobian(self):
        return True

    def get_jacobian(self, name, inputs, outputs, options):
        return self.slopes


class _Watch(ca.Callback):
    """Shows iterations."""

    def __init__(self, problem, progress):
        super().__init__()
        self.sizes = {"x": len(problem.names), "g": len(problem.band), "lam_x": len(problem.names), "lam_g": len(problem.band), "f": 1}
        self.progress, self.count = progress, 0
        self.construct("watch", {})

    def get_n_in(self):
        return ca.nlpsol_n_out()

    def get_sparsity_in(self, index):
        return ca.Sparsity.dense(self.sizes.get(ca.nlpsol_out(index), 0), 1)

    def eval(self, arguments):
        self.count += 1
        self.progress.advance(self.count, f"iteration {self.count}, largest miss {float(ca.norm_inf(arguments[2])):.1e}")
        return [0]


def solver(problem, *, time_limit=30.0, max_iterations=60, warm=False, progress=None):
    """IPOPT for a problem, in unknowns divided by their scale.

    Parameters
    ----------
    problem : PhaseProblem
    time_limit : float, s
        Wall-clock limit.
    max_iterations : int
    warm : bool
        Whether the guess is a plan already, so that the barrier may start low.
    progress : Progress, optional

    Returns
    -------
    solve : casadi.Function
        To be called with ``x0, lbx, ubx, lbg, ubg``.
    keep : list
        The callbacks inside it, which must live as long as it is used.
    """
    count = len(problem.names)
    z = ca.MX.sym("z", count)
    scale = ca.DM(problem.scale)
    parameters, factor, multipliers = ca.MX.sym("p", 0), ca.MX.sym("f"), ca.MX.sym("g", len(problem.band))
    hessian = ca.diag(scale) @ problem.hessian(z * scale) @ ca.diag(scale)
    curvature = ca.Function("nlp_hess_l", [z, parameters, factor, multipliers], [ca.triu(ca.densify(factor * hessian))])
    goals = _Goals(problem)
    options = {
        "hess_lag": curvature,
        "calc_lam_p": False,
        "print_time": False,
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "tol": PRECISION,
            "constr_viol_tol": 1e-3 * PRECISION,
            "acceptable_tol": PRECISION,
            "mu_strategy": "monotone",
            "mu_init": 1e-6 if warm else 1e-3,
            "warm_start_init_point": "yes" if warm else "no",
            "warm_start_bound_push": 1e-6,
            "warm_start_mult_bound_push": 1e-6,
            "max_iter": max_iterations,
            "max_wall_time": max(time_limit, 1e-3),
        },
    }
    keep = [goals]
    if progress is not None:
        keep.append(_Watch(problem, progress))
        options["iteration_callback"] = keep[-1]
    nlp = {"x": z, "f": problem.objective(z * scale), "g": goals(z * scale)}
    return ca.nlpsol("planner", "ipopt", nlp, options), keep


_STATUS = {
    "Solve_Succeeded": PlanStatus.SOLVED,
    "Solved_To_Acceptable_Level": PlanStatus.SOLVED,
    "Maximum_WallTime_Exceeded": PlanStatus.TIME_LIMIT,
    "Maximum_CpuTime_Exceeded": PlanStatus.TIME_LIMIT,
    "Maximum_Iterations_Exceeded": PlanStatus.ITERATION_LIMIT,
}


def plan(task, identified, *, time_limit=30.0, max_iterations=60, guess=None, start=None, progress=None):
    """Plan a task.

    Parameters
    ----------
    task : Task
    identified : IdentifiedModel
        Reduced model of the arm, with its region of validity.
    time_limit : float, s
        Wall-clock limit of building and solving together.
    max_iterations : int
    guess : Plan, optional
        A solved plan of a similar task to start from; a plan that is not solved is ignored, because it would lead astray.
    start : dict of str to float, optional
        First guess of single unknowns, by name (see `PlanReport.numbers`), in place of the task's own numbers.
    progress : Progress, optional

    Returns
    -------
    Plan
        Always a plan; its status says whether it meets the goals.

    Raises
    ------
    OctoctrlError
        If a limit is not positive.
    """
    check_number("time_limit", time_limit, above=0.0, unit="s")
    check_number("max_iterations", max_iterations, at_least=1)
    begin = perf_counter()
    model = identified.model
    task = task.on(model.arm)
    reason = unreachable(task, identified.reach)
    if reason:
        return replace(_nothing(task, model, reason, perf_counter() - begin), plant=identified.plant)
    if progress is not None:
        progress.start("planning")
    problem = _problem(task, model)
    warm = guess is not None and guess.status is PlanStatus.SOLVED
    numbers = (guess.report.numbers if warm else {}) | (start or {})
    first = np.clip(
        [numbers.get(name, value) for name, value in zip(problem.names, problem.start, strict=True)], problem.lower, problem.upper
    )
    built = perf_counter() - begin
    solve, keep = solver(problem, time_limit=time_limit - built, max_iterations=max_iterations, warm=warm, progress=progress)
    low, high = problem.lower / problem.scale, problem.upper / problem.scale
    duals = {"lam_g0": guess.report.multipliers} if warm and len(guess.report.multipliers) == len(problem.band) else {}
    found = solve(x0=first / problem.scale, lbx=low, ubx=high, lbg=-problem.band, ubg=problem.band, **duals)
    stats = solve.stats()
    del keep
    if progress is not None:
        progress.stop()
    p = np.clip(np.asarray(found["x"]).ravel() * problem.scale, problem.lower, problem.upper)
    status = _STATUS.get(stats["return_status"], PlanStatus.INFEASIBLE)
    report = PlanReport(
        solver=stats["return_status"],
        multipliers=tuple(np.asarray(found["lam_g"]).ravel().tolist()),
        iterations=int(stats["iter_count"]),
        build_time=built,
        solve_time=perf_counter() - begin - built,
        wall_time=perf_counter() - begin,
    )
    return _finished(problem, identified, p, status, report)


def _problem(task, model):
    """The problem of a task; tasks that differ only in their goals share the functions, so that planning again is quick."""
    bare = replace(task, phases=tuple(replace(phase, goals=()) for phase in task.phases))
    return _bare_problem(bare, model).with_goals(task)


@lru_cache(maxsize=8)
def _bare_problem(task, model):
    return PhaseProblem(task, model)


def _finished(problem, identified, p, status, report):
    """The plan of the vector `p`: simulated once more with a fine step, and every goal checked on that."""
    task, model = problem.task, problem.model
    begins, schedule = problem.schedule(p)
    edges = [*begins.values(), schedule.duration]
    pieces = [np.linspace(a, b, max(2, int(np.ceil((b - a) / PREDICTION_STEP)) + 1))[1:] for a, b in pairwise(edges)]
    time = np.concatenate([[0.0], *pieces])
    levels = model.levels(schedule.activation(), time[1:])
    motion = model.simulate(levels, np.diff(time))
    trace = model.trace(motion.time, motion.strains, task.convention)
    recording = model.recording(motion.time, motion.strains)
    goals = tuple(
        GoalReport(phase=phase.name, goal=goal, miss=miss_in_phase(goal, time, goal.miss(recording, trace, model.arm), begin, end))
        for phase, (begin, end) in zip(task.phases, pairwise(edges), strict=True)
        for goal in phase.goals
    )
    report = replace(
        report,
        numbers=dict(zip(problem.names, p.tolist(), strict=True)),
        goals=goals,
        headroom=float(1 - levels.max()),
        extrapolates=identified.validity.outside(model.arm, motion.strains, levels),
    )
    worst = report.worst
    if status is PlanStatus.SOLVED and worst is not None and worst.share > 1:
        status = PlanStatus.INFEASIBLE
    if status is not PlanStatus.SOLVED and worst is not None:
        report = replace(report, reason=f"phase '{worst.phase}' misses {worst.goal} by {worst.miss:.3g} {worst.goal.unit}".rstrip())
    return Plan(
        task=task, model=model, schedule=schedule, phase_begins=begins, time=motion.time, strains=motion.strains,
        trace=trace, status=status, plant=identified.plant, report=report,
    )  # fmt: skip


def _nothing(task, model, reason, wall_time):
    """The plan that says why there is none."""
    begins, now = {}, 0.0
    for phase in task.phases:
        begins[phase.name] = now
        now += phase.duration
    primitives = tuple(drive.at(begins, {}) for drive in task.drives)
    time, zeros = np.array([0.0, now]), np.zeros(2)
    return Plan(
        task=task, model=model, schedule=Schedule(primitives=primitives, duration=now), phase_begins=begins, time=time,
        strains=np.stack([model.rest, model.rest]), trace=TopologyTrace.from_lifted(time=time, lifted_writhe=zeros, twist=zeros,
        convention=task.convention), status=PlanStatus.UNREACHABLE, report=PlanReport(reason=reason, wall_time=wall_time),
    )  # fmt: skip
