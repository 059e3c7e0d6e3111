"""What the traits of an anatomy compile beside the connections of the octopus arm (squid tentacle of Tekinalp et al. 2024, SI).

Even rings: where a muscle overlaps a ring, both are pushed apart along their joint by a force k |s| d, with s the relative overlap in the
ring's plane and d the vector between the joint's two ends. The muscle feels its own, the ring at every muscle the mean over all, along its
own outward direction, so that it stays round. Sliding base: the first nodes of muscles and helices only stay in their plane.
"""

import numpy as np

from ..compiler import kernel
from .family_kernels import family_offsets
from .joint_kernels import spoke_offsets

ONE = np.uint64(1)


def even_repulsion(grid):
    """Compile ``repel(buffer)``, which adds to the forces and the bookkeeping of the spokes; between `ring_muscle` and `ring_ring`."""
    s, spokes = spoke_offsets(grid), grid.spokes
    width, start = np.uint64(grid.lanes), np.uint64(grid.first_spoke * grid.lanes)
    stop, last = start + np.uint64(spokes) * width, np.uint64(grid.rings + 1)
    S1, S2, S3, M1, M2, M3, O1, O2, O3, P1, P2, P3 = (s[f"{f}{i}"] for f in "SMOP" for i in (1, 2, 3))
    RING_RADIUS, RADIUS, REPULSION = s["RING_RADIUS"], s["RADIUS"], s["R_REPULSION"]
    F1, F2, F3, G1, G2, G3, SUM = (s[k] for k in ("F1", "F2", "F3", "G1", "G2", "G3", "SUM"))
    # The row of the forces on the next ring is not filled yet: it holds what each muscle pushes with.
    F1_R, F2_R, F3_R, PUSH = (s[k] for k in ("F1_R", "F2_R", "F3_R", "F1_X"))

    @kernel
    def repel(b):
        for k in range(start, stop):
            o1, o2, o3, p1, p2, p3 = b[O1 + k], b[O2 + k], b[O3 + k], b[P1 + k], b[P2 + k], b[P3 + k]
            c1, c2, c3 = b[M1 + k] - b[S1 + k], b[M2 + k] - b[S2 + k], b[M3 + k] - b[S3 + k]
            reach = b[RING_RADIUS + k] + b[RADIUS + k]
            axial = c1 * p1 + c2 * p2 + c3 * p3
            v1, v2, v3 = c1 - axial * p1, c2 - axial * p2, c3 - axial * p3
            overlap = max(1 - np.sqrt(v1 * v1 + v2 * v2 + v3 * v3) / (reach + 1e-300), 0.0)
            stiff = b[REPULSION + k] * overlap
            f1, f2, f3 = stiff * (c1 + reach * o1), stiff * (c2 + reach * o2), stiff * (c3 + reach * o3)
            along = f1 * p1 + f2 * p2 + f3 * p3
            f1, f2, f3 = f1 - along * p1, f2 - along * p2, f3 - along * p3
            outward = f1 * o1 + f2 * o2 + f3 * o3
            b[PUSH + k] = outward
            b[F1 + k] -= f1
            b[F2 + k] -= f2
            b[F3 + k] -= f3
            b[G1 + k] -= f1
            b[G2 + k] -= f2
            b[G3 + k] -= f3
            b[SUM + k] -= outward
        for i in range(ONE, last):
            mean = 0.0
            for k in range(start + i, stop, width):
                mean += b[PUSH + k]
            mean /= spokes
            for k in range(start + i, stop, width):
                b[F1_R + k] += mean * b[O1 + k]
                b[F2_R + k] += mean * b[O2 + k]
                b[F3_R + k] += mean * b[O3 + k]

    return repel


def sliding_base(grid):
    """Compile ``slide(buffer)``: take the first nodes of muscles and helices their velocity along the arm."""
    V2 = family_offsets(grid, False)["V2"]
    muscles = tuple(rod * grid.lanes + 1 for rod in range(1, grid.straight_rods))
    helices = tuple((grid.straight_rods + grid.helix_nodes * j) * grid.lanes + 1 for j in range(grid.helices))
    nodes = tuple(np.uint64(place) for place in muscles + helices)

    @kernel
    def slide(b):
        for node in nodes:
            b[V2 + node] = 0.0

    return slide
