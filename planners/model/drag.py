"""Water drag of the reduced model through the Jacobian of the current shape, as CasADi expressions.

The arm is cut into fine elements of constant strain. Seen from the middle of its chord, in its middle frame, a strain rate of element i
turns and moves everything beyond it by a twist (angular velocity, velocity), linear in the rates; `Chain` holds these twists in the
laboratory frame about the base, together with the points and tangents of the elements' far ends, where drag is lumped.

The force of the water on a node does work on all elements before it; summed from the tip inwards, every element meets once the force and
the torque about the base of all that hangs on it.

References
----------
Featherstone (2008), *Rigid Body Dynamics Algorithms*, ch. 5: the same sums for inertia (recursive Newton-Euler).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.scene.scene import Water

from .drag_kernels import SLOWEST
from .kinematics import BASE_FRAME, section_bounds
from .outputs import exponential

Floats = NDArray[np.float64]

SLENDER = 3.5
"""Fine elements are half a section long; where that is more than so many radii, and bends are sharp, they are halved."""


class NodeDrag(NamedTuple):
    """Drag of the nodes, (M,) each, weights included: N s/m, N s^2/m^2, N m s (about d3; half of it about d1 and d2)."""

    linear: Floats
    quadratic: Floats
    rotational: Floats


class Chain(NamedTuple):
    """Shape of the fine elements; lists of M expressions."""

    turning: list[ca.SX]
    """(3, 3) each: angular velocity per rate of k1, k2, k3."""
    moving: list[ca.SX]
    """(3, 4) each: velocity of the point at the base per rate of k1, k2, k3, e."""
    points: list[ca.SX]
    tangents: list[ca.SX]


def element_edges(arm: Arm, sections: int) -> Floats:
    """Arclengths that bound the fine elements, (M + 1,), m; section centres and section bounds are among them."""
    bounds = section_bounds(arm, sections)
    halves = np.sort(np.concatenate([bounds, (bounds[1:] + bounds[:-1]) / 2]))
    middles = (halves[1:] + halves[:-1]) / 2
    slender = np.diff(halves) > SLENDER * arm.base_radius * arm.section(middles).outline
    return np.sort(np.concatenate([halves, middles[slender]]))


def node_drag(arm: Arm, water: Water, edges: Floats) -> NodeDrag:
    """Drag of the far ends of the elements between `edges`, by the trapezoidal rule."""
    section = arm.section(edges[1:])
    widths = np.diff(edges)
    weights = (widths + np.append(widths[1:], 0.0)) / 2 * water.factor
    (_, _, ring, oblique), (_, _, ring_inertia, oblique_inertia) = section.masses, section.polar_inertias
    linear = water.ring_rate * ring + water.oblique_rate * oblique
    width = section.muscle_count * 2 * section.muscle_radius
    quadratic = 0.5 * water.density * water.normal_coefficient * width
    rotational = water.ring_rate * ring_inertia + water.oblique_rate * oblique_inertia
    return NodeDrag(weights * linear, weights * quadratic, weights * rotational)


def chain(q: ca.SX, hats: Floats, edges: Floats) -> Chain:
    """Shape and twists of the elements between `edges` at the strains `q`, SX (4, S); `hats` are the hat functions' means in them."""
    frame, point = ca.SX(ca.DM(BASE_FRAME.T)), ca.SX.zeros(3)
    axis = ca.DM([0.0, 0.0, 1.0])
    shape = Chain([], [], [], [])
    for weights, step in zip(hats, np.diff(edges), strict=True):
        k1, k2, k3, e = (_combine(weights, [q[row, n] for n in range(len(weights))]) for row in range(4))
        k = ca.vertcat(k1, k2, k3)
        size = ca.sqrt(ca.sumsqr(k) + 1e-12)
        half = exponential(0.5 * step * k, 0.5 * step * size)
        middle = frame @ half
        ratio = ca.sin(0.5 * step * size) / (0.5 * step * size)
        unit = k / size
        mean = ratio * ca.SX.eye(3) + (1 - ratio) * unit @ unit.T  # mean rotation of the element, seen from its middle
        chord = step * middle @ mean[:, 2]
        # Second-order motion of the far end about the chord's middle, from the sagitta of the element's arc.
        sagitta = k @ axis.T / 6 - k3 / 12 * ca.SX.eye(3) - axis @ k.T / 12
        centre = point + 0.5 * e * chord
        turning = step * middle @ mean
        velocity = e * step**3 * middle @ sagitta + ca.skew(centre) @ turning
        frame, point = middle @ half, point + e * chord
        shape.turning.append(turning)
        shape.moving.append(ca.horzcat(velocity, chord))
        shape.points.append(point)
        shape.tangents.append(frame[:, 2])
    return shape


def node_motion(shape: Chain, hats: Floats, rates: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """Velocities (3,) and angular velocities (3,) of the nodes at the strain rates `rates`, SX (4, S)."""
    spin, moving = ca.SX.zeros(3), ca.SX.zeros(3)
    motions = []
    for index, weights in enumerate(hats):
        rate = _combine(weights, [rates[:, n] for n in range(len(weights))])
        spin += shape.turning[index] @ rate[:3]
        moving += shape.moving[index] @ rate
        motions.append((moving + ca.cross(spin, shape.points[index]), spin))
    return motions


def normal_coefficient(drag: NodeDrag, index: int, velocity: ca.SX, tangent: ca.SX, factors: Any) -> tuple[Any, Any]:
    """Linear coefficient, and that of the quadratic drag across the tangent, of a node that moves with `velocity`."""
    across = velocity - ca.dot(velocity, tangent) * tangent
    speed = ca.sqrt(ca.sumsqr(across) + SLOWEST**2)
    return factors["linear_drag"] * drag.linear[index], factors["quadratic_drag"] * drag.quadratic[index] * speed


def drag_force(shape: Chain, hats: Floats, drag: NodeDrag, rates: Any, moved: Any, factors: Any) -> ca.SX:
    """Generalised drag (4, S) of a motion.

    Parameters
    ----------
    shape : Chain
    hats : (M, S) float64
    drag : NodeDrag
    rates : (4, S) SX, 1/s
        They set the size of the quadratic drag.
    moved : (4, S) SX
        What the drag acts against: the rates themselves, or the motion of a step.
    factors : dict of str to SX
        Identified factors by name.
    """
    sections = hats.shape[1]
    velocities = [motion[0] for motion in node_motion(shape, hats, rates)]
    motions = node_motion(shape, hats, moved)
    torque, force = ca.SX.zeros(3), ca.SX.zeros(3)
    result = [ca.SX.zeros(4) for _ in range(sections)]
    for index in reversed(range(len(hats))):
        tangent, (velocity, spin) = shape.tangents[index], motions[index]
        linear, normal = normal_coefficient(drag, index, velocities[index], tangent, factors)
        pull = (linear + normal) * velocity - normal * ca.dot(velocity, tangent) * tangent
        rotational = 0.5 * factors["rotational_drag"] * drag.rotational[index]
        torque += rotational * (spin + ca.dot(spin, tangent) * tangent) + ca.cross(shape.points[index], pull)
        force += pull
        along = shape.moving[index].T @ force + ca.vertcat(shape.turning[index].T @ torque, 0)
        for n in np.flatnonzero(hats[index]):
            result[n] += hats[index, n] * along
    return ca.horzcat(*result)


def _combine(weights: Floats, values: Sequence[Any]) -> Any:
    """Weighted sum over the sections whose hats act here."""
    return sum(float(weights[n]) * values[int(n)] for n in np.flatnonzero(weights))
