"""Water drag of the reduced model: J' M J with the Jacobian of the current shape.

The arm is cut into fine elements of constant strain. Seen from the middle of its chord, in its middle frame, a strain rate of element i
turns and moves everything beyond it by a twist (angular velocity, velocity), linear in the rates; `Chain` holds these twists in the
laboratory frame about the base, together with the points and tangents of the elements' far ends, where drag is lumped.

With M_j the 6 x 6 drag of node j and I_j = sum of M_l over l >= j (the drag of all that hangs on element j), the generalised drag is

    D = sum over j of (J_j-1 + S_j H_j / 2)' I_j S_j H_j + transpose,      J_j = sum of S_i H_i over i <= j

with S_i the twists of element i and H_i the hat functions there: each pair of elements is counted once, with the drag of what hangs on
the outer one. Sections that lie apart need one product each, because J does not change any more beyond a hat's end.

References
----------
Featherstone (2008), *Rigid Body Dynamics Algorithms*, ch. 6: the same sums for inertia (composite rigid bodies).
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from .kinematics import BASE_FRAME, section_bounds
from .outputs import exponential

SLOWEST = 1e-3
"""Speed, m/s, below which quadratic drag goes over into linear drag (so that it has a slope at rest)."""

SLENDER = 3.5
"""Fine elements are half a section long; where that is more than so many radii, and bends are sharp, they are halved."""


class NodeDrag(NamedTuple):
    """Drag of the nodes, (M,) each, weights included: N s/m, N s^2/m^2, N m s (about d3; half of it about d1 and d2)."""

    linear: np.ndarray
    quadratic: np.ndarray
    rotational: np.ndarray


class Chain(NamedTuple):
    """Shape of the fine elements; lists of M expressions."""

    turning: list
    """(3, 3) each: angular velocity per rate of k1, k2, k3."""
    moving: list
    """(3, 4) each: velocity of the point at the base per rate of k1, k2, k3, e."""
    points: list
    tangents: list


def element_edges(arm, sections):
    """Arclengths that bound the fine elements, (M + 1,), m; section centres and section bounds are among them."""
    bounds = section_bounds(arm, sections)
    halves = np.sort(np.concatenate([bounds, (bounds[1:] + bounds[:-1]) / 2]))
    middles = (halves[1:] + halves[:-1]) / 2
    slender = np.diff(halves) > SLENDER * arm.base_radius * arm.section(middles).outline
    return np.sort(np.concatenate([halves, middles[slender]]))


def node_drag(arm, water, edges):
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


def chain(q, hats, edges):
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


def node_motion(shape, hats, rates):
    """Velocities (3,) and angular velocities (3,) of the nodes at the strain rates `rates`, SX (4, S)."""
    spin, moving = ca.SX.zeros(3), ca.SX.zeros(3)
    motions = []
    for index, weights in enumerate(hats):
        rate = _combine(weights, [rates[:, n] for n in range(len(weights))])
        spin += shape.turning[index] @ rate[:3]
        moving += shape.moving[index] @ rate
        motions.append((moving + ca.cross(spin, shape.points[index]), spin))
    return motions


def normal_coefficient(drag, index, velocity, tangent, factors):
    """Linear coefficient, and that of the quadratic drag across the tangent, of a node that moves with `velocity`."""
    across = velocity - ca.dot(velocity, tangent) * tangent
    speed = ca.sqrt(ca.sumsqr(across) + SLOWEST**2)
    return factors["linear_drag"] * drag.linear[index], factors["quadratic_drag"] * drag.quadratic[index] * speed


def drag_matrix(shape, hats, drag, rates, factors):
    """Generalised drag (4 S, 4 S), section by section, at the strain rates `rates`.

    Parameters
    ----------
    shape : Chain
    hats : (M, S) float64
    drag : NodeDrag
    rates : (4, S) SX, 1/s
        They set the size of the quadratic drag.
    factors : dict of str to SX
        Identified factors by name.
    """
    sections = hats.shape[1]
    velocities = [motion[0] for motion in node_motion(shape, hats, rates)]
    spin_block, cross_block, force_block = ca.SX.zeros(3, 3), ca.SX.zeros(3, 3), ca.SX.zeros(3, 3)
    hanging = [None] * len(hats)
    for index in reversed(range(len(hats))):
        tangent, point = shape.tangents[index], ca.skew(shape.points[index])
        linear, normal = normal_coefficient(drag, index, velocities[index], tangent, factors)
        along = tangent @ tangent.T
        force = (linear + normal) * ca.SX.eye(3) - normal * along
        shifted = point @ force
        rotational = 0.5 * factors["rotational_drag"] * drag.rotational[index]
        spin_block += rotational * (ca.SX.eye(3) + along) - shifted @ point
        cross_block += shifted
        force_block += force
        hanging[index] = spin_block, cross_block, force_block
    blocks = {(n, m): ca.SX.zeros(4, 4) for m in range(sections) for n in range(m + 1)}
    jacobians = [None] * sections  # (turning, moving) of each section so far
    pending = {}  # sum of hat-weighted wrenches of a section over the elements of one interval, for the sections that are complete
    for index, weights in enumerate(hats):
        active = np.flatnonzero(weights)
        turning, moving = shape.turning[index], shape.moving[index]
        spin_block, cross_block, force_block = hanging[index]
        torque = ca.horzcat(spin_block @ turning, ca.SX(3, 1)) + cross_block @ moving
        force = ca.horzcat(cross_block.T @ turning, ca.SX(3, 1)) + force_block @ moving
        products = {}
        for n in active:
            grown = (weights[n] * turning, weights[n] * moving)
            before = jacobians[n]
            half = tuple(0.5 * part for part in grown) if before is None else tuple(b + 0.5 * g for b, g in zip(before, grown, strict=True))
            products[n] = _power(half, torque, force)
            jacobians[n] = grown if before is None else tuple(b + g for b, g in zip(before, grown, strict=True))
            key = (int(active[0]), int(n))
            add = (weights[n] * torque, weights[n] * force)
            pending[key] = add if key not in pending else tuple(p + a for p, a in zip(pending[key], add, strict=True))
        for m in active:
            for n in active:
                if n < m:
                    blocks[n, m] += weights[m] * products[n] + weights[n] * products[m].T
                elif n == m:
                    blocks[m, m] += weights[m] * (products[m] + products[m].T)
    for (first, m), (torque, force) in pending.items():
        for n in range(first):
            blocks[n, m] += _power(jacobians[n], torque, force)
    return ca.vertcat(*(ca.horzcat(*(blocks[n, m] if n <= m else blocks[m, n].T for m in range(sections))) for n in range(sections)))


def drag_force(shape, hats, drag, rates, moved, factors):
    """Product of `drag_matrix` at `rates` with the rates `moved` (4, S), without the matrix; (4, S)."""
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


def _combine(weights, values):
    """Weighted sum over the sections whose hats act here."""
    return sum(float(weights[n]) * values[n] for n in np.flatnonzero(weights))


def _power(jacobian, torque, force):
    """Rate of work (4, 4) of the wrenches (torque, force), (3, 4) each, on the twists of a section."""
    turning, moving = jacobian
    return moving.T @ force + ca.vertcat(turning.T @ torque, ca.SX(1, 4))
