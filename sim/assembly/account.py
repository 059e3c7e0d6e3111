"""Energies of the full arm by part, and the power of its muscles and of the water, at one instant, in plain NumPy.

Places, velocities, frames and spins are read from the buffer, and parameters; nothing else of it, and nothing is changed.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..body.muscles import MuscleLaw
from ..contracts import Floats
from ..rotations import rotation_vector
from .constants import fibre_laws, oblique_mass, ring_smoothing, straight_mass
from .energies import connections_of
from .layout import AssemblyRow as R

if TYPE_CHECKING:
    from .core import AssemblyCore

CONNECTIONS = ("sides", "ring_connections", "contacts", "crossings", "pressure")
"""Energies of `octoctrl.sim.assembly.energies.Connections`."""


class Family(NamedTuple):
    """A family of rods at one instant: m rods, n elements, p nodes of each.

    `laws` one for all or the first rod's and the others'; `area` and `rest` (m, n) of the elements, m^2 and m; `mass` (m, p), kg, `apart`
    and `faster` (m, n, 3), what the nodes of an element are apart and the same of their velocities; `velocity` (m, p, 3), m/s, `frames`
    (m, n, 3, 3), `spin` (m, n, 3), rad/s; `closed` rings; `strength` and `pace` (m, n) or one, factors on the stress in tension and on the
    rate of graded rings.
    """

    view: Any
    laws: tuple[MuscleLaw, ...]
    area: Floats
    rest: Floats
    mass: Floats
    apart: Floats
    faster: Floats
    velocity: Floats
    frames: Floats
    spin: Floats
    closed: bool
    strength: Floats | float
    pace: Floats | float

    @property
    def stretch(self) -> Floats:
        """Length over rest length (m, n)."""
        found: Floats = np.linalg.norm(self.apart, axis=-1) / self.rest
        return found

    @property
    def rate(self) -> Floats:
        """Change of the stretch (m, n), 1/s."""
        found: Floats = np.sum(self.apart * self.faster, axis=-1) / (self.stretch * self.rest**2)
        return found

    @property
    def inertia(self) -> Floats:
        """Rotary inertia (m, n, 3) of the elements, which falls with the stretch."""
        rows = (R.BEND_INERTIA, R.BEND_INERTIA, R.TWIST_INERTIA)
        return np.stack([self.view(row) for row in rows], axis=-1) / self.stretch[..., None]

    def by_law(self, name: str, *values: Floats) -> Floats:
        """A method of the laws, of rows (m, n), each rod by its own law."""
        rods = [getattr(self.laws[min(rod, len(self.laws) - 1)], name)(*(row[rod] for row in values)) for rod in range(len(values[0]))]
        return np.stack(rods)

    def by_rod(self, name: str) -> Floats:
        """A number of the laws (m, 1)."""
        return np.array([getattr(self.laws[min(rod, len(self.laws) - 1)], name) for rod in range(len(self.rest))])[:, None]

    @property
    def elastic(self) -> tuple[float, float, float]:
        """Energies of passive stretch, shear, and bending with twist, J."""
        graded = np.where(self.stretch > 1, self.strength, 1.0)
        stretched = np.sum(self.area * self.rest * graded * self.by_law("passive_energy", self.stretch))
        along = np.einsum("mnij,mnj->mni", self.frames, self.apart) / self.rest[..., None]
        sheared = 0.5 * np.sum(self.view(R.SHEAR) * self.rest * (along[..., 0] ** 2 + along[..., 1] ** 2))
        before = np.roll(self.frames, 1, axis=1)
        inside = slice(None) if self.closed else slice(1, None)
        joint, length = self.view(R.JOINT_LENGTH)[:, inside], self.stretch * self.rest
        soften = (joint / (0.5 * (length + np.roll(length, 1, axis=1))[:, inside])) ** 3
        curvature = rotation_vector((self.frames @ np.swapaxes(before, -1, -2))[:, inside]) / joint[..., None]
        bent = 0.0
        for component, row in enumerate((R.BEND, R.BEND, R.TWIST)):
            rest = self.view(R(R.REST1 + component))[:, inside]
            bent += 0.5 * np.sum(joint * soften * self.view(row)[:, inside] * (curvature[..., component] - rest) ** 2)
        return float(stretched), float(sheared), float(bent)

    def muscles(self, levels: Floats) -> float:
        """Power of the active fibres at `levels` (m, n), W."""
        e, rate = self.stretch, self.rate
        slowed = self.by_law("velocity_factor", -self.pace * rate / self.by_rod("maximum_rate"))
        stress = self.strength * levels * self.by_rod("maximum_stress") * self.by_law("active_factor", e) * slowed
        return -float(np.sum(self.area * stress / e * rate * self.rest))

    def friction(self, viscosity: float) -> float:
        """Power of passive tissue of a `viscosity` (Pa s), W."""
        return -float(np.sum(self.area * viscosity / self.stretch * self.rate**2 * self.rest))

    def linear_drag(self, h: float) -> float:
        """Power of the linear drag of nodes and spins, W, whose decay over the step `h` (s) is in the buffer; what is held has none."""
        nodes = self.view(R.NODE_DECAY) if self.closed else self.view(R.NODE_DECAY, nodes=True)
        power = -np.sum(self.mass * _rate(nodes, h) * np.sum(self.velocity**2, axis=-1))
        turning = np.stack([_rate(self.view(row), h) for row in (R.BEND_DECAY, R.BEND_DECAY, R.TWIST_DECAY)], axis=-1)
        return float(power - np.sum(self.inertia * turning * self.spin**2))


def _rate(decay: Floats, h: float) -> Floats:
    return -np.log(np.where(decay > 0, decay, 1.0)) / h


def _vectors(view: Any, first: R, **nodes: bool) -> Floats:
    return np.stack([view(R(first + i), **nodes) for i in range(3)], axis=-1)


def families(core: "AssemblyCore", h: float) -> tuple[Family, Family, Family]:
    """Cord and muscles, helices, and rings now, for the step `h` (s), which decides how much their tips weigh."""
    muscle, oblique, ring, cord = fibre_laws(core.arm)
    geometry, rods, found = core.geometry, core.rods, []
    grades = (rods.ring(R.STRENGTH), rods.ring(R.PACE)) if core.arm.anatomy.traits.graded else (1.0, 1.0)
    for view, shape, laws, mass, closed in (
        (rods.straight, geometry.straight, (cord, muscle), straight_mass(core.arm, geometry, h), False),
        (rods.oblique, geometry.oblique, (oblique,), oblique_mass(core.arm, geometry, h), False),
        (rods.ring, geometry.rings, (ring,), geometry.rings.node_mass, True),
    ):
        nodes = {} if closed else {"nodes": True}
        velocity, points = (_vectors(view, row, **nodes) for row in (R.V1, R.X1))
        apart, faster = (np.roll(values, -1, axis=1) - values if closed else np.diff(values, axis=1) for values in (points, velocity))
        spin = _vectors(view, R.W1)
        frames = np.stack([view(R(R.Q11 + i)) for i in range(9)], axis=-1).reshape(*spin.shape[:2], 3, 3)
        found.append(
            Family(
                view,
                laws,
                shape.area,
                shape.length,
                mass,
                apart,
                faster,
                velocity,
                frames,
                spin,
                closed,
                *(grades if closed else (1.0, 1.0)),
            )
        )
    return found[0], found[1], found[2]


def energies(core: "AssemblyCore", h: float) -> dict[str, float]:
    """Energies by part, J.

    Kinetic with the selective mass of the rings; passive stretch, shear, and bending with twist of all rods; each kind of connection; the
    slabs' pressure.
    """
    kinetic, parts, rods = 0.0, np.zeros(3), families(core, h)
    for family in rods:
        kinetic += 0.5 * np.sum(family.mass[..., None] * family.velocity**2) + 0.5 * np.sum(family.inertia * family.spin**2)
        parts += family.elastic
    rings = rods[2]
    kinetic += 0.5 * np.sum(ring_smoothing(core.arm, core.geometry, h)[:, None, None] * rings.mass[..., None] * rings.faster**2)
    found = {"kinetic": float(kinetic), **dict(zip(("passive_stretch", "shear", "bending_twist"), parts.tolist(), strict=True))}
    connections = connections_of(core.arm, core.geometry, core.rods)
    return found | {name: float(getattr(connections, name)().real) for name in CONNECTIONS}


def powers(core: "AssemblyCore", h: float, levels: tuple[Floats, Floats, Floats]) -> dict[str, float]:
    """Power of the muscles at `levels` of cord and muscles (rods, N), the hands (2, elements), right first, and rings (N,), of the water,
    and of the viscosity of passive tissue, W.
    """
    straight, helices, rings = rods = families(core, h)
    half = len(helices.rest) // 2
    oblique: NDArray[np.float64] = np.concatenate([np.repeat(levels[1][1:], half, axis=0), np.repeat(levels[1][:1], half, axis=0)])
    given = (levels[0], oblique, np.repeat(levels[2][:, None], rings.rest.shape[1], axis=1))
    muscles = sum(family.muscles(level) for family, level in zip(rods, given, strict=True))
    water = sum(family.linear_drag(h) for family in rods)
    rubbed = sum(family.friction(core.arm.anatomy.viscosity) for family in rods)
    return {"muscles": muscles, "water": water + _quadratic_drag(core, straight), "viscosity": rubbed}


def _quadratic_drag(core: "AssemblyCore", straight: Family) -> float:
    """Power of the quadratic drag across and along the elements of the muscles, W; the cord is dry."""
    e = straight.stretch
    tangent = straight.apart / (e * straight.rest)[..., None]
    velocity = (straight.velocity[:, 1:] + straight.velocity[:, :-1]) / 2
    along = np.sum(velocity * tangent, axis=-1)
    across = np.linalg.norm(velocity - along[..., None] * tangent, axis=-1)
    size = core.geometry.straight.radius / np.sqrt(e) * e * straight.rest
    normal, tangential = core.drag
    return -float(np.sum((size * (normal * across**3 + np.pi * tangential * np.abs(along) ** 3))[1:]))
