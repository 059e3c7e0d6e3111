"""What a run leaves behind: centreline, frames, stretch and activation over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OctoctrlError
from ..records import Record, check_shapes
from ..scene.mesh import Mesh

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Recording(Record):
    """Recorded motion of a plant, T instants, n elements.

    Attributes
    ----------
    time : (T,) float64, s
    points : (T, n + 1, 3) float64, m
        Node positions, base first.
    frames : (T, n + 2, 3, 3) float64
        Directors (rows d1, d2, d3) at `stations`: base, element centres, tip.
    stations : (n + 2,) float64, m
        Rest arclength of the frames.
    stretch : (T, n) float64
        Length over rest length of each element.
    levels : (T, 11, n) float64
        Activation in force, by group of `octoctrl.sim.body.arm.MUSCLE_GROUPS` and element.
    series : dict of str to (T, ...) float64
        What else the plant keeps, by name; `octoctrl.sim.contracts.Core.series` of each plant says what that is.
    meshes : dict of str to Mesh
        Objects whose shape their sizes do not tell, by name.
    finer : int
        How many samples were done at a part of the step, because they would have stopped at the whole.
    complete : bool
        False when the run was cut short; `note` says by what.
    note : str
    """

    time: Floats
    points: Floats
    frames: Floats
    stations: Floats
    stretch: Floats
    levels: Floats
    series: dict[str, Floats] = field(default_factory=dict)
    meshes: dict[str, Mesh] = field(default_factory=dict)
    finer: int = 0
    complete: bool = True
    note: str = ""

    def __post_init__(self) -> None:
        axes: dict[str, tuple[int | str, ...]] = {
            "time": ("instants",), "points": ("instants", "nodes", 3), "frames": ("instants", "stations", 3, 3), "stations": ("stations",),
            "stretch": ("instants", "elements"), "levels": ("instants", "groups", "elements"),
        }  # fmt: skip
        lengths = check_shapes("recording", {name: (getattr(self, name), shape) for name, shape in axes.items()})
        if not lengths["stations"] - 2 == lengths["nodes"] - 1 == lengths["elements"]:
            counts = ", ".join(f"{lengths[axis]} {axis}" for axis in ("nodes", "stations", "elements"))
            raise OctoctrlError(f"recording: {counts} do not belong together; n elements have n + 1 nodes and n + 2 stations")
        for name, values in self.series.items():
            if np.ndim(values) < 1 or len(values) != lengths["instants"]:
                raise OctoctrlError(f"recording: series '{name}' has shape {np.shape(values)}, time has {lengths['instants']} instants")

    @classmethod
    def joined(cls, pieces: Sequence["Recording"]) -> "Recording":
        """One recording of consecutive `pieces`; an instant at which one ends and the next begins is kept once."""
        skips = [0] + [
            int(bool(len(before.time)) and bool(len(piece.time)) and piece.time[0] <= before.time[-1] + 1e-12)
            for before, piece in pairwise(pieces)
        ]
        fields: dict[str, Any] = {
            name: np.concatenate([getattr(piece, name)[skip:] for piece, skip in zip(pieces, skips, strict=True)])
            for name in ("time", "points", "frames", "stretch", "levels")
        }
        kept = [name for name in pieces[0].series if all(name in piece.series for piece in pieces)]
        series = {name: np.concatenate([piece.series[name][skip:] for piece, skip in zip(pieces, skips, strict=True)]) for name in kept}
        return replace(pieces[0], **fields, series=series, finer=sum(piece.finer for piece in pieces))

    def until(self, time: float) -> "Recording":
        """The recording up to `time` (s), included."""
        kept = int(np.searchsorted(self.time, time + 1e-9))
        cut = {name: getattr(self, name)[:kept] for name in ("time", "points", "frames", "stretch", "levels")}
        return replace(self, **cut, series={name: values[:kept] for name, values in self.series.items()})

    @property
    def length(self) -> Floats:
        """Arm length, m, (T,)."""
        found: Floats = np.linalg.norm(np.diff(self.points, axis=1), axis=2).sum(axis=1)
        return found

    @property
    def tip(self) -> Floats:
        """Tip position, m, (T, 3)."""
        return self.points[:, -1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class StrandMotion(Record):
    """Where the rods of which an arm consists were, at R instants: as many nodes of each as a picture needs.

    Attributes
    ----------
    time : (R,) float64, s
    points : dict of str to (R, rods, nodes, 3) float32, m
        By family; a closed rod ends at the node where it begins.
    radius : dict of str to (rods, nodes) float32, m
        At rest.
    """

    time: Floats
    points: dict[str, NDArray[np.float32]]
    radius: dict[str, NDArray[np.float32]]

    @classmethod
    def joined(cls, pieces: Sequence["StrandMotion"]) -> "StrandMotion | None":
        """One motion of consecutive `pieces`; None of none."""
        if not pieces:
            return None
        points = {name: np.concatenate([piece.points[name] for piece in pieces]) for name in pieces[0].points}
        return replace(pieces[0], time=np.concatenate([piece.time for piece in pieces]), points=points)

    def at(self, time: Floats) -> dict[str, Floats]:
        """Places (T, rods, nodes, 3), m, by family at `time` (T,), s: linear in between, held beyond the ends."""
        place = np.interp(time, self.time, np.arange(len(self.time)))
        left = np.floor(place).astype(int)
        right, share = np.minimum(left + 1, len(self.time) - 1), (place - left)[:, None, None, None]
        return {family: (1 - share) * points[left] + share * points[right] for family, points in self.points.items()}
