"""The buffer of a rod, filled: states, joints, masses, damping for a time step; and what is read from it, curvature and energy."""

import numpy as np
from numpy.typing import ArrayLike

from ..contracts import Floats
from ..physics.damping import damped
from ..rotations import rotation_vector
from .layout import STATE_ROWS, Row


def set_state(rows: Floats, n: int, points: ArrayLike, frames: ArrayLike, base_frame: ArrayLike) -> None:
    """Write positions (n + 1, 3), frames (n, 3, 3) and the ghost frame of the clamp at the base; everything at rest."""
    rows[:STATE_ROWS] = 0.0
    rows[Row.X1 : Row.X3 + 1, 1 : n + 2] = np.asarray(points).T
    rows[Row.Q11 : Row.Q33 + 1, 1 : n + 1] = np.asarray(frames).reshape(n, 9).T
    rows[Row.Q11 : Row.Q33 + 1, 0] = np.asarray(base_frame).reshape(9)
    rows[Row.STRETCH] = 1.0


def set_joints(rows: Floats, n: int, length: Floats, bend: Floats, twist: Floats, *, clamped: bool) -> None:
    """Lengths of elements and joints, and stiffnesses (per element, N m^2) averaged over the two half elements of each joint.

    The joint at the base has the stiffness of the first element if `clamped`, else none; that at the tip has none.
    """
    joint = np.empty(n + 1)
    joint[0], joint[-1], joint[1:-1] = length[0] / 2, length[-1] / 2, (length[1:] + length[:-1]) / 2
    rows[Row.JOINT_LENGTH, 1 : n + 2], rows[Row.INVERSE_JOINT, 1 : n + 2] = joint, 1 / joint
    rows[Row.LENGTH, 1 : n + 1], rows[Row.INVERSE_LENGTH, 1 : n + 1] = length, 1 / length
    for row, stiffness in ((Row.BEND1, bend), (Row.BEND2, bend), (Row.TWIST, twist)):
        rows[row, 2 : n + 1] = (stiffness[1:] * length[1:] + stiffness[:-1] * length[:-1]) / (length[1:] + length[:-1])
        rows[row, 1] = stiffness[0] if clamped else 0.0


def node_masses(element_values: Floats) -> Floats:
    """Half of each element's value on either of its nodes."""
    return np.concatenate([[element_values[0] / 2], (element_values[1:] + element_values[:-1]) / 2, [element_values[-1] / 2]])


def set_damping(
    rows: Floats,
    n: int,
    h: float,
    node_rate: ArrayLike,
    bend_rate: ArrayLike,
    twist_rate: ArrayLike,
    *,
    fixed: str,
    masses: Floats,
) -> None:
    """Decay factors exp(-g h) and mobilities h phi1(g h) / inertia for rates in 1/s; what is `fixed` gets neither.

    ``"clamped"`` holds the base node, ``"element"`` the first element as well, ``"free"`` nothing.
    """
    decay, weight = damped(node_rate, h)
    rows[Row.NODE_DECAY, 1 : n + 2] = decay
    rows[Row.NODE_MOBILITY, 1 : n + 2] = weight / masses
    bend_decay, bend_weight = damped(bend_rate, h)
    twist_decay, twist_weight = damped(twist_rate, h)
    rows[Row.BEND_DECAY, 1 : n + 1], rows[Row.TWIST_DECAY, 1 : n + 1] = bend_decay, twist_decay
    rows[Row.MOBILITY1, 1 : n + 1] = bend_weight / rows[Row.INERTIA1, 1 : n + 1]
    rows[Row.MOBILITY2, 1 : n + 1] = bend_weight / rows[Row.INERTIA2, 1 : n + 1]
    rows[Row.MOBILITY3, 1 : n + 1] = twist_weight / rows[Row.INERTIA3, 1 : n + 1]
    if fixed != "free":
        rows[Row.NODE_DECAY, 1] = rows[Row.NODE_MOBILITY, 1] = 0.0
    if fixed == "element":
        for row in (Row.BEND_DECAY, Row.TWIST_DECAY, Row.MOBILITY1, Row.MOBILITY2, Row.MOBILITY3):
            rows[row, 1] = 0.0


def joint_curvature(rows: Floats, joints: int) -> Floats:
    """Curvature (3, joints) of the first so many joints, 1/m, from the present frames; the first is the one at the base."""
    frames = rows[Row.Q11 : Row.Q33 + 1, : joints + 1].T.reshape(-1, 3, 3)
    return (rotation_vector(frames[1:] @ np.swapaxes(frames[:-1], 1, 2)) / rows[Row.JOINT_LENGTH, 1 : joints + 1, None]).T


def rod_energy(rows: Floats, n: int, node_mass: Floats, *, constant_section: bool) -> dict[str, float]:
    """Kinetic and elastic energy of a rod at a sample, J; for an incompressible section what is called elastic is its nearest relative."""
    # The joint at a clamped tip has a frame beyond it.
    joints = n + 1 if rows[Row.BEND1, n + 1] > 0 else n
    points, frames = rows[Row.X1 : Row.X3 + 1, 1 : n + 2], rows[Row.Q11 : Row.Q33 + 1, 1 : n + 1].T.reshape(-1, 3, 3)
    edges, length = np.diff(points, axis=1).T, rows[Row.LENGTH, 1 : n + 1]
    stretch = np.ones(n) if constant_section else np.linalg.norm(edges, axis=1) / length
    sigma = np.einsum("kij,kj->ki", frames, edges) / length[:, None] - np.array([0.0, 0.0, 1.0])
    stiffness = np.stack([rows[Row.SHEAR, 1 : n + 1], rows[Row.SHEAR, 1 : n + 1], rows[Row.AXIAL, 1 : n + 1]], axis=1)
    kinetic = 0.5 * np.sum(node_mass * np.sum(rows[Row.V1 : Row.V3 + 1, 1 : n + 2] ** 2, axis=0))
    kinetic += 0.5 * np.sum(rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1 : n + 1] * rows[Row.W1 : Row.W3 + 1, 1 : n + 1] ** 2 / stretch)
    bending = np.stack([rows[row, 1 : joints + 1] for row in (Row.BEND1, Row.BEND2, Row.TWIST)])
    kappa = joint_curvature(rows, joints) - rows[Row.REST1 : Row.REST3 + 1, 1 : joints + 1]
    elastic = 0.5 * np.sum(stiffness * sigma**2 / stretch[:, None] * length[:, None])
    elastic += 0.5 * np.sum(bending * kappa**2 * rows[Row.JOINT_LENGTH, 1 : joints + 1])
    return {"kinetic": float(kinetic), "elastic": float(elastic)}
