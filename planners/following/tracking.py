"""Feedback along a plan: time-varying LQR with online estimates of what the model has wrong.

Around the planned motion q_k, u_k the reduced model reads, with x = q - q_k and v = u - u_k (one level per muscle group in use),

    x_{k+1} = A_k x_k + B_k v_k + E_k theta,      E_k = [B_k diag(u_k), dq_{k+1}/d(drag)]

theta: relative errors of the groups' gains and of the water's drag, a slow random walk that a Kalman filter estimates from the prediction
errors of the measured shape. The regulator minimises sum (y' Q y + x' S x + v' R v) of the topology error y = C_k x and prices in advance
(affine Riccati recursion) its estimate of theta and the part of the measured topology error that the linear model does not explain, which
makes it free of offset. Terminal cost: the infinite-horizon regulator of the final pose, from python-control.
"""

from dataclasses import dataclass

import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS

TOPOLOGY_ERROR = 0.01
"""Error of lifted writhe or twist (turns) that costs as much as a correction of `CORRECTION`."""

CORRECTION, REST_SHARE = 0.1, 0.05
"""Change of a level, at the group's highest planned level, that costs as much as an error of `TOPOLOGY_ERROR`; and the share of it that a
group at rest has. A resting muscle can only pull, so that what should correct both ways would curl the arm."""

LEAST_LEVEL = 1e-3
"""Highest planned level of a group that hardly takes part; keeps its corrections finite."""

SHAPE_ERROR = 0.1
"""Error of all strains, as bending strain or stretch, that costs as much."""

SHAPE_NOISE, MOTION_NOISE = 0.01, 1.0
"""Prediction error of one period that is put down to chance: as bending strain or stretch, and as a share of the planned change, which
the model without inertia foresees a little early."""

GAIN_DOUBT, DRAG_DOUBT, DRIFT = 0.2, 0.7, 0.05
"""Standard deviations of gain errors and drag error beforehand, and the share of them by which they may change per period."""

BIAS_SHARE = 0.3
"""Share of a newly measured, unexplained topology error that is believed."""

KINSHIP = 0.95
"""Correlation of the gain errors of muscles of one kind, which one motion can hardly tell apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingDesign:
    """Everything that is computed before a plan is executed; N periods, m groups in use.

    Attributes
    ----------
    period : float, s
    groups : tuple of str
        Muscle groups that feedback may change.
    strains : (N + 1, S, 4) float64
        Planned shape.
    levels : (N, m) float64
        Planned levels, the largest of any section.
    topology : (N + 1, 2) float64
        Planned twist and lifted writhe, turns.
    slopes : (N + 1, 2, 4 S) float64
        C, their derivatives.
    transition, influence, disturbance : (N, 4 S, 4 S), (N, 4 S, m), (N, 4 S, m + 1) float64
        A, B, E.
    cost : (N + 1, 4 S, 4 S) float64
        Riccati matrices.
    gains : (N, m, 4 S) float64
        Of v = -K x.
    inverse : (N, m, m) float64
        (R + B' P B)^-1.
    noise : (N, 4 S) float64
        Standard deviation of the prediction error of each strain in each period.
    closed_loop_radius : float
        Spectral radius of the regulated final pose.
    """

    period: float
    groups: tuple[str, ...]
    strains: np.ndarray
    levels: np.ndarray
    topology: np.ndarray
    slopes: np.ndarray
    transition: np.ndarray
    influence: np.ndarray
    disturbance: np.ndarray
    cost: np.ndarray
    gains: np.ndarray
    inverse: np.ndarray
    noise: np.ndarray
    closed_loop_radius: float


def design(plan, model, period=0.05):
    """Design the feedback of a plan.

    Parameters
    ----------
    plan : Plan
    model : ReducedModel
    period : float, s
        Between corrections.

    Returns
    -------
    TrackingDesign
    """
    from control import dlqr

    count = int(np.ceil(plan.schedule.duration / period - 1e-9))
    activation = plan.schedule.activation()
    steps = np.full(count, period)
    levels = model.levels(activation, period * np.arange(1, count + 1))
    motion = model.simulate(levels, steps)
    groups = activation.groups
    columns = [MUSCLE_GROUPS.index(group) for group in groups]
    transition, influence, drag = model.linearise(motion, levels, steps)
    influence = influence[:, :, columns].sum(axis=3)
    planned = levels[:, columns].max(axis=2)
    disturbance = np.concatenate([influence * planned[:, None, :], drag[:, :, None]], axis=2)

    scale = _strain_scale(model)
    change = np.diff(motion.strains, axis=0).reshape(count, -1)
    values, slopes = model.outputs(motion.strains, plan.task.convention.pole)
    values, slopes = values[:, :2], slopes[:, :2].reshape(count + 1, 2, -1)
    price = np.swapaxes(slopes, 1, 2) @ slopes / TOPOLOGY_ERROR**2 + np.diag(1 / (SHAPE_ERROR * scale) ** 2)
    effort = 1 / (CORRECTION * (REST_SHARE + planned / np.maximum(planned.max(axis=0), LEAST_LEVEL))) ** 2
    terminal_gain, cost_to_go, _ = dlqr(transition[-1], influence[-1], price[-1], np.diag(effort[-1]))
    radius = np.abs(np.linalg.eigvals(transition[-1] - influence[-1] @ terminal_gain)).max()
    cost, gains, inverse = np.empty((count + 1, *cost_to_go.shape)), np.empty((count, len(groups), len(scale))), []
    cost[-1] = cost_to_go
    for k in range(count - 1, -1, -1):
        a, b = transition[k], influence[k]
        solved = np.linalg.inv(np.diag(effort[k]) + b.T @ cost[k + 1] @ b)
        gains[k] = solved @ b.T @ cost[k + 1] @ a
        update = price[k] + a.T @ cost[k + 1] @ (a - b @ gains[k])
        cost[k] = (update + update.T) / 2
        inverse.append(solved)
    return TrackingDesign(
        period=period, groups=groups, strains=motion.strains, levels=planned, topology=values, slopes=slopes, transition=transition,
        influence=influence, disturbance=disturbance, cost=cost, gains=gains, inverse=np.array(inverse[::-1]),
        noise=np.hypot(SHAPE_NOISE * scale, MOTION_NOISE * change), closed_loop_radius=float(radius),
    )  # fmt: skip


def _strain_scale(model):
    """Strains (4 S) that a fibre at the longitudinal muscles' distance feels as one."""
    offset = model.arm.section((model.edges[1:] + model.edges[:-1]) / 2).muscle_offset
    scale = np.ones((model.sections, 4))
    scale[:, :3] = 1 / offset[:, None]
    return scale.ravel()


class Tracker:
    """The regulator at work: takes measured strains, gives corrections of the levels.

    Parameters
    ----------
    design : TrackingDesign
    adapt : bool
        Whether gain and drag errors are estimated; without it this is the plain TVLQR.
    """

    def __init__(self, design, adapt=True):
        self.design, self.adapt = design, adapt
        kinds = np.array([group.strip("0123456789") for group in design.groups])
        kin = np.where(kinds[:, None] == kinds, KINSHIP, 0.0)
        np.fill_diagonal(kin, 1.0)
        self.errors = np.zeros(len(kinds) + 1)
        self.covariance = np.diag([0.0] * len(kinds) + [DRAG_DOUBT**2])
        self.covariance[:-1, :-1] = GAIN_DOUBT**2 * kin
        self.drift = DRIFT**2 * self.covariance
        self.bias = np.zeros(2)
        self._before = None

    def correct(self, index, strains, topology):
        """Corrections of the levels for one period.

        Parameters
        ----------
        index : int
            Of the period on the plan's clock.
        strains : (S, 4) float64
            Measured at its begin.
        topology : (2,) array_like, turns
            Twist and lifted writhe measured then; writhe modulo 2, since self-crossings are counted apart.

        Returns
        -------
        (m,) float64
        """
        plan = self.design
        index = min(index, len(plan.gains) - 1)
        x = np.asarray(strains).ravel() - plan.strains[index].ravel()
        if self.adapt:
            self._learn(x)
            unexplained = np.asarray(topology) - plan.topology[index] - plan.slopes[index] @ x
            unexplained[1] -= 2 * np.round(unexplained[1] / 2)
            self.bias += BIAS_SHARE * (unexplained - self.bias)
        correction = -plan.gains[index] @ x - self._preview(index)
        level = plan.levels[index]
        # A level cannot leave [0, 1]; what the plant will really get is what the next prediction must assume.
        correction = np.clip(level + correction, 0.0, 1.0) - level
        self._before = (index, x, correction)
        return correction

    def _learn(self, x):
        """Kalman filter on the errors, from the prediction of the period that has just passed."""
        if self._before is None:
            return
        index, before, correction = self._before
        plan = self.design
        effect = plan.disturbance[index].copy()
        # A wrong gain acts on the whole level, correction included.
        effect[:, :-1] += plan.influence[index] * correction
        surprise = x - plan.transition[index] @ before - plan.influence[index] @ correction
        scaled, innovation = effect / plan.noise[index, :, None], surprise / plan.noise[index]
        self.covariance = self.covariance + self.drift
        information = np.linalg.inv(self.covariance) + scaled.T @ scaled
        self.covariance = np.linalg.inv(information)
        self.errors += self.covariance @ scaled.T @ (innovation - scaled @ self.errors)

    def _preview(self, index):
        """What the estimated errors, present and to come, ask for now."""
        plan = self.design
        push = np.einsum("kij,j->ki", plan.disturbance[index:], self.errors)
        pull = np.einsum("kji,j->ki", plan.slopes[index + 1 :], self.bias / TOPOLOGY_ERROR**2)
        future = pull[-1]
        for k in range(len(push) - 1, 0, -1):
            a = plan.transition[index + k] - plan.influence[index + k] @ plan.gains[index + k]
            future = a.T @ (plan.cost[index + k + 1] @ push[k] + future) + pull[k - 1]
        return plan.inverse[index] @ plan.influence[index].T @ (plan.cost[index + 1] @ push[0] + future)
