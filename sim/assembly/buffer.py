"""The buffer of an assembly, filled from geometry: states at rest, stiffnesses, masses, connection constants, damping for a time step."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from math import prod, tan, tau
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..body.arm import Arm
from ..body.grid import AssemblyGrid
from ..contracts import Floats
from ..physics.damping import damped
from ..rotations import rotation_vector
from ..scene.scene import Water
from .constants import (
    CONTACT_STEP,
    Stiffness,
    oblique_mass,
    ring_connections,
    ring_smoothing,
    slab_volumes,
    stiffness,
    straight_connections,
    straight_mass,
)
from .crossing_kernels import crossing_offsets
from .family_kernels import family_offsets
from .geometry import AssemblyGeometry, RodFamily
from .layout import SINGLE_STATE_ROWS, STATE_ROWS, AssemblyRow, CrossingRow, SlabRow, SpokeRow, stride_of
from .pressure_kernels import buffer_size, slab_offsets
from .spoke_kernels import spoke_offsets

SPIN_ARM = 1e-3
"""Lever (m) that turns the linear drag of rings and helices into a drag on their spin, as in the source, where one number serves both."""
INERTIA_FLOOR = 0.8
"""Rotary inertia is at least (shear + bending stiffness of the element) times (this times the step)^2: twice what stability needs."""
LEAST_SPIN_RATE = 20.0
"""Rate (1/s) of the drag on the spin of all rods in the thinnest water, and in none, since fibres are held by their tissue.

Without it, twist waves that run to the thin end of a helix spin it faster and faster, until its elements turn over within a step, and
elements of the longitudinal muscles near the tip, which no water turns, flutter to and fro ever faster where they are sheared.
"""

R = AssemblyRow


class _Place(NamedTuple):
    """Where a part of the buffer stands."""

    start: int
    shape: tuple[int, ...]


@dataclass(slots=True)
class AssemblyBuffer:
    """One flat buffer and views of its parts as rows.

    Attributes
    ----------
    grid : AssemblyGrid
    flat : (size,) float64, or float32 in single precision
    open_rods, rings, spokes, crossings, slabs : (rows, stride), as `flat`
        Views; rows are those of `AssemblyRow`, `SpokeRow`, `CrossingRow` and `SlabRow`.
    ring_index : (6, helices * lanes) uint64
    helix_index : (3, helices * lanes) uint64
    """

    grid: AssemblyGrid
    flat: np.ndarray
    open_rods: np.ndarray
    rings: np.ndarray
    spokes: np.ndarray
    crossings: np.ndarray
    slabs: np.ndarray
    ring_index: np.ndarray
    helix_index: np.ndarray

    def __getstate__(self) -> dict[str, Any]:
        """The buffer, and of its parts only where they stand in it: copied by themselves they would no longer be views."""
        content = {item.name: getattr(self, item.name) for item in fields(self)}
        start = self.flat.__array_interface__["data"][0]
        for name, part in content.items():
            if name != "flat" and isinstance(part, np.ndarray) and np.may_share_memory(part, self.flat):
                content[name] = _Place((part.__array_interface__["data"][0] - start) // part.itemsize, part.shape)
        return content

    def __setstate__(self, content: dict[str, Any]) -> None:
        """Take up what `__getstate__` gave."""
        flat = aligned(content["flat"].size, content["flat"].dtype)
        flat[:], content["flat"] = content["flat"], flat
        for name, part in content.items():
            if isinstance(part, _Place):
                part = content["flat"][part.start : part.start + prod(part.shape)].reshape(part.shape)
            setattr(self, name, part)

    def state(self) -> tuple[Floats, Floats]:
        """Copies of the state rows of open rods and rings."""
        rows = self._state_rows
        return self.open_rods[:rows].copy(), self.rings[:rows].copy()

    def restore(self, state: Sequence[Floats]) -> None:
        """Write back what `state` returned, and clear what a diverged step may have left in the scratch."""
        for rows in (self.open_rods, self.rings):
            rows[R.STRETCH :] = 0.0
            rows[R.STRETCH] = 1.0
        self.spokes[: SpokeRow.CU11], self.spokes[SpokeRow.F1 :] = 0.0, 0.0
        self.crossings[: CrossingRow.A_RADIUS], self.crossings[CrossingRow.FA1 :], self.slabs[SlabRow.A1 :] = 0.0, 0.0, 0.0
        self.open_rods[: self._state_rows], self.rings[: self._state_rows] = state

    @property
    def _state_rows(self) -> int:
        return SINGLE_STATE_ROWS if self.grid.single else STATE_ROWS

    def points(self, view: Callable[..., Floats], **nodes: bool) -> Floats:
        """Positions (..., 3) of the nodes that a `view` shows, such as `straight`, m."""
        high, low = (np.stack([view(row + i, **nodes) for i in range(3)], axis=-1) for row in (R.X1, R.LOW1))
        return high.astype(float) + low if self.grid.single else high

    def straight(self, row: int, nodes: bool = False) -> Floats:
        """View (straight rods, n) of one `row` of the straight rods, n + 1 wide for `nodes`."""
        grid = self.grid
        wide = self.open_rods[row, : grid.straight_rods * grid.lanes].reshape(grid.straight_rods, grid.lanes)
        return wide[:, 1 : grid.rings + int(nodes) + 1]

    def oblique(self, row: int, nodes: bool = False) -> Floats:
        """View (helices, n) of one `row` of the helices, n + 1 wide for `nodes`."""
        grid = self.grid
        wide = self.open_rods[row, grid.straight_rods * grid.lanes : grid.open_slots * grid.lanes].reshape(grid.helices, -1)
        return wide[:, 1 : grid.helix_elements + int(nodes) + 1]

    def ring(self, row: int) -> Floats:
        """View (N, ring nodes) of one `row` of the rings."""
        grid = self.grid
        inner = self.rings[row, grid.lanes : (grid.ring_nodes + 1) * grid.lanes].reshape(grid.ring_nodes, grid.lanes)
        return inner[:, 1 : grid.rings + 1].T

    def spoke(self, row: int) -> Floats:
        """View (spokes, N) of one `row` of the spokes."""
        grid = self.grid
        inner = self.spokes[row, grid.first_spoke * grid.lanes : (grid.first_spoke + grid.spokes) * grid.lanes]
        return inner.reshape(grid.spokes, grid.lanes)[:, 1 : grid.rings + 1]

    def straight_sum(self, row: int) -> Floats:
        """View (straight rods, N) of what the spokes' result `row` sums up to on the cord and each muscle."""
        grid = self.grid
        inner = self.spokes[row, (grid.first_spoke - 1) * grid.lanes : (grid.first_spoke + grid.spokes) * grid.lanes]
        return inner.reshape(grid.straight_rods, grid.lanes)[:, 1 : grid.rings + 1]

    def crossing(self, row: int) -> Floats:
        """View (helices, N) of one `row` of the crossings."""
        grid = self.grid
        return self.crossings[row, : grid.helices * grid.lanes].reshape(grid.helices, grid.lanes)[:, 1 : grid.rings + 1]

    def slab(self, row: int) -> Floats:
        """View (N,) of one `row` of the slabs."""
        return self.slabs[row, 1 : self.grid.rings + 1]


CACHE_LINE = 64
"""Bytes in a line of the processor's cache."""


def aligned(count: int, kind: DTypeLike) -> Floats:
    """So many zeros that begin with a cache line, which NumPy's arrays do not: every wide access would cross one."""
    kind = np.dtype(kind)
    room = np.zeros(count + CACHE_LINE // kind.itemsize, dtype=kind)
    skipped = -room.__array_interface__["data"][0] % CACHE_LINE // kind.itemsize
    return room[skipped : skipped + count]


def new_assembly(geometry: AssemblyGeometry) -> AssemblyBuffer:
    """A zeroed buffer for `geometry`, with its tables of indices."""
    grid = geometry.grid
    return buffer_in(aligned(buffer_size(grid), np.float32 if grid.single else np.float64), grid, geometry)


def buffer_in(flat: np.ndarray, grid: AssemblyGrid, geometry: AssemblyGeometry, before: int = 0) -> AssemblyBuffer:
    """The buffer of the cross-sections of `geometry` that a `grid` has room for, without so many `before` them, at the begin of `flat`."""
    lanes, count = grid.lanes, geometry.grid.rings
    first, last = max(1, before), min(count, before + lanes - 1)
    inside, lane = slice(first - before, last + 1 - before), np.arange(first, last + 1) - before

    def view(start: Any, rows: type[IntEnum], slots: int) -> Floats:
        stride = stride_of(slots, lanes)
        return flat[int(start) : int(start) + len(rows) * stride].reshape(len(rows), stride)

    opposite = grid.ring_nodes // 2
    # Places on the ring and on the helix, as the kernels name them.
    around, along = ((0, 1, opposite, opposite + 1), (0,)) if grid.between else ((-2, -1, 0, 1, 2, opposite), (1, 0, -1))
    ring_index = np.zeros((len(around), grid.helices, lanes), dtype=np.uint64)
    helix_index = np.zeros((len(along), grid.helices, lanes), dtype=np.uint64)
    for place, away in enumerate(around):
        node = (_node_before(geometry)[:, first - 1 : last] + away) % grid.ring_nodes
        ring_index[place, :, inside] = (node + 1) * lanes + lane
    for j in range(grid.helices):
        side, start = 1 if j < grid.helices // 2 else -1, (grid.straight_rods + grid.helix_nodes * j) * lanes
        for place, away in enumerate(along):
            helix_index[place, j, inside] = start + grid.helix_nodes * (lane - 1) + 1 + side * away
    buffer = AssemblyBuffer(
        grid=grid,
        flat=flat,
        open_rods=view(family_offsets(grid, False)["X1"], R, grid.open_slots),
        rings=view(family_offsets(grid, True)["X1"], R, grid.ring_slots),
        spokes=view(spoke_offsets(grid)["S1"], SpokeRow, grid.spoke_slots),
        crossings=view(crossing_offsets(grid)["A1"], CrossingRow, grid.helices),
        slabs=view(slab_offsets(grid)["REST"], SlabRow, 1),
        ring_index=ring_index.reshape(len(around), -1),
        helix_index=helix_index.reshape(len(along), -1),
    )
    return buffer


def _node_before(geometry: AssemblyGeometry) -> NDArray[np.int64]:
    """Ring node at which helix j meets ring i, or the last one before, (helices, N) int."""
    return np.floor(geometry.oblique_nodes + 1e-9).astype(int)


def set_rest(buffer: AssemblyBuffer, geometry: AssemblyGeometry) -> None:
    """Put all rods to rest in their initial places; ghosts go on along the end edges."""
    grid, lanes = buffer.grid, buffer.grid.lanes
    buffer.open_rods[:SINGLE_STATE_ROWS], buffer.rings[:SINGLE_STATE_ROWS] = 0.0, 0.0
    for family, start, wide in ((geometry.straight, 0, 1), (geometry.oblique, grid.straight_rods, grid.helix_nodes)):
        for rod in range(len(family.points)):
            slot = slice((start + wide * rod) * lanes, (start + wide * (rod + 1)) * lanes)
            points, frames = family.points[rod], family.frames[rod]
            after = wide * lanes - len(points) - 1
            tail = points[-1] + np.arange(1, after + 1)[:, None] * (points[-1] - points[-2])
            placed = np.concatenate([[2 * points[0] - points[1]], points, tail]).T
            buffer.open_rods[R.X1 : R.X3 + 1, slot] = placed
            buffer.open_rods[R.LOW1 : R.LOW3 + 1, slot] = placed - buffer.open_rods[R.X1 : R.X3 + 1, slot]
            padded = np.concatenate([frames[:1], frames, np.repeat(frames[-1:], wide * lanes - len(frames) - 1, axis=0)])
            buffer.open_rods[R.Q11 : R.Q33 + 1, slot] = padded.reshape(-1, 9).T
    buffer.open_rods[R.Q11 : R.Q33 + 1, grid.open_slots * lanes :] = np.eye(3).reshape(9, 1)
    for axis, values in enumerate(np.moveaxis(geometry.rings.points, -1, 0)):
        _set_ring(buffer, R.X1 + axis, values)
        _set_ring(buffer, R.LOW1 + axis, values - buffer.ring(R.X1 + axis))
    frames = geometry.rings.frames.reshape(grid.rings, grid.ring_nodes, 9)
    for row, values in zip(range(R.Q11, R.Q33 + 1), np.moveaxis(frames, -1, 0), strict=True):
        _set_ring(buffer, row, values)


def _set_ring(buffer: AssemblyBuffer, row: int, values: Floats, ghost: float | None = None) -> None:
    """Write values (N, ring nodes) into a row of the rings, with copies in the ghost lanes (or `ghost`) and the seam's slots."""
    grid = buffer.grid
    padded = np.empty((grid.ring_slots, grid.lanes))
    inside = np.broadcast_to(values, (grid.rings, grid.ring_nodes)).T
    padded[1:-1, 1 : grid.rings + 1] = inside
    padded[1:-1, 0] = inside[:, 0] if ghost is None else ghost
    padded[1:-1, grid.rings + 1 :] = inside[:, -1:] if ghost is None else ghost
    padded[0], padded[-1] = padded[-2], padded[1]
    buffer.rings[row, : padded.size] = padded.ravel()


def set_filter_masks(buffer: AssemblyBuffer) -> None:
    """Mark the inner nodes (row VISCOSITY) and inner elements (row RATE) of the open rods for the published velocity filter."""
    for view in (buffer.straight, buffer.oblique):
        view(R.VISCOSITY, True)[:] = view(R.RATE)[:] = 0.0
        view(R.VISCOSITY, True)[:, 1:-1] = 1.0
        view(R.RATE)[:, 1:-1] = 1.0


def fill_parameters(
    buffer: AssemblyBuffer, arm: Arm, geometry: AssemblyGeometry, h: float, water: Water | None, published: bool = False
) -> None:
    """Write all parameters for time step `h` (s) in `water` (or None).

    The `published` numerics raise no inertia, soften no contact and take the linear drag elsewhere.
    """
    anatomy = arm.anatomy
    wet = (0.0, 0.0) if water is None or published else (water.factor * water.oblique_rate, water.factor * water.ring_rate)
    rates = anatomy.straight_rate, anatomy.oblique_rate + wet[0], wet[1]
    held = not anatomy.traits.sliding
    floor = 0.0 if published else h
    muscles, helices = straight_mass(arm, geometry, floor), oblique_mass(arm, geometry, floor)
    held_rods = None if held else 1
    spin_rates = rates if published else tuple(max(rate, LEAST_SPIN_RATE) for rate in rates)
    _fill_open(buffer, arm, geometry.straight, buffer.straight, h, rates[0], spin_rates[0], floor, muscles, held_rods)
    _fill_open(buffer, arm, geometry.oblique, buffer.oblique, h, rates[1], spin_rates[1], floor, helices, held_rods if held else 0)
    rows = buffer.open_rods
    ghosts = rows[R.JOINT_LENGTH] == 0
    rows[R.JOINT_LENGTH, ghosts] = 1.0
    apart = np.linalg.norm(np.diff(rows[R.X1 : R.X3 + 1], axis=1, append=1.0), axis=0)
    ghosts = rows[R.LENGTH] == 0
    rows[R.LENGTH, ghosts], rows[R.REST_RADIUS, ghosts] = apart[ghosts], 1e-3
    rows[R.STRETCH] = buffer.rings[R.STRETCH] = 1.0
    _fill_rings(buffer, arm, geometry.rings, h, rates[2], spin_rates[2], floor, 1 if held else 0)
    if anatomy.traits.graded:
        graded: Any = arm  # an arm with this trait knows them
        strength, pace = graded.ring_grades(geometry.grid.rings)
        _set_ring(buffer, R.STRENGTH, strength[:, None])
        _set_ring(buffer, R.PACE, pace[:, None])
    for family in (buffer.open_rods, buffer.rings):
        for row, length in ((R.INVERSE_LENGTH, family[R.LENGTH]), (R.INVERSE_JOINT, family[R.JOINT_LENGTH])):
            family[row] = 1 / np.where(length > 0, length, np.inf)
    _fill_connections(buffer, arm, geometry, 0.0 if published else CONTACT_STEP)
    _fill_slabs(buffer, arm, geometry, h)


def _inertia(stiff: Stiffness, family: RodFamily, h: float) -> tuple[Floats, Floats]:
    length = family.length
    bending = np.maximum(stiff.inertia, (stiff.shear * length + 4 * stiff.bend / length) * (INERTIA_FLOOR * h) ** 2)
    twisting = np.maximum(2 * stiff.inertia, 4 * stiff.twist / length * (INERTIA_FLOOR * h) ** 2)
    return bending, twisting


def _fill_open(
    buffer: AssemblyBuffer,
    arm: Arm,
    family: RodFamily,
    view: Any,
    h: float,
    rate: float,
    spin_rate: float,
    floor: float,
    mass: Floats,
    held: int | None,
) -> None:
    """The first nodes of so many rods (None: of all) are `held`, and all rods' first elements."""
    stiff, length = stiffness(arm, family), family.length
    bending, twisting = _inertia(stiff, family, floor)
    for row, values in (
        (R.LENGTH, length),
        (R.SHEAR, stiff.shear),
        (R.REST_RADIUS, family.radius),
        (R.AREA, family.area),
        (R.BEND_INERTIA, bending),
        (R.TWIST_INERTIA, twisting),
    ):
        view(row)[:] = values
    both = length[:, 1:] + length[:, :-1]
    view(R.JOINT_LENGTH)[:, 1:] = both / 2
    for row, values in ((R.BEND, stiff.bend), (R.TWIST, stiff.twist)):
        view(row)[:, 1:] = (values[:, 1:] * length[:, 1:] + values[:, :-1] * length[:, :-1]) / both
    turn = rotation_vector(family.frames[:, 1:] @ np.swapaxes(family.frames[:, :-1], -1, -2))
    for component in range(3):
        view(R.REST1 + component)[:, 1:] = turn[..., component] / (both / 2)
    decay, weight = damped(np.full(family.node_mass.shape, rate), h)
    decay[:held, 0] = weight[:held, 0] = 0.0
    view(R.NODE_DECAY, True)[:], view(R.NODE_MOBILITY, True)[:] = decay, weight / mass
    _set_spin(view, family, bending, twisting, spin_rate, h, np.s_[:, 0])


def _set_spin(view: Any, family: RodFamily, bending: Floats, twisting: Floats, rate: float, h: float, held: Any) -> None:
    for inertia, decay_row, mobility_row in ((bending, R.BEND_DECAY, R.BEND_MOBILITY), (twisting, R.TWIST_DECAY, R.TWIST_MOBILITY)):
        mass = family.element_mass
        if family.tip_mass is not None:
            mass[:, -1] += family.tip_mass
        decay, weight = damped(rate * mass * SPIN_ARM**2 / inertia, h)
        decay[held] = weight[held] = 0.0
        view(decay_row)[:], view(mobility_row)[:] = decay, weight / inertia


def _fill_rings(
    buffer: AssemblyBuffer, arm: Arm, family: RodFamily, h: float, rate: float, spin_rate: float, floor: float, held: int
) -> None:
    """The first so many rings are `held`."""
    stiff, length = stiffness(arm, family), family.length
    bending, twisting = _inertia(stiff, family, floor)
    joint = (length + np.roll(length, 1, axis=1)) / 2
    _set_ring(buffer, R.LENGTH, length)
    _set_ring(buffer, R.JOINT_LENGTH, joint)
    _set_ring(buffer, R.REST_RADIUS, family.radius)
    for row, values in (
        (R.SHEAR, stiff.shear),
        (R.AREA, family.area),
        (R.BEND_INERTIA, bending),
        (R.TWIST_INERTIA, twisting),
        (R.BEND, stiff.bend),
        (R.TWIST, stiff.twist),
    ):
        _set_ring(buffer, row, values, ghost=0.0)
    turn = rotation_vector(family.frames @ np.swapaxes(np.roll(family.frames, 1, axis=1), -1, -2)) / joint[..., None]
    for component in range(3):
        _set_ring(buffer, R.REST1 + component, turn[..., component])
    decay, weight = damped(np.full(length.shape, rate), h)
    decay[:held] = weight[:held] = 0.0
    _set_ring(buffer, R.NODE_DECAY, decay, ghost=0.0)
    _set_ring(buffer, R.NODE_MOBILITY, weight / family.node_mass, ghost=0.0)

    _set_spin(buffer.ring, family, bending, twisting, spin_rate, h, np.s_[:held])


def _fill_connections(buffer: AssemblyBuffer, arm: Arm, geometry: AssemblyGeometry, h: float) -> None:
    sides, ring = straight_connections(arm, geometry), ring_connections(arm, geometry)
    S, C, grid = SpokeRow, CrossingRow, geometry.grid
    for letter, pairs in (("C", slice(0, grid.spokes)), ("N", slice(grid.spokes, None))):
        for component in range(3):
            buffer.spoke(S[f"{letter}U1{component + 1}"])[:] = sides.direction1[pairs, :, component]
            buffer.spoke(S[f"{letter}U2{component + 1}"])[:] = sides.direction2[pairs, :, component]
        buffer.spoke(S[f"{letter}_GAP"])[:] = sides.gap[pairs]
        buffer.spoke(S[f"{letter}_SPRING"])[:] = sides.spring[pairs]
        buffer.spoke(S[f"{letter}_CONTACT"])[:] = sides.contact[pairs]
    ring_mass = geometry.rings.node_mass[:, 0]
    muscle_mass = geometry.straight.element_mass[1]
    buffer.spoke(S.R_SPRING)[:] = ring.muscle_spring
    buffer.spoke(S.R_TORQUE)[:] = ring.muscle_torque
    buffer.spoke(S.R_LEAN)[:] = geometry.spacing * tan(geometry.inclination)
    buffer.spoke(S.R_CONTACT)[:] = ring.muscle_contact
    buffer.spoke(S.R_REPULSION)[:] = ring.muscle_repulsion
    buffer.spoke(S.R_NEXT)[:, :-1] = ring.ring_spring
    buffer.spoke(S.RING_RADIUS)[:] = geometry.rings.radius[:, 0]
    buffer.spoke(S.R_EFFECTIVE)[:] = (1.5 * h * h * ring.muscle_contact * (1 / ring_mass + 1 / muscle_mass)) ** 2
    helix_mass = geometry.oblique.node_mass[:, :: grid.helix_nodes]
    buffer.crossing(C.SPRING)[:] = ring.oblique_spring
    for row in (C.CONTACT, C.P_CONTACT, C.N_CONTACT):
        buffer.crossing(row)[:] = ring.oblique_contact
    _fill_radii(buffer, geometry)
    if grid.between:
        width = tau / grid.ring_nodes
        angle = (geometry.oblique_nodes - _node_before(geometry)) * width
        buffer.crossing(C.SHARE)[:] = np.sin(angle) / (np.sin(angle) + np.sin(width - angle))
        buffer.crossing(C.ARC)[:] = np.cos(angle - width / 2) / np.cos(width / 2)
    # The first ring's lower helix neighbour, and the last ring's upper one, do not exist.
    half = grid.helices // 2
    buffer.crossing(C.N_CONTACT)[:half, 0] = buffer.crossing(C.P_CONTACT)[half:, 0] = 0.0
    buffer.crossing(C.P_CONTACT)[:half, -1] = buffer.crossing(C.N_CONTACT)[half:, -1] = 0.0
    buffer.crossing(C.EFFECTIVE)[:] = (0.75 * h * h * ring.oblique_contact * (1 / ring_mass + 1 / helix_mass)) ** 2


def _fill_radii(buffer: AssemblyBuffer, geometry: AssemblyGeometry) -> None:
    """Radii at rest of what meets at the crossings; a helix node has that of the element with its number."""
    C, grid, helix = CrossingRow, geometry.grid, geometry.oblique.radius
    for place in "ABSDE":
        buffer.crossing(C[f"{place}_RADIUS"])[:] = geometry.rings.radius[:, 0]
    helix = np.concatenate([helix, helix[:, -1:]], axis=1)
    met, half = grid.helix_nodes * np.arange(grid.rings), grid.helices // 2
    for place, away in (("P", 1), ("H", 0), ("N", -1)):
        for rods, side in ((slice(half), away), (slice(half, None), -away)):
            buffer.crossing(C[f"{place}_RADIUS"])[rods] = helix[rods][:, np.clip(met + side, 0, helix.shape[1] - 1)]


def _fill_slabs(buffer: AssemblyBuffer, arm: Arm, geometry: AssemblyGeometry, h: float) -> None:
    T, anatomy, nodes = SlabRow, arm.anatomy, geometry.grid.ring_nodes
    area = geometry.straight.area[1:]
    buffer.straight(R.SECTION)[1:] = area / area.sum(axis=0)
    rest = slab_volumes(geometry)
    buffer.slabs[T.REST] = 1.0  # of ghosts, whose pressure is none
    buffer.slab(T.REST)[:], buffer.slab(T.BULK)[:] = rest, anatomy.bulk_modulus
    buffer.slab(T.COMPLIANCE)[:] = rest / (h * anatomy.bulk_modulus)
    root = 1 + 0.5 / ring_smoothing(arm, geometry, h)
    root = 1 / (root + np.sqrt(root**2 - 1))
    power = root**nodes
    for row, values in ((T.ROOT, root), (T.GAIN, (1 - root) ** 2), (T.CLOSURE, 1 / (1 - power))):
        buffer.slab(row)[:] = values
