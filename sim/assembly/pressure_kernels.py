"""Volume of the arm, slab by slab, and the pressure that keeps it.

A slab reaches from end to end of one element of the muscles and is bounded by its ring. With x_q the ring's nodes and X_m the muscles',

    a = 1/2 sum_q x_q+1 x x_q,     e = sum_m w_m (X_m,i+1 - X_m,i),     V = a.e,     U = 1/2 B V_0 (1 - V / V_0)^2

where w_m is the muscle's share of the section (the cord has none: the pressure would push it out at the tip). V is a polynomial that
depends on differences only, so that the pressure p = B (1 - V / V_0) changes neither momentum nor angular momentum.

B is that of water-filled tissue, far too stiff for an explicit step: after all other forces, velocities are projected. Increments of
pressure solve, with W the velocity per force of a node over one step h and g the gradients of V,

    (S + V_0 / (h B)) dp = - (V(x + h v) - V(x)) / h,     S_ij = sum over nodes of W g_i.g_j,     v += W g dp

which is tridiagonal, as only muscles reach from slab to slab. On the right stands all that the step does to V, a polynomial of third
degree: with its first order g.v alone, a curled tip that moves by a tenth of a ring's radius in a step would gain or lose a hundredth of
its volume, a pressure of 100 kPa, and shake itself apart. The pressure of the next step follows from V itself and agrees with p + dp:
there is no state beside the positions.

Pressure must move a whole hoop and not its nodes alone: over a step the viscosity of a ring's elements is hundreds to thousands of times
its mass. So its nodes have a part of W, v += w W g dp, with w the part of g.dv that one tension leaves, the same for the whole hoop: with
t_q the tangents, c_q = t_q-1 - t_q and Y_q the viscosities of the elements over the step,

    w = 1 - W (sum g_q.c_q)^2 / ((sum 1 / Y_q + W sum |c_q|^2) sum |g_q|^2)

which is 1 / (1 + W Y (2 - 2 cos(2 pi / n))) for a round ring. Muscles that push and helices that pull scallop a ring, which then gives
way to pressure without stretching anything; this w knows it, and is never too small, since a tension free to differ from element to
element would leave less. If a ring gave way more than twice as much as the projection takes it to, the pressure would overshoot from step
to step and the rings flutter; with the bare W, w = 1, it would lag.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .crossing_kernels import crossing_offsets
from .family_kernels import NOTHING, family_offsets, position_kernels
from .layout import CrossingRow, SlabRow, stride_of
from .system_kernels import two_ended

ONE = np.uint64(1)


def slab_offsets(grid: AssemblyGrid) -> dict[str, np.uint64]:
    """Unsigned offsets of the slabs' rows in the one buffer."""
    start = int(crossing_offsets(grid)["A1"]) + len(CrossingRow) * stride_of(grid.helices, grid.lanes)
    return {row.name: np.uint64(start + row * stride_of(1, grid.lanes)) for row in SlabRow}


def buffer_size(grid: AssemblyGrid) -> int:
    """Numbers in the one buffer of an assembly."""
    return int(slab_offsets(grid)["REST"]) + len(SlabRow) * stride_of(1, grid.lanes)


def pressure_kernels(grid: AssemblyGrid, sliding: bool) -> Any:
    """Compile volumes, pressure and projection of the slabs.

    Parameters
    ----------
    grid : AssemblyGrid
    sliding : bool
        Whether the first ring is free and the muscles' first nodes slide in their plane; otherwise both are held.

    Returns
    -------
    measure, press, resist, deflate, settle : compiled functions
        Of the buffer and a part: volumes and pressures; forces on ring nodes and loads on the muscles' axes; and three stages of the
        correction of the velocities, between which all parts meet: the system and half its solution, with the step as a third argument;
        the other half, and the rings; the muscles.
    """
    o, g, t = family_offsets(grid, False), family_offsets(grid, True), slab_offsets(grid)
    L, nodes, straight = np.uint64(grid.lanes), grid.ring_nodes, np.uint64(grid.straight_rods)
    A1, A2, A3, E1, E2, E3, REST, BULK, VOLUME, PRESSURE = (
        t[k] for k in ("A1", "A2", "A3", "E1", "E2", "E3", "REST", "BULK", "VOLUME", "PRESSURE")
    )
    SCALE, COUPLING, IMPULSE, COMPLIANCE = (t[k] for k in ("SCALE", "COUPLING", "IMPULSE", "COMPLIANCE"))
    eliminate, substitute = two_ended(t, "COUPLING")
    alone, zero = 1, np.uint64(0)
    GIVE, DRAW, WEIGHT = (t[k] for k in ("GIVE", "DRAW", "WEIGHT"))
    B1, B2, B3, D1, D2, D3 = (t[f"{f}{i}"] for f in ("RING_RATE", "EDGE_RATE") for i in (1, 2, 3))
    RX1, RX2, RX3, RV1, RV2, RV3, RF1, RF2, RF3 = (g[f"{f}{i}"] for f in "XVF" for i in (1, 2, 3))
    V1, V2, V3, N1, N2, N3 = (o[f"{f}{i}"] for f in "VN" for i in (1, 2, 3))
    (apart, _), (ring_apart, _) = position_kernels(grid, False), position_kernels(grid, True)
    SECTION, MOBILITY, RING_MOBILITY, VISCOSITY = o["SECTION"], o["NODE_MOBILITY"], g["NODE_MOBILITY"], g["VISCOSITY"]
    RT1, RT2, RT3 = (g[f"T{i}"] for i in (1, 2, 3))

    @kernel(inline="always")
    def beside(node: Any) -> Any:
        # Slots of the nodes before and after.
        return np.uint64(node - 1 if node > 1 else nodes) * L, np.uint64(node + 1 if node < nodes else 1) * L

    @kernel
    def measure(b: Any, part: Any) -> None:
        for row in (A1, A2, A3, E1, E2, E3):
            for i in range(part.low, part.high):
                b[row + i] = 0.0
        # Relative to the first node, where its two products are zero: far from the origin they would be large and cancel.
        for node in range(2, nodes):
            here = np.uint64(node) * L
            for i in range(part.low, part.high):
                k, first = here + i, L + i
                x1, x2, x3 = ring_apart(b, k + L, first)
                y1, y2, y3 = ring_apart(b, k, first)
                b[A1 + i] += 0.5 * (x2 * y3 - x3 * y2)
                b[A2 + i] += 0.5 * (x3 * y1 - x1 * y3)
                b[A3 + i] += 0.5 * (x1 * y2 - x2 * y1)
        for rod in range(ONE, straight):
            for i in range(part.low, part.high):
                k = rod * L + i
                share = b[SECTION + k]
                d1, d2, d3 = apart(b, k + ONE, k)
                b[E1 + i] += share * d1
                b[E2 + i] += share * d2
                b[E3 + i] += share * d3
        for i in range(part.low, part.high):
            volume = b[A1 + i] * b[E1 + i] + b[A2 + i] * b[E2 + i] + b[A3 + i] * b[E3 + i]
            b[VOLUME + i] = volume
            b[PRESSURE + i] = b[BULK + i] * (1.0 - volume / b[REST + i])

    @kernel
    def press(b: Any, part: Any) -> None:
        for node in range(1, nodes + 1):
            here, (before, after) = np.uint64(node) * L, beside(node)
            for i in range(part.low, part.high):
                k, p, q, half = here + i, before + i, after + i, 0.5 * b[PRESSURE + i]
                d1, d2, d3 = half * (b[RX1 + q] - b[RX1 + p]), half * (b[RX2 + q] - b[RX2 + p]), half * (b[RX3 + q] - b[RX3 + p])
                e1, e2, e3 = b[E1 + i], b[E2 + i], b[E3 + i]
                b[RF1 + k] += e2 * d3 - e3 * d2
                b[RF2 + k] += e3 * d1 - e1 * d3
                b[RF3 + k] += e1 * d2 - e2 * d1
        for rod in range(ONE, straight):
            for i in range(part.low, part.high):
                k = rod * L + i
                load = b[SECTION + k] * b[PRESSURE + i]
                b[N1 + k] -= load * b[A1 + i]
                b[N2 + k] -= load * b[A2 + i]
                b[N3 + k] -= load * b[A3 + i]

    @kernel
    def swell(b: Any, part: Any, h: Any) -> None:
        # (V(x + h v) - V(x)) / h = a.e' + a'.(e + h e'), with e' and a' what a step does to e and a, over h; relative to the first node.
        for row in (B1, B2, B3, D1, D2, D3):
            for i in range(part.low, part.high):
                b[row + i] = 0.0
        for node in range(2, nodes):
            here = np.uint64(node) * L
            for i in range(part.low, part.high):
                k, q, first = here + i, here + L + i, L + i
                w1, w2, w3 = b[RV1 + first], b[RV2 + first], b[RV3 + first]
                u1, u2, u3 = b[RV1 + q] - w1, b[RV2 + q] - w2, b[RV3 + q] - w3
                v1, v2, v3 = b[RV1 + k] - w1, b[RV2 + k] - w2, b[RV3 + k] - w3
                x1, x2, x3 = ring_apart(b, q, first)
                y1, y2, y3 = ring_apart(b, k, first)
                y1, y2, y3 = y1 + h * v1, y2 + h * v2, y3 + h * v3
                b[B1 + i] += 0.5 * (u2 * y3 - u3 * y2 + x2 * v3 - x3 * v2)
                b[B2 + i] += 0.5 * (u3 * y1 - u1 * y3 + x3 * v1 - x1 * v3)
                b[B3 + i] += 0.5 * (u1 * y2 - u2 * y1 + x1 * v2 - x2 * v1)
        for rod in range(ONE, straight):
            for i in range(part.low, part.high):
                k = rod * L + i
                share = b[SECTION + k]
                b[D1 + i] += share * (b[V1 + k + ONE] - b[V1 + k])
                b[D2 + i] += share * (b[V2 + k + ONE] - b[V2 + k])
                b[D3 + i] += share * (b[V3 + k + ONE] - b[V3 + k])
        for i in range(part.low, part.high):
            d1, d2, d3 = b[D1 + i], b[D2 + i], b[D3 + i]
            rate = b[A1 + i] * d1 + b[A2 + i] * d2 + b[A3 + i] * d3
            rate += b[B1 + i] * (b[E1 + i] + h * d1) + b[B2 + i] * (b[E2 + i] + h * d2) + b[B3 + i] * (b[E3 + i] + h * d3)
            b[IMPULSE + i] = -rate

    @kernel
    def resist(b: Any, part: Any, h: Any) -> None:
        for row in (SCALE, COUPLING, GIVE, DRAW):
            for i in range(part.low, part.high):
                b[row + i] = 0.0
        swell(b, part, h)
        for node in range(1, nodes + 1):
            here, (before, after) = np.uint64(node) * L, beside(node)
            for i in range(part.low, part.high):
                k, p, q = here + i, before + i, after + i
                d1, d2, d3 = 0.5 * (b[RX1 + q] - b[RX1 + p]), 0.5 * (b[RX2 + q] - b[RX2 + p]), 0.5 * (b[RX3 + q] - b[RX3 + p])
                e1, e2, e3 = b[E1 + i], b[E2 + i], b[E3 + i]
                g1, g2, g3 = e2 * d3 - e3 * d2, e3 * d1 - e1 * d3, e1 * d2 - e2 * d1
                mobility = b[RING_MOBILITY + k]
                c1, c2, c3 = b[RT1 + k - L] - b[RT1 + k], b[RT2 + k - L] - b[RT2 + k], b[RT3 + k - L] - b[RT3 + k]
                b[SCALE + i] += mobility * (g1 * g1 + g2 * g2 + g3 * g3)
                b[DRAW + i] += mobility * (g1 * c1 + g2 * c2 + g3 * c3)
                b[GIVE + i] += 1.0 / (b[VISCOSITY + k] + NOTHING) + mobility * (c1 * c1 + c2 * c2 + c3 * c3)
        for i in range(part.low, part.high):
            # The held ring has no mobility at all.
            b[WEIGHT + i] = 1.0 - b[DRAW + i] * b[DRAW + i] / (b[GIVE + i] * b[SCALE + i] + NOTHING)
            b[SCALE + i] = b[COMPLIANCE + i] + b[WEIGHT + i] * b[SCALE + i]
        for rod in range(ONE, straight):
            for i in range(part.low, part.high):
                k = rod * L + i
                n = k + ONE
                share, a1, a2, a3 = b[SECTION + k], b[A1 + i], b[A2 + i], b[A3 + i]
                low = 0.0 if sliding and i + part.before == ONE else b[MOBILITY + k]
                b[SCALE + i] += share * share * (low + b[MOBILITY + n]) * (a1 * a1 + a2 * a2 + a3 * a3)
                across = a1 * b[A1 + i + ONE] + a2 * b[A2 + i + ONE] + a3 * b[A3 + i + ONE]
                b[COUPLING + i] -= share * b[SECTION + n] * b[MOBILITY + n] * across
        eliminate(b, part.first, part.last, part.middle, zero, zero, alone)

    @kernel
    def deflate(b: Any, part: Any) -> None:
        substitute(b, part.first, part.last, part.middle, zero, zero, alone)
        for node in range(1, nodes + 1):
            here, (before, after) = np.uint64(node) * L, beside(node)
            for i in range(part.low, part.high):
                k, p, q = here + i, before + i, after + i
                half = 0.5 * b[IMPULSE + i] * b[WEIGHT + i] * b[RING_MOBILITY + k]
                d1, d2, d3 = half * (b[RX1 + q] - b[RX1 + p]), half * (b[RX2 + q] - b[RX2 + p]), half * (b[RX3 + q] - b[RX3 + p])
                e1, e2, e3 = b[E1 + i], b[E2 + i], b[E3 + i]
                b[RV1 + k] += e2 * d3 - e3 * d2
                b[RV2 + k] += e3 * d1 - e1 * d3
                b[RV3 + k] += e1 * d2 - e2 * d1

    @kernel
    def settle(b: Any, part: Any) -> None:
        for rod in range(ONE, straight):
            for i in range(part.low, part.high):
                k, p = rod * L + i, i - ONE
                mobility = 0.0 if sliding and i + part.before == ONE else b[MOBILITY + k]
                here, before = mobility * b[SECTION + k] * b[IMPULSE + i], mobility * b[SECTION + k - ONE] * b[IMPULSE + p]
                b[V1 + k] += before * b[A1 + p] - here * b[A1 + i]
                b[V2 + k] += before * b[A2 + p] - here * b[A2 + i]
                b[V3 + k] += before * b[A3 + p] - here * b[A3 + i]

    return measure, press, resist, deflate, settle
