"""A rod touching bodies: material points along it, each a ball of the rod's present radius.

Point p sits in element k at the share xi of its length. An impulse on its surface goes to the element's two nodes by (1 - xi, xi) and
turns the element by its lever from the centreline.
"""

from typing import Any

import numpy as np

from ..compiler import borrowing_kernel
from ..contact.shape_kernels import distance
from ..contact.sweep_kernels import Surface
from .layout import offsets

ONE = np.uint64(1)


def rod_surface(stride: int, constant_section: bool = False) -> Surface:
    """Compile what contact asks of a rod, for buffers of the given stride.

    Parameters
    ----------
    stride : int
    constant_section : bool
        Whether the radius stays that at rest when the rod is stretched.

    Returns
    -------
    Surface
    """
    o = offsets(stride)
    X1, X2, X3, V1, V2, V3, W1, W2, W3 = (o[f"{field}{i}"] for field in "XVW" for i in (1, 2, 3))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    MOBILITY, MOBILITY1, MOBILITY2, MOBILITY3 = (o[name] for name in ("NODE_MOBILITY", "MOBILITY1", "MOBILITY2", "MOBILITY3"))
    STRETCH, INVERSE_LENGTH = o["STRETCH"], o["INVERSE_LENGTH"]

    @borrowing_kernel
    def radius(b: Any, points: Any, p: Any, k: Any) -> Any:
        return points.radius[p] if constant_section else points.radius[p] / np.sqrt(b[STRETCH + k])

    @borrowing_kernel
    def middle(b: Any, k: Any, xi: Any) -> Any:
        q = k + ONE
        return (
            b[X1 + k] + xi * (b[X1 + q] - b[X1 + k]),
            b[X2 + k] + xi * (b[X2 + q] - b[X2 + k]),
            b[X3 + k] + xi * (b[X3 + q] - b[X3 + k]),
        )

    @borrowing_kernel
    def place(b: Any, points: Any, p: Any) -> Any:
        # Its thickness now: the stretch is that of the step before, or of another state if there was none.
        k = points.element[p]
        q = k + ONE
        x1, x2, x3 = middle(b, k, points.share[p])
        long = np.sqrt((b[X1 + q] - b[X1 + k]) ** 2 + (b[X2 + q] - b[X2 + k]) ** 2 + (b[X3 + q] - b[X3 + k]) ** 2)
        thick = points.radius[p] if constant_section else points.radius[p] / np.sqrt(long * b[INVERSE_LENGTH + k])
        return x1, x2, x3, thick, b[V1 + k] ** 2 + b[V2 + k] ** 2 + b[V3 + k] ** 2

    @borrowing_kernel
    def meet(b: Any, points: Any, p: Any, body: Any) -> Any:
        # In the middle of the overlap.
        k = points.element[p]
        x1, x2, x3 = middle(b, k, points.share[p])
        gap, n1, n2, n3 = distance(body, x1, x2, x3)
        thick = radius(b, points, p, k)
        gap -= thick
        arm = -(thick + 0.5 * gap)
        return gap, n1, n2, n3, x1 + arm * n1, x2 + arm * n2, x3 + arm * n3, arm

    @borrowing_kernel
    def velocity(b: Any, points: Any, p: Any, l1: Any, l2: Any, l3: Any) -> Any:
        k, xi = points.element[p], points.share[p]
        q = k + ONE
        a1, a2, a3 = b[W1 + k], b[W2 + k], b[W3 + k]
        w1 = b[Q11 + k] * a1 + b[Q21 + k] * a2 + b[Q31 + k] * a3
        w2 = b[Q12 + k] * a1 + b[Q22 + k] * a2 + b[Q32 + k] * a3
        w3 = b[Q13 + k] * a1 + b[Q23 + k] * a2 + b[Q33 + k] * a3
        return (
            (1 - xi) * b[V1 + k] + xi * b[V1 + q] + w2 * l3 - w3 * l2,
            (1 - xi) * b[V2 + k] + xi * b[V2 + q] + w3 * l1 - w1 * l3,
            (1 - xi) * b[V3 + k] + xi * b[V3 + q] + w1 * l2 - w2 * l1,
        )

    @borrowing_kernel
    def turning(b: Any, k: Any, rate: Any) -> Any:
        return (1.0 if constant_section else b[STRETCH + k]) * rate

    @borrowing_kernel
    def mobility(b: Any, points: Any, p: Any, arm: Any, rate: Any) -> Any:
        k, xi = points.element[p], points.share[p]
        normal = ((1 - xi) * (1 - xi) * b[MOBILITY + k] + xi * xi * b[MOBILITY + k + ONE]) * rate
        return normal, normal + arm * arm * turning(b, k, rate) * max(b[MOBILITY1 + k], b[MOBILITY2 + k], b[MOBILITY3 + k])

    @borrowing_kernel
    def push(b: Any, points: Any, p: Any, l1: Any, l2: Any, l3: Any, rate: Any, p1: Any, p2: Any, p3: Any) -> None:
        k, xi = points.element[p], points.share[p]
        q, turn = k + ONE, turning(b, k, rate)
        here, there = (1 - xi) * b[MOBILITY + k] * rate, xi * b[MOBILITY + q] * rate
        b[V1 + k] += here * p1
        b[V2 + k] += here * p2
        b[V3 + k] += here * p3
        b[V1 + q] += there * p1
        b[V2 + q] += there * p2
        b[V3 + q] += there * p3
        t1, t2, t3 = l2 * p3 - l3 * p2, l3 * p1 - l1 * p3, l1 * p2 - l2 * p1
        b[W1 + k] += turn * b[MOBILITY1 + k] * (b[Q11 + k] * t1 + b[Q12 + k] * t2 + b[Q13 + k] * t3)
        b[W2 + k] += turn * b[MOBILITY2 + k] * (b[Q21 + k] * t1 + b[Q22 + k] * t2 + b[Q23 + k] * t3)
        b[W3 + k] += turn * b[MOBILITY3 + k] * (b[Q31 + k] * t1 + b[Q32 + k] * t2 + b[Q33 + k] * t3)

    return Surface(place, meet, velocity, mobility, push)
