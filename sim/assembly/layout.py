"""Where the fields of the assembly stand in its flat buffers.

Every buffer is rows of one float64 array with a stride known at compile time (see `octoctrl.sim.rod.layout` for why). Within a row:

    straight rods + helices   ``slot * lanes + lane``        cord and longitudinal muscles first, one slot each; then the helices, as many
                                                              slots each as they have nodes per ring; lane of element e: e + 1, of
                                                              node k: k + 1, ghosts around
    rings                     ``(node + 1) * lanes + lane``  lane of ring i: i + 1, the first and the last slot are ghost copies
    spokes                    ``slot * lanes + lane``        scratch of the connections at the longitudinal muscles, with copies of the last
                                                              quarter turn before them and of the first half turn behind them
    crossings                 ``j * lanes + lane``           scratch of the connections of helix j with the rings
    slabs                     ``lane``                       volume and pressure between the ends of an element, smoothing of its ring

So the next element of an open rod is 1 away, the next element of all rings at once `lanes` away, and the same kernels serve both: what
differs is a compile-time constant. Lanes are rings, and longitudinal elements stand in the lane of their ring. All counts are those of an
`octoctrl.sim.body.grid.AssemblyGrid`, and every kernel of the assembly is compiled for one.
"""

from enum import auto

from ..physics.rows import Rows


class AssemblyRow(Rows):
    """Rows of the two rod buffers; directors, angular velocity, torques and moments are material, all else is in the lab frame."""

    X1, X2, X3, V1, V2, V3 = (auto() for _ in range(6))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (auto() for _ in range(9))
    W1, W2, W3 = (auto() for _ in range(3))
    LOW1, LOW2, LOW3 = (auto() for _ in range(3))  # in single precision, what is missing from X
    # Parameters: rest length, shear stiffness, rest radius, area; joint length, bend and twist stiffness, rest curvature; of a slab's
    # section, the share that moves with this rod; one over the lengths.
    LENGTH, SHEAR, REST_RADIUS, AREA, JOINT_LENGTH, BEND, TWIST, REST1, REST2, REST3, SECTION = (auto() for _ in range(11))
    INVERSE_LENGTH, INVERSE_JOINT = (auto() for _ in range(2))
    NODE_DECAY, NODE_MOBILITY, BEND_DECAY, TWIST_DECAY, BEND_MOBILITY, TWIST_MOBILITY = (auto() for _ in range(6))
    BEND_INERTIA, TWIST_INERTIA, LEVEL_BEFORE, LEVEL_AFTER, STRENGTH, PACE = (auto() for _ in range(6))
    # Scratch: F and C collect the forces on nodes and the couples on elements of the connections.
    STRETCH, RATE, RADIUS, T1, T2, T3, N1, N2, N3, TORQUE1, TORQUE2, TORQUE3 = (auto() for _ in range(12))
    MPLUS1, MPLUS2, MPLUS3, MMINUS1, MMINUS2, MMINUS3 = (auto() for _ in range(6))
    F1, F2, F3, C1, C2, C3 = (auto() for _ in range(6))
    VISCOSITY, SCALE, IMPULSE, CORRECTION = (auto() for _ in range(4))


STATE_ROWS, SINGLE_STATE_ROWS = int(AssemblyRow.LOW1), int(AssemblyRow.LENGTH)
"""Rows that hold the motion."""


class SpokeRow(Rows):
    """Rows of the spokes' buffer."""

    # Ring node; longitudinal element: centre, edge, directors, radius, one over the root of stretch; the cord's, repeated.
    S1, S2, S3 = (auto() for _ in range(3))
    M1, M2, M3, D1, D2, D3, RADIUS, UNROOT = (auto() for _ in range(8))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (auto() for _ in range(9))
    A1, A2, A3, CORD_RADIUS, CORD_UNROOT = (auto() for _ in range(5))
    U1, U2, U3 = (auto() for _ in range(3))
    # Parameters: cord to muscle (C_), muscle to its neighbour (N_), ring joints (R_).
    CU11, CU12, CU13, CU21, CU22, CU23, C_GAP, C_SPRING, C_CONTACT = (auto() for _ in range(9))
    NU11, NU12, NU13, NU21, NU22, NU23, N_GAP, N_SPRING, N_CONTACT = (auto() for _ in range(9))
    R_SPRING, R_TORQUE, R_LEAN, R_CONTACT, R_NEXT, R_REPULSION, R_EFFECTIVE = (auto() for _ in range(7))
    RING_RADIUS = auto()  # renewed in every step by the published laws
    # Results: on the muscle (F force on the element, T couple, SUM what loads its axis), on the first muscle's neighbour (_N), on the cord
    # (_C), on the ring node (_R). In the published laws SUM and G keep the books of its pressure, the ring's element takes a couple (T_R)
    # and the next ring's node a force (_X), and O, P are the directions of the joint.
    F1, F2, F3, T1, T2, T3, SUM, G1, G2, G3 = (auto() for _ in range(10))
    F1_N, F2_N, F3_N, T1_N, T2_N, T3_N, SUM_N, G1_N, G2_N, G3_N = (auto() for _ in range(10))
    F1_C, F2_C, F3_C, T1_C, T2_C, T3_C, SUM_C, G1_C, G2_C, G3_C = (auto() for _ in range(10))
    F1_R, F2_R, F3_R, T1_R, T2_R, T3_R = (auto() for _ in range(6))
    F1_X, F2_X, F3_X = (auto() for _ in range(3))
    O1, O2, O3, P1, P2, P3 = (auto() for _ in range(6))
    # Of the joints with a potential: unit vector along the ring and one over the distance it is taken from; load on the muscle's edge,
    # force on the opposite ring node, and on the one a quarter turn ahead (less: behind).
    H1, H2, H3, ACROSS = (auto() for _ in range(4))
    EDGE1, EDGE2, EDGE3, FAR1, FAR2, FAR3, SIDE1, SIDE2, SIDE3 = (auto() for _ in range(9))


class CrossingRow(Rows):
    """Rows of the crossings' buffer: ring nodes q + d, d = -2..2, and opposite node; helix nodes h - 1, h, h + 1."""

    A1, A2, A3, B1, B2, B3, S1, S2, S3, D1, D2, D3, E1, E2, E3, O1, O2, O3 = (auto() for _ in range(18))
    P1, P2, P3, H1, H2, H3, N1, N2, N3 = (auto() for _ in range(9))
    # Parameters; the published laws renew the radii in every step.
    A_RADIUS, B_RADIUS, S_RADIUS, D_RADIUS, E_RADIUS, P_RADIUS, H_RADIUS, N_RADIUS = (auto() for _ in range(8))
    SPRING, CONTACT, P_CONTACT, N_CONTACT, EFFECTIVE, SHARE, ARC = (auto() for _ in range(7))
    # Forces on ring nodes and helix nodes.
    FA1, FA2, FA3, FB1, FB2, FB3, FS1, FS2, FS3, FD1, FD2, FD3, FE1, FE2, FE3, FO1, FO2, FO3 = (auto() for _ in range(18))
    FP1, FP2, FP3, FH1, FH2, FH3, FN1, FN2, FN3 = (auto() for _ in range(9))
    P_PUSH, N_PUSH = (auto() for _ in range(2))  # of the helix nodes beside h over the distance: zero where they touch nothing


class SlabRow(Rows):
    """Rows of the slabs' buffer: one slab per ring, between the ends of an element of the muscles."""

    # Parameters: rest volume, bulk modulus, compliance over one step; what smooths a ring (`octoctrl.sim.assembly.ring_mass_kernels`).
    REST, BULK, COMPLIANCE, ROOT, GAIN, CLOSURE = (auto() for _ in range(6))
    # Vector area of the ring, mean edge of the muscles, volume and pressure; system of the projection; carries of the smoothing.
    A1, A2, A3, E1, E2, E3, VOLUME, PRESSURE = (auto() for _ in range(8))
    GIVE, DRAW, WEIGHT, RATE, SCALE, COUPLING, IMPULSE, UP, DOWN, SHARE = (auto() for _ in range(10))
    RING_RATE1, RING_RATE2, RING_RATE3, EDGE_RATE1, EDGE_RATE2, EDGE_RATE3 = (auto() for _ in range(6))


def stride_of(slots: int, lanes: int) -> int:
    """Row length: whole cache lines in either precision, but no multiple of 512 numbers, so that the rows do not fall on the same lines."""
    stride = -(-(max(slots * lanes, 576) + 8) // 16) * 16
    return stride + 16 if stride % 512 == 0 else stride
