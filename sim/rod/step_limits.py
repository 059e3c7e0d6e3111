"""The largest stable step, measured on the compiled step itself, and the choice of a step below it.

A step of position Verlet (drift, kick, drift) with a linear kick v <- D v - h S K x is stable as long as, for every mode,

    h^2 mu < 2 (1 + d),     mu: eigenvalue of S K,   d: what damping leaves of the mode's velocity in one step

(Hairer, Lubich & Wanner 2003, Acta Numerica 12:399, for D = 1). K holds the stiffness of everything that acts in the present state,
elastic, passive and active; S is the inverse of the mass with all that the implicit treatment of viscosity adds to it. None of them is
formed: displacing a state by a small u and comparing one step with that of the state itself gives -h S K u, and power iteration on that
finds the largest eigenvalue and its mode, which names the mechanism. S depends on h, so h is tried anew until it is its own limit.
"""

from collections.abc import Callable

import numpy as np

from ..contracts import Floats
from ..rotations import rotation_matrix
from ..running.clock import StepLimit
from .layout import STATE_ROWS, Row

STRETCH, SHEAR, TWIST = "stretch wave", "shear and bending of the section", "twist wave"

FIRST_STEP = 1e-5
SMALL = 1e-7
"""Displacement in element lengths, or radians, that stands for an infinitesimal one."""
STIRRING = 1e-3
"""Rates (1/s, rad/s) given to a state, so that no muscle stands at the kink of Hill's law between shortening and lengthening."""


def predict_limit(
    rows: Floats, n: int, masses: Floats, prepare: Callable[[float], object], advance: Callable[[float], object], *, tolerance: float = 2e-3
) -> StepLimit:
    """Predict the largest stable step of a rod in its present state.

    Parameters
    ----------
    rows : (rows, stride) float64
        Of `octoctrl.sim.rod.layout`; the state is put back afterwards, and whatever `prepare` sets is left as for the last step tried.
    n : int
        Elements.
    masses : (n + 1,) float64, kg
        Of the nodes.
    prepare : callable
        ``prepare(h)`` sets all that depends on the step.
    advance : callable
        ``advance(h)`` takes one step in place.
    tolerance : float
        Relative, of the result.

    Returns
    -------
    StepLimit
    """
    good = rows[:STATE_ROWS].copy()
    random = np.random.default_rng(0)
    try:
        response = _Response(rows, n, masses, prepare, advance, random)
        mode, h = response.normalised(random.normal(size=(6, n + 1)) / np.sqrt(response.inertia)), FIRST_STEP
        for _ in range(10):
            response.at(h)
            mode, eigenvalue = _stiffest(response, mode, tolerance)
            kept = np.clip(response.inner(mode, response(-0.5 * h * mode, mode)), 0.0, 1.0)
            found = h * np.sqrt(2 * (1 + kept) / eigenvalue)
            h, change = found, abs(found / h - 1)
            if change < tolerance:
                break
        mechanism, element = response.name(mode)
    finally:
        rows[:STATE_ROWS] = good
    return StepLimit(step=float(h), mechanism=mechanism, element=element)


def _stiffest(response: "_Response", mode: Floats, tolerance: float) -> tuple[Floats, float]:
    """Power iteration: the mode that pulls back hardest, and its eigenvalue h^2 mu."""
    before = shift = 0.0
    for _ in range(200):
        pulled = shift * mode - response.h * response(mode, np.zeros_like(mode))
        eigenvalue = response.inner(mode, pulled) - shift
        mode = response.normalised(pulled)
        if abs(eigenvalue - before) < 0.1 * tolerance * abs(eigenvalue):
            if eigenvalue > 0:
                break
            # A mode that is about to buckle outweighs the stiff ones; shifted by its own value, the spectrum is positive.
            shift = -eigenvalue
        before = eigenvalue
    return mode, max(eigenvalue, 1e-300)


class _Response:
    """How one step of a rod answers small changes (6, n + 1) of positions and directors, and of velocities and spins."""

    def __init__(
        self,
        rows: Floats,
        n: int,
        masses: Floats,
        prepare: Callable[[float], object],
        advance: Callable[[float], object],
        random: np.random.Generator,
    ) -> None:
        self.rows, self.n, self.prepare, self.advance = rows, n, prepare, advance
        self.inertia = np.ones((6, n + 1))
        self.inertia[:3] = masses
        self.inertia[3:, :n] = rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1 : n + 1]
        self.length = rows[Row.LENGTH, 1 : n + 1].copy()
        self.nodes, self.elements = slice(1, n + 2), slice(1, n + 1)
        free = rows[Row.NODE_MOBILITY, self.nodes] > 0
        rows[Row.V1 : Row.V3 + 1, self.nodes] += STIRRING * self.length.min() * free * random.normal(size=(3, n + 1))
        rows[Row.W1 : Row.W3 + 1, self.elements] += STIRRING * random.normal(size=(3, n))
        self.state = rows[:STATE_ROWS].copy()
        self.frames = self.state[Row.Q11 : Row.Q33 + 1, self.elements].T.reshape(n, 3, 3)

    def at(self, h: float) -> None:
        """Take up the step h."""
        self.h = h
        self.prepare(h)
        self.rows[:STATE_ROWS] = self.state
        self.advance(h)
        self.speeds = self._speeds()

    def _speeds(self) -> Floats:
        found = np.zeros((6, self.n + 1))
        found[:3] = self.rows[Row.V1 : Row.V3 + 1, self.nodes]
        found[3:, : self.n] = self.rows[Row.W1 : Row.W3 + 1, self.elements]
        return found

    def __call__(self, place: Floats, speed: Floats) -> Floats:
        """Change of velocities and spins after one step, per size of the changes of place and speed before it."""
        largest = max(np.abs(change[:3]).max() / self.length.min() + np.abs(change[3:]).max() for change in (place, speed * self.h))
        size = SMALL / largest
        rows = self.rows
        rows[:STATE_ROWS] = self.state
        rows[Row.X1 : Row.X3 + 1, self.nodes] += size * place[:3]
        turned = rotation_matrix(size * place[3:, : self.n].T) @ self.frames
        rows[Row.Q11 : Row.Q33 + 1, self.elements] = turned.reshape(self.n, 9).T
        rows[Row.V1 : Row.V3 + 1, self.nodes] += size * speed[:3]
        rows[Row.W1 : Row.W3 + 1, self.elements] += size * speed[3:, : self.n]
        self.advance(self.h)
        return (self._speeds() - self.speeds) / size

    def inner(self, one: Floats, other: Floats) -> float:
        """Inner product weighted by mass and inertia."""
        return float(np.sum(self.inertia * one * other))

    def normalised(self, mode: Floats) -> Floats:
        """The mode with unit norm."""
        return mode / np.sqrt(self.inner(mode, mode))

    def name(self, mode: Floats) -> tuple[str, int]:
        """Mechanism of a mode, by what carries most of its kinetic energy, and the element where that is largest."""
        edges = np.diff(self.state[Row.X1 : Row.X3 + 1, self.nodes], axis=1)
        tangents = edges / np.linalg.norm(edges, axis=0)
        along = np.concatenate([tangents[:, :1], tangents[:, 1:] + tangents[:, :-1], tangents[:, -1:]], axis=1)
        along /= np.linalg.norm(along, axis=0)
        energy = self.inertia * mode**2
        stretch = self.inertia[0] * np.sum(mode[:3] * along, axis=0) ** 2
        shares = {STRETCH: stretch, SHEAR: energy[:5].sum(axis=0) - stretch, TWIST: energy[5]}
        mechanism = max(shares, key=lambda name: shares[name].sum())
        return mechanism, int(np.argmax(shares[mechanism]).clip(0, self.n - 1))
