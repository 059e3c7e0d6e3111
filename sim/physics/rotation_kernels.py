"""Rotations of material frames in compiled code, without a call of the mathematics library.

The exponential map is a series in the squared angle of one step, the logarithm one in sin^2(theta/2) = (3 - trace) / 4; a library call
would cost three times a whole step.
"""

from ..compiler import kernel

SERIES = (1.0, 2 / 3, 8 / 15, 16 / 35, 128 / 315, 256 / 693, 1024 / 3003, 2048 / 6435, 32768 / 109395, 65536 / 230945, 262144 / 969969)
"""theta / sin(theta) in powers of sin^2(theta / 2); the twelfth term is below 1e-9 up to one radian per joint."""


@kernel
def angle_over_sine(y):
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
