"""What can be seen of an arm at one instant: place and motion of its axis and of its frames."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..body.arm import REST_FRAME
from ..contracts import Floats
from ..records import Record
from ..topology.trace import unit_pole


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Observation(Record):
    """What a controller may see at one instant, n elements.

    Attributes
    ----------
    time : float, s
    points : (n + 1, 3) float64, m
        Nodes, base first.
    frames : (n + 2, 3, 3) float64
        Directors (rows d1, d2, d3) at `stations`.
    stations : (n + 2,) float64, m
        Rest arclength of the frames: base, element centres, tip.
    edges : (n + 1,) float64, m
        Rest arclength of the nodes, which bound the cells of levels.
    stretch : (n,) float64
    velocities : (n + 1, 3) float64, m/s
        Of the nodes, in the lab frame.
    spins : (n, 3) float64, rad/s
        Angular velocities of the elements about their own directors.
    """

    time: float
    points: Floats
    frames: Floats
    stations: Floats
    edges: Floats
    stretch: Floats
    velocities: Floats
    spins: Floats

    @property
    def tip(self) -> tuple[Floats, Floats]:
        """Pose of the tip: position (3,), m, and frame (3, 3) with rows d1, d2, d3."""
        return self.points[-1], self.frames[-1]

    @property
    def strains(self) -> Floats:
        """Strains (n, 4) of the elements: curvature about d1 and d2 and twist (1/m, in material components), and stretch.

        Curvatures are the rotation from the station before to the station behind an element's centre, over the rest length between.
        """
        from ..topology.topology_kernels import frame_rotations  # loads numba

        turns = np.empty((1, len(self.frames) - 1, 3))
        frame_rotations(self.frames[None], turns)
        found = np.empty((len(self.stretch), 4))
        found[:, :3] = (turns[0, 1:] + turns[0, :-1]) / (self.stations[2:] - self.stations[:-2])[:, None]
        found[:, 3] = self.stretch
        return found

    def topology(self, pole: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> tuple[float, float, float]:
        """Lifted link, lifted writhe and twist of the arm now, in turns; link and writhe modulo 2.

        Parameters
        ----------
        pole : (float, float, float)
            Direction from which crossings are lifted, see docs/topology.md.

        Returns
        -------
        (float, float, float)
        """
        from ..topology.topology_kernels import present  # loads numba

        twist, writhe = present(self.points, self.frames, _direction(tuple(pole)))
        return twist + writhe, writhe, twist


@lru_cache
def _direction(pole: tuple[float, ...]) -> Floats:
    return np.array(unit_pole(pole))


def with_ends(frames: Floats, edges: Floats) -> Floats:
    """Frames (..., n, 3, 3) of elements with those of base and tip, the latter turned on by half an element of the last curvature."""
    from .observation_kernels import turn_on  # loads numba

    far, near = edges[-1] - edges[-2], edges[-2] - edges[-3]
    whole = np.empty((*frames.shape[:-3], frames.shape[-3] + 2, 3, 3))
    whole[..., 0, :, :], whole[..., 1:-1, :, :] = REST_FRAME, frames
    turn_on(whole.reshape(-1, *whole.shape[-3:]), far / (far + near))
    return whole
