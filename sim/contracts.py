"""What the parts of the physical world ask of each other: protocols that an object of one's own may fulfil."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class ActivationSource(Protocol):
    """What moves a plant: an `octoctrl.sim.activation.Activation` or any object with this method."""

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, 11, n) at `times` (T,), s, in the n cells between `edges` (n + 1,), m; asked once for each partition."""
        ...
