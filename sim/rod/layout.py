"""One flat buffer for a rod: where each field stands.

All fields of a rod, state, parameters and scratch, are rows of one float64 buffer with a stride that is known at compile time, so that
the compiler sees that no two rows overlap and turns every loop over elements into vector instructions. Staggered grid, n elements:

    element      0(ghost)   1      2            n    n+1(ghost)
                    ·    |-----|-----|  ...  |-----|  ·
    node                 1     2     3       n    n+1
    joint                1     2     3       n    n+1

Node k is the base side of element k; joint k sits at node k, between elements k - 1 and k. Joint 1 connects the first element to a ghost
that carries the clamp's frame; joint n + 1 at the free tip carries nothing. Ghosts make every difference free of branches.
"""

from enum import auto

import numpy as np

from ..contracts import Floats
from ..physics.rows import Rows

STRIDES = (584, 1112, 2120)
"""Row lengths to choose from.

Neighbouring rows must be more than 512 numbers apart (closer, the compiler fears for store-to-load forwarding and halves its vectors),
and not a multiple of 512 (rows would fall on the same cache lines)."""


class Row(Rows):
    """Rows of the buffer, by field and component (material components unless said)."""

    # State. Nodes: position and velocity in the lab frame. Elements: directors (row i of Q is d_i in the lab frame), angular velocity.
    X1, X2, X3, V1, V2, V3 = (auto() for _ in range(6))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (auto() for _ in range(9))
    W1, W2, W3 = (auto() for _ in range(3))
    # Parameters of elements: rest length, shear and axial stiffness, rotary inertia; of joints: rest length, bend and twist stiffness and
    # rest curvature; of nodes: dead force in the lab frame.
    LENGTH, INVERSE_LENGTH, SHEAR, AXIAL, INERTIA1, INERTIA2, INERTIA3 = (auto() for _ in range(7))
    JOINT_LENGTH, INVERSE_JOINT, BEND1, BEND2, TWIST, REST1, REST2, REST3 = (auto() for _ in range(8))
    FORCE1, FORCE2, FORCE3, COUPLE1, COUPLE2, COUPLE3 = (auto() for _ in range(6))
    # Damping in phi-1 form: a velocity becomes DECAY * velocity + MOBILITY * force over one step.
    NODE_DECAY, NODE_MOBILITY, BEND_DECAY, TWIST_DECAY = (auto() for _ in range(4))
    MOBILITY1, MOBILITY2, MOBILITY3 = (auto() for _ in range(3))
    DRAG_NORMAL, DRAG_TANGENT = (auto() for _ in range(2))
    # Parameters of the muscular section: offsets of longitudinal and oblique fibres, areas, rest length of the oblique fibre.
    OFFSET, HELIX, CORD_AREA, LONGITUDINAL_AREA, RING_AREA, OBLIQUE_AREA, OBLIQUE_REST = (auto() for _ in range(7))
    # Scratch of one step.
    STRETCH, RATE, T1, T2, T3, N1, N2, N3, TORQUE1, TORQUE2, TORQUE3 = (auto() for _ in range(11))
    K1, K2, K3, KRATE1, KRATE2, KRATE3, M1, M2, M3, A1, A2, A3 = (auto() for _ in range(12))
    MEAN1, MEAN2, MEAN3, MEANRATE1, MEANRATE2, MEANRATE3 = (auto() for _ in range(6))
    RADIUS, SHRINK, TENSION, MOMENT1, MOMENT2, MOMENT3, STIFF, STIFF_TURN = (auto() for _ in range(8))
    YIELD, DIAGONAL, DIAGONAL_TURN, COUPLING = (auto() for _ in range(4))
    IMPULSE, IMPULSE1, IMPULSE2, IMPULSE3, OLD1, OLD2, OLD3, SPIN1, SPIN2, SPIN3, LEVEL = (auto() for _ in range(11))


STATE_ROWS = 18


def stride_for(elements: int) -> int:
    """The shortest stride that holds a rod of so many elements with its ghosts."""
    for stride in STRIDES:
        if elements + 3 <= stride:
            return stride
    raise ValueError(f"elements={elements}: at most {STRIDES[-1] - 3} are supported")


def new_buffer(elements: int) -> tuple[Floats, Floats]:
    """A zeroed buffer and its view as rows.

    Returns
    -------
    buffer : (rows * stride,) float64
    rows : (rows, stride) float64
        View of `buffer`; ``rows[Row.X1, 1:n+2]`` are the nodes, ``rows[Row.W1, 1:n+1]`` the elements.
    """
    stride = stride_for(elements)
    buffer = np.zeros(len(Row) * stride)
    return buffer, buffer.reshape(len(Row), stride)


def offsets(stride: int) -> dict[str, np.uint64]:
    """Unsigned offset of each row, by name: a signed index would carry a wrap-around test that prevents vectorisation."""
    return {row.name: np.uint64(row * stride) for row in Row}
