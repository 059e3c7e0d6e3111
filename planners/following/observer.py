"""What a controller sees of the arm: strains of the reduced model and topology, fitted to what the plant shows."""

import numpy as np

from octoctrl.sim.topology.measures import present

from ..contracts import Floats, Observation
from ..model.kinematics import StrainFit
from ..model.reduced import ReducedModel


class Observer:
    """Turns observations into section strains and topology.

    Parameters
    ----------
    model : ReducedModel
    pole : (3,) array_like
        From which lifted writhe is measured.
    """

    def __init__(self, model: ReducedModel, pole: tuple[float, float, float]) -> None:
        self._model, self._pole = model, pole
        self._fit: StrainFit | None = None

    def see(self, observation: Observation) -> tuple[Floats, Floats]:
        """Strains (S, 4), and twist and lifted writhe (2,) in turns, writhe modulo 2, of an `observation`."""
        if self._fit is None:
            self._fit = self._model.strain_fit(observation.stations)
        strains = self._fit(observation.frames, observation.stretch)
        return strains, np.array(present(observation.points, observation.frames, self._pole))
