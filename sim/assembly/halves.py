"""The two halves of an arm, each in memory of its own, and what they tell each other.

Were both in one buffer, side by side in every row, each core would keep fetching the ends of rows that the other has just written, and half
of what it fetches ahead: two threads would be no faster than one. So either has a buffer of its own, with a border: the first cross-section
of the other. Of the border only those rows are true that a stage of the step exchanges, and those that follow from them by what is done
lane by lane, such as positions from velocities; everything else in it is not read.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..body.grid import AssemblyGrid
from .buffer import AssemblyBuffer, aligned, buffer_in
from .crossing_kernels import crossing_offsets
from .family_kernels import family_offsets
from .geometry import AssemblyGeometry
from .layout import SINGLE_STATE_ROWS, AssemblyRow
from .meeting_kernels import crews
from .parts import family_slots, halves, whole
from .pressure_kernels import buffer_size, slab_offsets
from .spoke_kernels import spoke_offsets

Integers = NDArray[np.int64]


class Stage(IntEnum):
    """When the halves of an arm exchange something; see `octoctrl.sim.assembly.terms`."""

    FORCES, VELOCITIES, AXIAL, OUTWARD, SPEEDS, PROJECT, RINGS, MUSCLES, MOTION = range(9)


class Reads(NamedTuple):
    """Names of rows that a stage reads in the neighbouring cross-section, by family."""

    straight: str = ""
    helices: str = ""
    spokes: str = ""
    crossings: str = ""
    slabs: str = ""


PUSHING, PULLING = "N1 N2 N3 MPLUS1 MPLUS2 MPLUS3", "V1 V2 V3 T1 T2 T3"
SYSTEM, MOVING = "SCALE RATE CORRECTION", "V1 V2 V3 W1 W2 W3"
READS = {
    Stage.FORCES: Reads(
        straight="STRETCH SCALE IMPULSE CORRECTION",
        helices="STRETCH",
        spokes="S1 S2 S3 H1 H2 H3 ACROSS",
        crossings="FP1 FP2 FP3 FH1 FH2 FH3 FN1 FN2 FN3 P_PUSH N_PUSH",
    ),
    Stage.VELOCITIES: Reads(PUSHING, PUSHING),
    Stage.AXIAL: Reads(PULLING, PULLING),
    Stage.OUTWARD: Reads(SYSTEM, SYSTEM),
    Stage.SPEEDS: Reads("IMPULSE", "IMPULSE"),
    Stage.PROJECT: Reads(straight="V1 V2 V3", slabs="A1 A2 A3"),
    Stage.RINGS: Reads(slabs="SCALE RATE COUPLING"),
    Stage.MUSCLES: Reads(slabs="IMPULSE"),
    Stage.MOTION: Reads(MOVING, MOVING),
}


def _places(grid: AssemblyGrid, reads: Reads, lane: int) -> Iterator[Integers]:
    """Places in a buffer of what is read in the cross-section of a `lane`."""
    rods, slots = family_offsets(grid, False), family_slots(grid)
    families = (
        (reads.straight, rods, slots["straight"]),
        (reads.helices, rods, slots["helices"]),
        (reads.spokes, spoke_offsets(grid), slots["spokes"]),
        (reads.crossings, crossing_offsets(grid), (0, grid.helices, 1)),
        (reads.slabs, slab_offsets(grid), (0, 1, 1)),
    )
    for names, offsets, (first, count, wide) in families:
        base = np.arange(first, first + count, wide)[:, None] * grid.lanes + wide * lane + np.arange(wide)
        for name in names.split():
            yield int(offsets[name]) + base.ravel()


def _border(grid: AssemblyGrid, middle: int) -> tuple[Integers, Integers, Integers]:
    """What either half sends and takes: places in its buffer (2, n), and where those of each stage begin (stages + 1,)."""

    def places(lane: int) -> list[Integers]:
        return [np.concatenate(list(_places(grid, READS[stage], lane))) for stage in Stage]

    bounds = np.cumsum([0, *map(len, places(0))])
    last, beside, border, first = (np.concatenate(places(lane)) for lane in (middle - 1, middle, 0, 1))
    return np.stack([last, first]), np.stack([beside, border]), bounds


RODS = 3
"""Families with a state: straight rods, helices, rings."""


class OneMemory:
    """The buffer of an arm as one thread works on it.

    Attributes
    ----------
    grid : AssemblyGrid
        That the kernels are compiled for.
    workers : tuple
        Of each thread: the memory it works on, the tables of indices there, and its `Crew`.
    """

    def __init__(self, rods: AssemblyBuffer) -> None:
        self.grid, self._rods = rods.grid, rods
        (crew,) = crews((whole(rods.grid),), rods.flat.dtype)
        self.workers = ((rods.flat, (rods.ring_index, rods.helix_index), crew),)

    def __reduce__(self) -> tuple[Any, ...]:
        """Made anew, for the arm's buffer is where it is copied to."""
        return type(self), (self._rods,)

    def renew(self) -> None:
        """Take up what has changed in the arm beside its state."""

    @contextmanager
    def lent(self) -> Iterator[None]:
        """What is done within is done to the arm."""
        yield

    def points(self, points: Any) -> Any:
        """Points of the arm with their places in the first worker's memory."""
        return points

    def where(self, family: int, place: int, part: int) -> int:
        """Index in a row of the arm's buffer of what stands at a `place` of a part's: of an open rod (family 0) or a ring."""
        return place


class Halves:
    """Buffers of both halves of an arm, for two threads; as `OneMemory`.

    Parameters
    ----------
    rods : AssemblyBuffer
        Of the whole arm.
    geometry : AssemblyGeometry
    """

    def __init__(self, rods: AssemblyBuffer, geometry: AssemblyGeometry) -> None:
        self.grid, self._rods, self._geometry, parts = rods.grid.half, rods, geometry, halves(rods.grid)
        self._size = buffer_size(self.grid)
        flat = aligned(2 * self._size, rods.flat.dtype)
        # The first reaches into the second, where one thread does something for both.
        memories = flat, flat[self._size :]
        self._before = np.array([int(part.before) for part in parts])
        self.buffers = [buffer_in(memory, self.grid, geometry, int(before)) for memory, before in zip(memories, self._before, strict=True)]
        self._crews = crews(parts, flat.dtype, _border(self.grid, rods.grid.middle))
        self.workers = tuple(
            (memory, (own.ring_index, own.helix_index), crew) for memory, own, crew in zip(memories, self.buffers, self._crews, strict=True)
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Made anew, for the arm's buffer is where it is copied to."""
        return type(self), (self._rods, self._geometry)

    def renew(self) -> None:
        """Take up all of the arm: its parameters, and scratch without what a step that went wrong may have left there."""
        for whole_arm, half, _ in self._shared():
            count = min(whole_arm.shape[-1], half.shape[-1])
            half[..., :count] = whole_arm[..., :count]
        for buffer, crew in zip(self.buffers, self._crews, strict=True):
            _keep_still(buffer, int(crew.part.start), int(crew.part.stop))

    @contextmanager
    def lent(self) -> Iterator[None]:
        """What is done within to the halves is done to the arm; they begin with its state."""
        for whole_arm, half, _ in self._shared(state=True):
            count = min(whole_arm.shape[-1], half.shape[-1])
            half[:SINGLE_STATE_ROWS, :, :count] = whole_arm[:SINGLE_STATE_ROWS, :, :count]
        yield
        for whole_arm, half, own in self._shared():
            whole_arm[..., own] = half[..., own]

    def _shared(self, state: bool = False) -> Iterator[tuple[Any, Any, slice]]:
        """By family: arrays (rows, slots, lanes) of the arm, from a half's first lane on, and of the half, and the lanes of its own."""
        for buffer, crew in zip(self.buffers, self._crews, strict=True):
            part = crew.part
            pairs = list(zip(_families(self._rods), _families(buffer), strict=True))
            for (whole_arm, wide), (half, _) in pairs[:RODS] if state else pairs:
                yield whole_arm[..., wide * int(part.before) :], half, slice(wide * int(part.start), wide * int(part.stop))

    def points(self, points: Any) -> Any:
        """Points of the arm with their places in the first worker's memory."""
        grid, place = self._rods.grid, np.asarray(points.place, dtype=np.int64)
        first = grid.straight_rods
        slot, lane = np.divmod(place, grid.lanes)
        helix, late = np.divmod(slot - first, grid.helix_nodes)
        # A helix has as many slots, one after the other, as it has nodes from ring to ring.
        wide = np.where(slot < first, 1, grid.helix_nodes)
        start, along = np.where(slot < first, slot, first + grid.helix_nodes * helix), np.where(slot < first, 0, late) * grid.lanes + lane
        half = (along >= wide * grid.middle).astype(int)
        there = start * self.grid.lanes + along - wide * self._before[half]
        return points._replace(place=(there + half * self._size).astype(np.uint64))

    def where(self, family: int, place: int, part: int) -> int:
        """Index in a row of the arm's buffer of what stands at a `place` of a part's: of an open rod (family 0) or a ring."""
        slot, lane = divmod(place, self.grid.lanes)
        late = (slot - self.grid.straight_rods) % self.grid.helix_nodes if family == 0 and slot >= self.grid.straight_rods else 0
        wide = self.grid.helix_nodes if family == 0 and slot >= self.grid.straight_rods else 1
        return (slot - late) * self._rods.grid.lanes + late * self.grid.lanes + lane + wide * int(self._before[part])


def _keep_still(buffer: AssemblyBuffer, start: int, stop: int) -> None:
    """Take what is neither a half's own nor an open rod of its border its mobility: by itself it would run away and end not as a number."""
    moves = slice(AssemblyRow.NODE_DECAY, AssemblyRow.TWIST_MOBILITY + 1)
    (straight, _), (helices, wide), (rings, _), *_ = _families(buffer)
    straight[moves, :, stop + 1 :] = helices[moves, :, wide * (stop + 1) :] = 0.0
    rings[moves, :, :start] = rings[moves, :, stop:] = 0.0


def _families(buffer: AssemblyBuffer) -> Iterator[tuple[Any, int]]:
    """Each family of rows as an array (rows, slots, lanes), and its lanes per cross-section."""
    grid = buffer.grid
    lanes, straight, wide = grid.lanes, grid.straight_rods, grid.helix_nodes
    rows = (
        (buffer.open_rods[:, : straight * lanes], 1),
        (buffer.open_rods[:, straight * lanes : grid.open_slots * lanes], wide),
        (buffer.rings[:, : grid.ring_slots * lanes], 1),
        (buffer.spokes[:, : grid.spoke_slots * lanes], 1),
        (buffer.crossings[:, : grid.helices * lanes], 1),
        (buffer.slabs[:, :lanes], 1),
    )
    for array, width in rows:
        yield array.reshape(len(array), -1, width * lanes), width
