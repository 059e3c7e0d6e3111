"""The rods of the full arm as layers of a page, one for each family of muscles."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.running.recording import StrandMotion

Floats = NDArray[np.float64]

LOOKS = {
    "longitudinal": ((0.72, 0.30, 0.27), 8, 2),
    "nerve cord": ((0.93, 0.82, 0.40), 10, 2),
    "oblique": ((0.88, 0.52, 0.10), 6, 2),
    "transverse": ((0.16, 0.52, 0.50), 5, 1),
}
"""Colour (red, green, blue), corners of a section and cuts of each stretch between nodes, by family."""
_PLAIN = ((0.55, 0.58, 0.62), 6, 2)
_FEW, _MANY_CUTS = 16, 4
"""A ring of few nodes is drawn round all the same."""


def strand_layers(motion: StrandMotion, time: Floats) -> tuple[dict[str, Floats], list[dict[str, Any]]]:
    """Arrays of places and radii (mm), and the layers that draw them.

    Parameters
    ----------
    motion : StrandMotion
    time : (F,) float64, s
        Instants of the page.

    Returns
    -------
    arrays : dict of str to (F, rods, nodes, 3) or (1, rods, nodes) float64, mm
    layers : list of dict
    """
    arrays: dict[str, Floats] = {}
    layers = []
    for family, places in motion.at(time).items():
        colour, sides, cuts = LOOKS.get(family, _PLAIN)
        arrays |= {f"{family} places": 1e3 * places, f"{family} radius": 1e3 * motion.radius[family][None].astype(np.float64)}
        layers.append(
            {
                "name": family,
                "points": f"{family} places",
                "radius": f"{family} radius",
                "colour": colour,
                "sides": sides,
                "cuts": _MANY_CUTS if places.shape[2] < _FEW else cuts,
                "visible": True,
            }
        )
    return arrays, layers
