"""Connections of rods that lie side by side: nerve cord with muscles, muscles with their neighbours.

A spring between material points of the two surfaces, with its force at its lever arm, and contact in the power 3/2 (laws of Tekinalp et
al. 2024, SI). A lever reaches from an element's axis as far as r / sqrt(e), its present radius with its share of the gap at rest. With

    U = 1/2 k |c + reach_2 v - reach_1 u|^2 + 2/5 k_c overlap^(5/2)

each force is a gradient of U in all its arguments, so also in the stretches: the axis is loaded by

    dU / dl = (reach / 2 l) S,      S = - dU / d reach

with S the tension of the connection. The published law (`published`) leaves that out, and keeps books of the normal forces instead.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .parts import sweep
from .spoke_kernels import spoke_offsets


def side_kernels(grid: AssemblyGrid, published: bool) -> Any:
    """Compile the connections of the cord and of neighbours.

    Returns
    -------
    cord, neighbours : compiled functions
        Of the buffer and a part, in this order: they fill the result rows F, T, SUM (reach times S) of the spokes, and G of the published
        law.
    """
    s = spoke_offsets(grid)
    L = np.uint64(grid.lanes)
    M1, M2, M3, A1, A2, A3, U1, U2, U3 = (s[f"{f}{i}"] for f in "MAU" for i in (1, 2, 3))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (s[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    RADIUS, UNROOT, CORD_RADIUS, CORD_UNROOT = (s[k] for k in ("RADIUS", "UNROOT", "CORD_RADIUS", "CORD_UNROOT"))
    CU21, CU22, CU23, C_GAP, C_SPRING, C_CONTACT = (s[k] for k in ("CU21", "CU22", "CU23", "C_GAP", "C_SPRING", "C_CONTACT"))
    NU11, NU12, NU13, NU21, NU22, NU23 = (s[f"NU{i}{j}"] for i in (1, 2) for j in (1, 2, 3))
    N_GAP, N_SPRING, N_CONTACT = (s[k] for k in ("N_GAP", "N_SPRING", "N_CONTACT"))

    def results(suffix: Any) -> Any:
        return tuple(s[f"{name}{suffix}"] for name in ("F1", "F2", "F3", "T1", "T2", "T3", "SUM", "G1", "G2", "G3"))

    F1, F2, F3, T1, T2, T3, SUM, G1, G2, G3 = results("")
    F1_N, F2_N, F3_N, T1_N, T2_N, T3_N, SUM_N, G1_N, G2_N, G3_N = results("_N")
    F1_C, F2_C, F3_C, T1_C, T2_C, T3_C, SUM_C, G1_C, G2_C, G3_C = results("_C")

    @kernel(inline="always")
    def side_by_side(
        c1: Any,
        c2: Any,
        c3: Any,
        u1: Any,
        u2: Any,
        u3: Any,
        v1: Any,
        v2: Any,
        v3: Any,
        radius1: Any,
        radius2: Any,
        share1: Any,
        share2: Any,
        spring: Any,
        contact: Any,
    ) -> Any:
        # c: from centre to centre; u, v: directions of the connection in the lab frame. Force on the first, its torques, loads of the axes.
        reach1, reach2 = radius1 + share1, radius2 + share2
        p1, p2, p3, q1, q2, q3 = reach1 * u1, reach1 * u2, reach1 * u3, reach2 * v1, reach2 * v2, reach2 * v3
        f1, f2, f3 = spring * (c1 + q1 - p1), spring * (c2 + q2 - p2), spring * (c3 + q3 - p3)
        a1, a2, a3 = p2 * f3 - p3 * f2, p3 * f1 - p1 * f3, p1 * f2 - p2 * f1
        b1, b2, b3 = q3 * f2 - q2 * f3, q1 * f3 - q3 * f1, q2 * f1 - q1 * f2
        distance = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
        overlap = max(reach1 + reach2 - distance, 0.0)
        if published:
            push = contact * overlap * np.sqrt(overlap) / distance
            f1, f2, f3 = f1 - push * c1, f2 - push * c2, f3 - push * c3
            touching = 1.0 if overlap > 0.0 else 0.0
            load1 = touching * (f1 * u1 + f2 * u2 + f3 * u3)
            load2 = -touching * (f1 * v1 + f2 * v2 + f3 * v3)
        else:
            push = contact * overlap * np.sqrt(overlap)
            load1 = reach1 * (f1 * u1 + f2 * u2 + f3 * u3 - push)
            load2 = -reach2 * (f1 * v1 + f2 * v2 + f3 * v3 + push)
            unit = push / distance
            f1, f2, f3 = f1 - unit * c1, f2 - unit * c2, f3 - unit * c3
        return f1, f2, f3, a1, a2, a3, b1, b2, b3, load1, load2

    @kernel
    def cord(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            w1, w2, w3 = b[CU21 + k], b[CU22 + k], b[CU23 + k]
            v1 = b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
            v2 = b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
            v3 = b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3
            u1, u2, u3 = b[U1 + k], b[U2 + k], b[U3 + k]
            gap = 0.5 * b[C_GAP + k]
            f1, f2, f3, a1, a2, a3, b1, b2, b3, load1, load2 = side_by_side(
                b[M1 + k] - b[A1 + k], b[M2 + k] - b[A2 + k], b[M3 + k] - b[A3 + k], u1, u2, u3, v1, v2, v3,
                b[CORD_RADIUS + k], b[RADIUS + k], gap * b[CORD_UNROOT + k], gap * b[UNROOT + k], b[C_SPRING + k], b[C_CONTACT + k],
            )  # fmt: skip
            b[F1_C + k], b[F2_C + k], b[F3_C + k] = f1, f2, f3
            b[T1_C + k], b[T2_C + k], b[T3_C + k] = a1, a2, a3
            b[SUM_C + k] = load1
            b[F1 + k], b[F2 + k], b[F3 + k] = -f1, -f2, -f3
            b[T1 + k], b[T2 + k], b[T3 + k] = b1, b2, b3
            b[SUM + k] = load2
            if published:
                b[G1_C + k], b[G2_C + k], b[G3_C + k] = load1 * u1, load1 * u2, load1 * u3
                b[G1 + k], b[G2 + k], b[G3 + k] = load2 * v1, load2 * v2, load2 * v3

    @kernel
    def neighbours(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            n = k + L
            w1, w2, w3 = b[NU11 + k], b[NU12 + k], b[NU13 + k]
            u1 = b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
            u2 = b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
            u3 = b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3
            w1, w2, w3 = b[NU21 + k], b[NU22 + k], b[NU23 + k]
            v1 = b[Q11 + n] * w1 + b[Q21 + n] * w2 + b[Q31 + n] * w3
            v2 = b[Q12 + n] * w1 + b[Q22 + n] * w2 + b[Q32 + n] * w3
            v3 = b[Q13 + n] * w1 + b[Q23 + n] * w2 + b[Q33 + n] * w3
            gap = 0.5 * b[N_GAP + k]
            f1, f2, f3, a1, a2, a3, b1, b2, b3, load1, load2 = side_by_side(
                b[M1 + n] - b[M1 + k], b[M2 + n] - b[M2 + k], b[M3 + n] - b[M3 + k], u1, u2, u3, v1, v2, v3,
                b[RADIUS + k], b[RADIUS + n], gap * b[UNROOT + k], gap * b[UNROOT + n], b[N_SPRING + k], b[N_CONTACT + k],
            )  # fmt: skip
            b[F1 + k] += f1
            b[F2 + k] += f2
            b[F3 + k] += f3
            b[T1 + k] += a1
            b[T2 + k] += a2
            b[T3 + k] += a3
            b[SUM + k] += load1
            b[F1_N + n], b[F2_N + n], b[F3_N + n] = -f1, -f2, -f3
            b[T1_N + n], b[T2_N + n], b[T3_N + n] = b1, b2, b3
            b[SUM_N + n] = load2
            if published:
                b[G1 + k] += load1 * u1
                b[G2 + k] += load1 * u2
                b[G3 + k] += load1 * u3
                b[G1_N + n], b[G2_N + n], b[G3_N + n] = load2 * v1, load2 * v2, load2 * v3

    return sweep(grid, "spokes", cord), sweep(grid, "spokes", neighbours)
