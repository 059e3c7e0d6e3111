"""The published numerics of the assembly, for comparison: axial force along the director, explicit force-velocity law, velocity filter.

They differ from `octoctrl.sim.assembly.family_kernels` in three ways (and take the linear drag explicitly), each of which changes the
motion. The muscle pulls along d3, so that an active rod buckles in shear. The force-velocity law is taken at the old rate, so that it
chatters, and goes on below zero in fast shortening. A filter of order five takes away grid-scale velocities at every step,
u <- u - F^5 u with F a quarter of the negative second difference (Tekinalp et al. 2024, SI), so that its strength depends on the step.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..physics.fibre_kernels import horner, isometric_stress, passive_stress
from .family_kernels import family_offsets

ONE = np.uint64(1)
SPIN_ARM = 1e-3
"""Lever (m) that turns the linear drag into a drag on spin, as in `octoctrl.sim.assembly.buffer`."""


@kernel
def published_factor(law: Any, rate: float) -> float:
    """Force-velocity factor without a lower bound, at a stretch rate, 1/s."""
    w = -rate * law.rate
    shortening = (1.0 - w) / (1.0 + law.concentric * max(w, 0.0))
    lengthening = 1.0 - law.eccentric_gain * w / (1.0 - law.eccentric * min(w, 0.0))
    return shortening if w > 0.0 else lengthening


ROUNDING = 1e-12
"""Strain below which nothing is stretched: the source rounds, and so stays at rest where the bare law pushes as soon as it may."""


@kernel
def bare_passive_stress(law: Any, s: float) -> float:
    """Passive stress with the polynomial as it stands: that of the squid's rings pushes until 2.6 % above rest."""
    tension = horner(law.passive, min(s, law.high)) + law.high_slope * max(s - law.high, 0.0)
    return tension if s > 1.0 + law.slack + ROUNDING else law.compression * min(s - 1.0 + law.slack, 0.0)


def published_strain(grid: AssemblyGrid, rings: bool, graded: bool = False, bare: bool = False) -> Any:
    """Compile ``strain(buffer, first, last, share, elastic, law)`` of one family; `elastic` is not used.

    Elements may be `graded` in strength and pace, and their passive stress may be the `bare` polynomial.
    """
    o = family_offsets(grid, rings)
    passive = bare_passive_stress if bare else passive_stress
    STRENGTH, PACE = o["STRENGTH"], o["PACE"]
    step = np.uint64(grid.lanes if rings else 1)
    X1, X2, X3, V1, V2, V3 = (o[name] for name in ("X1", "X2", "X3", "V1", "V2", "V3"))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    W1, W2, W3, T1, T2, T3, N1, N2, N3 = (o[f"{field}{i}"] for field in "WTN" for i in (1, 2, 3))
    TORQUE1, TORQUE2, TORQUE3 = (o[f"TORQUE{i}"] for i in (1, 2, 3))
    LENGTH, SHEAR, AREA, REST_RADIUS, STRETCH, RADIUS = (o[k] for k in ("LENGTH", "SHEAR", "AREA", "REST_RADIUS", "STRETCH", "RADIUS"))
    LEVEL_BEFORE, LEVEL_AFTER, BEND_INERTIA, TWIST_INERTIA = (
        o[k] for k in ("LEVEL_BEFORE", "LEVEL_AFTER", "BEND_INERTIA", "TWIST_INERTIA")
    )

    @kernel
    def strain(b: Any, first: Any, last: Any, share: Any, elastic: Any, law: Any) -> None:
        for k in range(first, last):
            q = k + step
            d1, d2, d3 = b[X1 + q] - b[X1 + k], b[X2 + q] - b[X2 + k], b[X3 + q] - b[X3 + k]
            length = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
            inverse = 1 / length
            t1, t2, t3 = d1 * inverse, d2 * inverse, d3 * inverse
            rest = b[LENGTH + k]
            stretch, unstretch = length / rest, rest * inverse
            u1, u2, u3 = b[V1 + q] - b[V1 + k], b[V2 + q] - b[V2 + k], b[V3 + q] - b[V3 + k]
            rate = (t1 * u1 + t2 * u2 + t3 * u3) / rest
            m1 = b[Q11 + k] * t1 + b[Q12 + k] * t2 + b[Q13 + k] * t3
            m2 = b[Q21 + k] * t1 + b[Q22 + k] * t2 + b[Q23 + k] * t3
            m3 = b[Q31 + k] * t1 + b[Q32 + k] * t2 + b[Q33 + k] * t3
            level = b[LEVEL_BEFORE + k] + share * (b[LEVEL_AFTER + k] - b[LEVEL_BEFORE + k])
            s = stretch * m3
            strength, pace = (b[STRENGTH + k], b[PACE + k]) if graded else (1.0, 1.0)
            active = strength * level * isometric_stress(law, s) * published_factor(law, pace * rate)
            n3 = b[AREA + k] * (active + (strength if s > 1.0 else 1.0) * passive(law, s))
            n1, n2 = b[SHEAR + k] * stretch * m1, b[SHEAR + k] * stretch * m2
            b[STRETCH + k], b[RADIUS + k] = stretch, b[REST_RADIUS + k] * np.sqrt(unstretch)
            b[T1 + k], b[T2 + k], b[T3 + k] = t1, t2, t3
            b[N1 + k] = (b[Q11 + k] * n1 + b[Q21 + k] * n2 + b[Q31 + k] * n3) * unstretch
            b[N2 + k] = (b[Q12 + k] * n1 + b[Q22 + k] * n2 + b[Q32 + k] * n3) * unstretch
            b[N3 + k] = (b[Q13 + k] * n1 + b[Q23 + k] * n2 + b[Q33 + k] * n3) * unstretch
            w1, w2, w3 = b[W1 + k], b[W2 + k], b[W3 + k]
            j1, j2, j3 = b[BEND_INERTIA + k] * w1 * unstretch, b[BEND_INERTIA + k] * w2 * unstretch, b[TWIST_INERTIA + k] * w3 * unstretch
            swelling = rate * unstretch
            b[TORQUE1 + k] = (m2 * n3 - m3 * n2) * rest + j2 * w3 - j3 * w2 + j1 * swelling
            b[TORQUE2 + k] = (m3 * n1 - m1 * n3) * rest + j3 * w1 - j1 * w3 + j2 * swelling
            b[TORQUE3 + k] = (m1 * n2 - m2 * n1) * rest + j1 * w2 - j2 * w1 + j3 * swelling

    return strain


def velocity_filters(grid: AssemblyGrid, rings: bool = True) -> Any:
    """Compile ``smooth(buffer, first, last)``, the filter of velocities and spins of the open rods (up to `last`) and the `rings`.

    Rows VISCOSITY and RATE of the open rods hold one at inner nodes and inner elements, zero elsewhere.
    """
    o, g = family_offsets(grid, False), family_offsets(grid, True)
    speeds, spins = ("V1", "V2", "V3"), ("W1", "W2", "W3")
    open_rows = tuple(o[name] for name in speeds + spins)
    ring_rows = tuple(g[name] for name in speeds + spins)
    A, B, NODES, ELEMENTS, RING_A, RING_B = o["IMPULSE"], o["CORRECTION"], o["VISCOSITY"], o["RATE"], g["IMPULSE"], g["CORRECTION"]
    L, end, behind = np.uint64(grid.lanes), np.uint64(grid.ring_nodes * grid.lanes), np.uint64(grid.ring_nodes + 1)

    @kernel
    def once(b: Any, source: Any, target: Any, mask: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            b[target + k] = 0.25 * b[mask + k] * (2 * b[source + k] - b[source + k - ONE] - b[source + k + ONE])

    @kernel
    def ring_once(b: Any, source: Any, target: Any) -> None:
        for node in range(ONE, behind):
            base = node * L
            for i in range(L):
                k = base + i
                b[target + k] = 0.25 * (2 * b[source + k] - b[source + k - L] - b[source + k + L])

    @kernel
    def smooth(b: Any, first: Any, last: Any) -> None:
        for row in range(6):
            u, mask = open_rows[row], NODES if row < 3 else ELEMENTS
            once(b, u, A, mask, first, last)
            for _ in range(2):
                once(b, A, B, mask, first, last)
                once(b, B, A, mask, first, last)
            for k in range(first, last):
                b[u + k] -= b[A + k]
            if not rings:
                continue
            u = ring_rows[row]
            for i in range(L):
                b[u + i], b[u + end + L + i] = b[u + end + i], b[u + L + i]
                b[RING_A + i], b[RING_A + end + L + i], b[RING_B + i], b[RING_B + end + L + i] = 0.0, 0.0, 0.0, 0.0
            ring_once(b, u, RING_A)
            for _ in range(2):
                ring_once(b, RING_A, RING_B)
                ring_once(b, RING_B, RING_A)
            for k in range(L, end + L):
                b[u + k] -= b[RING_A + k]

    return smooth


def published_drag(grid: AssemblyGrid) -> Any:
    """Compile ``brake(buffer, oblique_rate, ring_rate)``: linear drag of helices and rings on the elements' mean velocity and spin.

    Force -c l v with c = density * area * rate and l the present length, half on either node, so that a zigzag of the nodes is not felt;
    torque -c l w times `SPIN_ARM` squared. Adds to the nodes' forces F and to TORQUE.
    """
    o, g, lanes = family_offsets(grid, False), family_offsets(grid, True), grid.lanes

    def braking(table: Any, step: Any) -> Any:
        V1, V2, V3, W1, W2, W3, F1, F2, F3 = (table[f"{field}{i}"] for field in "VWF" for i in (1, 2, 3))
        TORQUE1, TORQUE2, TORQUE3, E1, E2, E3 = (table[k] for k in "TORQUE1 TORQUE2 TORQUE3 SCALE IMPULSE CORRECTION".split())
        INERTIA, AREA, STRETCH = table["BEND_INERTIA"], table["AREA"], table["STRETCH"]

        @kernel
        def on_elements(b: Any, first: Any, last: Any, rate: Any) -> None:
            for k in range(first, last):
                q = k + step
                # Mass from the rotary inertia m A / (4 pi) of a full section.
                weight = rate * b[STRETCH + k] * b[INERTIA + k] * 4 * np.pi / (b[AREA + k] + 1e-300)
                half, turn = 0.25 * weight, weight * SPIN_ARM * SPIN_ARM
                b[E1 + k] = half * (b[V1 + k] + b[V1 + q])
                b[E2 + k] = half * (b[V2 + k] + b[V2 + q])
                b[E3 + k] = half * (b[V3 + k] + b[V3 + q])
                b[TORQUE1 + k] -= turn * b[W1 + k]
                b[TORQUE2 + k] -= turn * b[W2 + k]
                b[TORQUE3 + k] -= turn * b[W3 + k]

        @kernel
        def on_nodes(b: Any, first: Any, last: Any) -> None:
            for k in range(first, last):
                p = k - step
                b[F1 + k] -= b[E1 + k] + b[E1 + p]
                b[F2 + k] -= b[E2 + k] + b[E2 + p]
                b[F3 + k] -= b[E3 + k] + b[E3 + p]

        return on_elements, on_nodes

    open_elements, open_nodes = braking(o, ONE)
    ring_elements, ring_nodes = braking(g, np.uint64(lanes))
    ring_rows = tuple(g[k] for k in ("SCALE", "IMPULSE", "CORRECTION"))
    helix, helix_end = np.uint64(grid.straight_rods * lanes), np.uint64(grid.open_slots * lanes - 1)
    L, ring_end, seam = np.uint64(lanes), np.uint64((grid.ring_nodes + 1) * lanes), np.uint64(grid.ring_nodes * lanes)

    @kernel
    def brake(b: Any, oblique_rate: Any, ring_rate: Any) -> None:
        open_elements(b, helix, helix_end, oblique_rate)
        open_nodes(b, helix + ONE, helix_end)
        ring_elements(b, L, ring_end, ring_rate)
        for row in ring_rows:
            for i in range(L):
                b[row + i] = b[row + seam + i]
        ring_nodes(b, L, ring_end)

    return brake
