"""Rotations of material frames in compiled code, without a call of the mathematics library.

The exponential map is a series in the squared angle of one step, the logarithm one in sin^2(theta/2) = (3 - trace) / 4; a library call
would cost three times a whole step.
"""

from ..compiler import kernel

SERIES = (1.0, 2 / 3, 8 / 15, 16 / 35, 128 / 315, 256 / 693, 1024 / 3003, 2048 / 6435, 32768 / 109395, 65536 / 230945, 262144 / 969969)
"""theta / sin(theta) in powers of sin^2(theta / 2); the twelfth term is below 1e-9 up to one radian per joint."""


@kernel
def angle_over_sine(y: float) -> float:
    """Ratio theta / sin(theta) for y = sin^2(theta / 2)."""
    total = SERIES[10]
    total = total * y + SERIES[9]
    total = total * y + SERIES[8]
    total = total * y + SERIES[7]
    total = total * y + SERIES[6]
    total = total * y + SERIES[5]
    total = total * y + SERIES[4]
    total = total * y + SERIES[3]
    total = total * y + SERIES[2]
    total = total * y + SERIES[1]
    return total * y + SERIES[0]


@kernel
def entries(
    u1: float, u2: float, u3: float, sine: float, cosine: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Nine entries, row by row, of 1 - sine [u] + cosine (u u^T - u.u)."""
    r11, r22, r33 = 1.0 - cosine * (u2 * u2 + u3 * u3), 1.0 - cosine * (u1 * u1 + u3 * u3), 1.0 - cosine * (u1 * u1 + u2 * u2)
    c12, c13, c23 = cosine * u1 * u2, cosine * u1 * u3, cosine * u2 * u3
    s1, s2, s3 = sine * u1, sine * u2, sine * u3
    return r11, c12 + s3, c13 - s2, c12 - s3, r22, c23 + s1, c13 + s2, c23 - s1, r33


@kernel
def rotation(u1: float, u2: float, u3: float) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Nine entries, row by row, of exp(-[u]), to 1e-10 up to one radian."""
    square = u1 * u1 + u2 * u2 + u3 * u3
    sine = 1 - square * (1 / 6 - square * (1 / 120 - square * (1 / 5040 - square * (1 / 362880 - square * (1 / 39916800)))))
    cosine = 0.5 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320 - square * (1 / 3628800 - square * (1 / 479001600)))))
    return entries(u1, u2, u3, sine, cosine)


@kernel
def small_rotation(u1: float, u2: float, u3: float) -> tuple[float, float, float, float, float, float, float, float, float]:
    """The same with fewer terms, to 1e-10 up to a tenth of a radian, for steps that are short against all turning."""
    square = u1 * u1 + u2 * u2 + u3 * u3
    sine = 1.0 - square * (1 / 6 - square * (1 / 120 - square * (1 / 5040)))
    cosine = 0.5 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320)))
    return entries(u1, u2, u3, sine, cosine)


@kernel
def turned(r: tuple[float, ...], a: float, d: float, g: float) -> tuple[float, float, float]:
    """Product of a rotation's nine entries with a column (a, d, g)."""
    return r[0] * a + r[1] * d + r[2] * g, r[3] * a + r[4] * d + r[5] * g, r[6] * a + r[7] * d + r[8] * g


@kernel
def orthonormal(
    a1: float, a2: float, a3: float, c1: float, c2: float, c3: float, d1: float, d2: float, d3: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Rows of the orthonormal frame nearest to one that almost is.

    One Newton step of the polar decomposition (Higham 1986, SIAM J. Sci. Stat. Comput. 7:1160): Q <- (3 I - Q Q^T) Q / 2. Turned by less
    than 1e-8 rad in a step, a frame loses what falls below the last digit of its numbers, always on the same side: after some 1e5 steps
    that is seen, and no more accurate series could help.
    """
    aa, cc, dd = a1 * a1 + a2 * a2 + a3 * a3 - 1.0, c1 * c1 + c2 * c2 + c3 * c3 - 1.0, d1 * d1 + d2 * d2 + d3 * d3 - 1.0
    ac, ad, cd = a1 * c1 + a2 * c2 + a3 * c3, a1 * d1 + a2 * d2 + a3 * d3, c1 * d1 + c2 * d2 + c3 * d3
    return (
        a1 - 0.5 * (aa * a1 + ac * c1 + ad * d1),
        a2 - 0.5 * (aa * a2 + ac * c2 + ad * d2),
        a3 - 0.5 * (aa * a3 + ac * c3 + ad * d3),
        c1 - 0.5 * (ac * a1 + cc * c1 + cd * d1),
        c2 - 0.5 * (ac * a2 + cc * c2 + cd * d2),
        c3 - 0.5 * (ac * a3 + cc * c3 + cd * d3),
        d1 - 0.5 * (ad * a1 + cd * c1 + dd * d1),
        d2 - 0.5 * (ad * a2 + cd * c2 + dd * d2),
        d3 - 0.5 * (ad * a3 + cd * c3 + dd * d3),
    )


@kernel
def joint_curvature(
    a11: float,
    a12: float,
    a13: float,
    a21: float,
    a22: float,
    a23: float,
    a31: float,
    a32: float,
    a33: float,
    c11: float,
    c12: float,
    c13: float,
    c21: float,
    c22: float,
    c23: float,
    c31: float,
    c32: float,
    c33: float,
    inverse: float,
) -> tuple[float, float, float]:
    """Rotation vector from a frame to the next, log(C A^T), times the `inverse` of their distance."""
    trace = c11 * a11 + c12 * a12 + c13 * a13 + c21 * a21 + c22 * a22 + c23 * a23 + c31 * a31 + c32 * a32 + c33 * a33
    factor = 0.5 * angle_over_sine(0.25 * (3.0 - trace)) * inverse
    return (
        factor * (c21 * a31 + c22 * a32 + c23 * a33 - c31 * a21 - c32 * a22 - c33 * a23),
        factor * (c31 * a11 + c32 * a12 + c33 * a13 - c11 * a31 - c12 * a32 - c13 * a33),
        factor * (c11 * a21 + c12 * a22 + c13 * a23 - c21 * a11 - c22 * a12 - c23 * a13),
    )  # fmt: skip
