"""What a controller sees of the arm: strains of the reduced model fitted to what is measured, topology, and how noisy the measurement is.

Curvatures and stretches are fitted to what they add up to: the rotation from the base to each station, and the way to each node along the
frames. (Distances between neighbouring nodes would grow with noise that is across.) Twist and writhe are those of the frames: noise of a
node against its neighbour tilts the ribbon between them far more than the frames themselves.

Noise shows in what the fit leaves over: a plant's own structure between the sections changes slowly, noise from one measurement to the
next. At the beginning the arm is taken to be at rest, where nothing is left over.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from octoctrl.sim.topology.measures import present_of_frames

from ..contracts import Floats, Observation
from ..model.kinematics import hat_means, rotation_vectors
from ..model.reduced import ReducedModel

NOISE_SHARE = 0.1
"""Share of a newly measured variance of the noise that is believed."""


class Sight(NamedTuple):
    """A measurement as the regulator takes it: strains (S, 4), outputs in the order of `octoctrl.planners.model.output_kernels.OUTPUTS`
    (writhe and link modulo 2), and the covariance (4 S, 4 S) of the strains.
    """

    strains: Floats
    outputs: Floats
    noise: Floats


class Observer:
    """Turns observations into sights; made anew for each run.

    Parameters
    ----------
    model : ReducedModel
    pole : (3,) array_like
        From which lifted writhe is measured.
    """

    def __init__(self, model: ReducedModel, pole: tuple[float, float, float]) -> None:
        self._model, self._pole = model, pole
        self._left: tuple[Floats, Floats] | None = None
        self._variances = np.zeros(2)

    def see(self, observation: Observation) -> Sight:
        """The sight of an `observation`, of as many stations and nodes as it has."""
        stations, frames = np.asarray(observation.stations), observation.frames
        sums = np.cumsum(hat_means(stations, self._model.edges) * np.diff(stations)[:, None], axis=0)
        turned = np.cumsum(rotation_vectors(frames[:-1] @ np.swapaxes(frames[1:], -1, -2)), axis=0)
        curvatures = np.linalg.lstsq(sums, turned, rcond=None)[0]
        means, lengths = hat_means(observation.edges, self._model.edges), np.diff(observation.edges)
        # A bent stretch of the arm is longer than what of it lies along the frame in its middle.
        bends = np.linalg.norm(means @ curvatures[:, :2], axis=1) * lengths
        extents = np.cumsum(means * (lengths * np.sinc(bends / (2 * np.pi)))[:, None], axis=0)
        ways = np.cumsum(np.einsum("ij,ij->i", np.diff(observation.points, axis=0), frames[1:-1, 2]))
        stretches = np.linalg.lstsq(extents, ways, rcond=None)[0]
        noise = self._noise(turned - sums @ curvatures, ways - extents @ stretches)
        sections = self._model.sections
        covariance = np.zeros((sections, 4, sections, 4))
        axes = np.arange(3)
        covariance[:, axes, :, axes] = noise[0] * _spread(sums)
        covariance[:, 3, :, 3] = noise[1] * _spread(extents)
        twist, writhe = present_of_frames(frames, self._pole)
        tangent = frames[-1, 2]
        outputs = np.array([twist, writhe, twist + writhe, ways[-1], *observation.points[-1], *tangent, 1 + tangent @ frames[0, 2]])
        return Sight(np.column_stack([curvatures, stretches]), outputs, covariance.reshape(4 * sections, 4 * sections))

    def state(self) -> dict[str, Any]:
        """What the last fits left over, and the variances."""
        return {"left": self._left, "variances": self._variances.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of an observer with the same model and pole."""
        self._left, self._variances = state["left"], state["variances"].copy()

    def _noise(self, turns: Floats, ways: Floats) -> Floats:
        """Variances of the rotations (rad^2) and places (m^2) of the stations, from what the fits leave over."""
        sections, left = self._model.sections, (turns, ways)
        # Each fit takes as many directions out of the noise as it has unknowns.
        kept = 1 - sections / len(turns), 1 - sections / len(ways)
        if self._left is None or self._left[0].shape != turns.shape:
            self._variances = np.array([np.mean(new**2) / share for new, share in zip(left, kept, strict=True)])
        else:
            found = [np.mean((new - old) ** 2) / (2 * share) for new, old, share in zip(left, self._left, kept, strict=True)]
            if any(found):  # else it is the same measurement once more
                self._variances += NOISE_SHARE * (found - self._variances)
        self._left = left
        return self._variances


def _spread(sums: Floats) -> Floats:
    """Covariance of what is fitted to running sums from the base, whose own noise is in all of them, by the variance of one place."""
    inverse = np.asarray(np.linalg.inv(sums.T @ sums), dtype=np.float64)
    base = inverse @ sums.sum(axis=0)
    return inverse + np.outer(base, base)
