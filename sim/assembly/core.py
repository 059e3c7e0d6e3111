"""The core of the full arm: 1 nerve cord, 8 longitudinal muscles, 8 oblique helices and all rings, connected and under pressure.

Numerics: position Verlet at a fixed step, stretch from length, muscle force along the tangent, linearly implicit force-velocity law, joints
with a potential, implicit pressure in slabs that keep their volume, exact damping, inertia of what is short or light raised to what the
step can carry, softened contacts, no filter.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import sqrt, tau
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..body.anatomy import PLAIN, Traits
from ..body.arm import Arm
from ..body.grid import AssemblyGrid
from ..compiler import BUILDING, by_address
from ..contracts import Floats, Motion, State
from ..errors import OctoctrlError, OctoctrlWarning, check_choice, check_count, check_number
from ..findings import Finding, Stop
from ..physics.fibre_kernels import MIDDLE, law_constants
from ..rotations import orthonormalised
from ..running.clock import Clock, StepLimit
from ..scene.loads import TORQUE, TWIST
from ..scene.objects import Capsule
from ..scene.scene import SELF_CONTACT, Scene
from .buffer import fill_parameters, new_assembly, set_filter_masks, set_rest
from .constants import fibre_laws, slab_volumes, thin_ring_limit
from .diagnosis import cause
from .energies import connections_of
from .geometry import assembly_geometry, assembly_grid
from .halves import Halves, OneMemory
from .layout import AssemblyRow, SlabRow, SpokeRow
from .meeting_kernels import cores, together
from .surroundings import folds_of, surroundings_of
from .terms import Step

DEFAULT_SHARE, LARGEST_SHARE = 0.82, 0.93
"""Shares of the linear limit that a step takes, and may take: 71 and 80 of 86 microseconds for the published arm.

At 71 all muscles together at level 1 run without a second try; at 80 every group at 0.3 does.
"""
PUBLISHED_STEP = 1e-5
PRECISIONS = ("double", "mixed")
MOST_THREADS, THREADS_ADVICE = 2, "one half of the arm for each"
TONE_RAMP = 0.01
"""Time (s) in which the resting tone comes up."""
STRAIGHT_SHOWN, OBLIQUE_SHOWN, RINGS_SHOWN = 46, 120, 30
"""Nodes of a straight rod and of a helix, and rings, in a picture of all rods."""


@cache
def compiled(
    grid: AssemblyGrid,
    inclination: float,
    published: bool = False,
    traits: Traits = PLAIN,
    loaded: bool = False,
    touching: bool = False,
    folding: bool = False,
) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """The compiled loop of an assembly and its terms, see `octoctrl.sim.assembly.stepping.assembly_stepper`."""
    from .contact_kernels import contact_kernels, fold_kernels
    from .hydrostat_terms import hydrostat_terms
    from .published_contact_kernels import published_contact_kernels
    from .published_terms import published_terms
    from .stepping import assembly_stepper

    if published:
        phases, watching = published_terms(grid, traits, inclination, loaded, touching), published_contact_kernels
    else:
        phases, watching = hydrostat_terms(grid, traits, loaded, touching, folding), contact_kernels
    watch, _, note = fold_kernels(grid) if folding else (None, None, None)
    return assembly_stepper(grid, phases, loaded, watching(grid)[0] if touching else None, (watch, note) if folding else None)


def _at_spokes(levels: Floats, spokes: int) -> Floats:
    """Levels (T, spokes, n) of that many longitudinal muscles, linear in azimuth between those of evenly spaced groups (T, groups, n)."""
    groups = levels.shape[1]
    before, share = np.divmod(np.arange(spokes) * groups, spokes)
    share = share[:, None] / spokes
    return (1 - share) * levels[:, before] + share * levels[:, (before + 1) % groups]


def _spread(count: int, shown: int) -> NDArray[np.int_]:
    """At most that many indices, from the first of `count` to the last."""
    return np.unique(np.round(np.linspace(0, count - 1, min(shown, count))).astype(int))


class AssemblyCore:
    """An arm of 197 rods, see `octoctrl.sim.contracts.Core`.

    Parameters
    ----------
    arm : Arm
    scene : Scene
    rings : int, optional
        Resolution: the same arm with more rings than the published 180, each a part of one (360, ...), which costs as much more as it has
        elements.
    ring_nodes : int, optional
        Coarse rings: 8 nodes, one at each longitudinal muscle, instead of the published 40 take a third of the time, see docs/assembly.md.
    resting_tone : float or None
        Smallest activation of the nerve cord, the longitudinal and the transverse muscles; None takes the arm's, for the octopus 0.001 in
        both numerics. Within 2.5 % of rest no passive stress resists, so that even this keeps the rings round and sets how much the arm
        shortens when it is twisted.
    paper_compatible : bool
        Integrate as published (Tekinalp et al. 2024): muscle force along d3, explicit force-velocity law, velocity filter, at 1e-5 s.
        Only for comparison: the motion depends on the step and active oblique rods buckle in shear.
    precision : {"double", "mixed"}
        ``"mixed"`` computes in single precision and keeps positions to twice its digits, in about half the time; its errors are in
        docs/benchmarks.md.
    threads : {1, 2}
        ``2`` moves the two halves of the arm side by side, in little more than half the time where two cores are free, with the same bits;
        where the other core is busy it takes longer. See docs/assembly.md.
    taut : bool
        Lay the oblique fibres straight from ring to ring. The study's lie on the arm's surface there, which nothing holds them to, so that
        they are 0.4 per cent too long and twist the arm by 2 % more; with taut ones the coil of 180 rings is nearer to that of 360.

    Attributes
    ----------
    rods : AssemblyBuffer
    grid : AssemblyGrid
    geometry : AssemblyGeometry

    Raises
    ------
    OctoctrlError
        If an argument is out of range or the arm's fibres do not fit the grid.
    """

    loadable = True
    works = ("muscles", "water", "viscosity")
    period = 0.025
    """The full arm, which its reduced model describes less well than that of one rod, is corrected more often."""

    def __init__(
        self,
        arm: Arm,
        scene: Scene,
        *,
        rings: int | None = None,
        ring_nodes: int | None = None,
        resting_tone: float | None = None,
        paper_compatible: bool = False,
        precision: Literal["double", "mixed"] = "double",
        threads: int = 1,
        taut: bool = False,
    ) -> None:
        self.arm, self.scene, self.paper_compatible = arm, scene, paper_compatible
        anatomy = arm.anatomy
        if paper_compatible and scene.self_contact:
            raise OctoctrlError("the published arm does not touch itself; leave self_contact or paper_compatible out")
        other = next((item for item in scene.objects if not isinstance(item, Capsule)), None)
        if paper_compatible and other is not None:
            raise OctoctrlError(f"the published contact knows capsules only (found '{other.name}'); leave it or paper_compatible out")
        if resting_tone is None:
            resting_tone = anatomy.published_tone if paper_compatible else anatomy.resting_tone
        check_number("resting_tone", resting_tone, at_least=0.0, at_most=1.0)
        self.resting_tone = resting_tone
        check_choice("precision", precision, PRECISIONS)
        if paper_compatible and precision != "double":
            raise OctoctrlError(f"paper_compatible is in double precision, to the bit; leave precision='{precision}' out")
        self.precision, self.threads = precision, check_count("threads", threads, at_most=MOST_THREADS, advice=THREADS_ADVICE)
        if threads > 1 and paper_compatible:
            raise OctoctrlError(f"paper_compatible runs in one thread; leave threads={threads} out")
        if threads > cores():
            told = f"threads={threads}, but this process has one core, on which they take turns and are slower than one; leave threads out"
            warnings.warn(told, OctoctrlWarning, stacklevel=2)
        self.grid = assembly_grid(arm, rings, ring_nodes)
        if paper_compatible and self.grid != assembly_grid(arm):
            raise OctoctrlError("paper_compatible is the published arm with its own numbers of rings and ring nodes; leave both out")
        self.grid = replace(self.grid, single=precision == "mixed")
        if paper_compatible and taut:
            raise OctoctrlError("paper_compatible has the study's fibres, which are not taut; leave taut out")
        self.taut = taut
        self.geometry = assembly_geometry(arm, self.grid, taut)
        self.elements = self.grid.rings
        self.partitions = {"arm": np.linspace(0.0, arm.length, self.elements + 1), "oblique": self.geometry.oblique_edges}
        limit, thinnest = thin_ring_limit(arm, self.geometry)
        # Finer cells have a mode at the muscles' tips that the limit of the rings does not see: 360 rings run at 30 us and diverge at 33.6.
        limit *= sqrt(self.grid.bundle)
        usual, allowed = (anatomy.step or round(share * limit, 6) for share in (DEFAULT_SHARE, LARGEST_SHARE))
        self.usual = (anatomy.published_step or PUBLISHED_STEP) if paper_compatible else usual
        self.limit = StepLimit(
            step=allowed, mechanism="thin rings" if anatomy.step is None else "contacts of straight rods", element=thinnest
        )
        self._ring_radius = np.linalg.norm(self.geometry.rings.points[..., ::2], axis=2).mean(axis=1)
        self.rods = new_assembly(self.geometry)
        self._memory = OneMemory(self.rods) if self.threads == 1 else Halves(self.rods, self.geometry)
        water = scene.water
        drag = (0.0, 0.0) if water is None else (water.normal_coefficient, water.tangential_coefficient)
        density = 0.0 if water is None else water.density * water.factor
        rates = (0.0, 0.0) if water is None else (water.factor * water.oblique_rate, water.factor * water.ring_rate)
        self._drag = (density * drag[0], density * drag[1], *rates)
        centre = MIDDLE if self.grid.single else 0.0
        laws = fibre_laws(arm, paper_compatible)
        self._laws = tuple(law_constants(law, viscosity=anatomy.viscosity, centre=centre) for law in laws)
        self._around, self._folds = surroundings_of(arm, scene, self.geometry), folds_of(arm, scene, self.geometry)
        self.rest()

    @property
    def model(self) -> str:
        """Name of the model with its numerics, as written into saved states."""
        if self.paper_compatible:
            return "assembly, as published"
        return "assembly" + "-coarse" * self.grid.between + "-mixed" * self.grid.single

    @property
    def finer(self) -> tuple[int, ...]:
        """Parts of the step at which a sample that stops is tried again; the published numerics depend on their step."""
        return () if self.paper_compatible else (2, 4)

    def start(self, clock: Clock) -> None:
        """Set all that depends on the step."""
        self._h = clock.step
        fill_parameters(self.rods, self.arm, self.geometry, clock.step, self.scene.water, published=self.paper_compatible)
        self._memory.renew()
        if self._around is not None:
            self._around.start(clock.step)

    def rest(self) -> None:
        """Put the arm to rest, straight along +y."""
        set_rest(self.rods, self.geometry)
        if self._around is not None:
            self._around.rest()
        self._folded = np.zeros(3)

    def shape(self) -> tuple[Floats, Floats, Floats]:
        """Points, frames and stretch of the nerve cord now."""
        points = self.rods.points(self.rods.straight, nodes=True)[0]
        frames = np.stack([self.rods.straight(AssemblyRow.Q11 + i)[0] for i in range(9)], axis=1).astype(float).reshape(-1, 3, 3)
        return points, self._told(frames), np.linalg.norm(np.diff(points, axis=0), axis=1) / self.geometry.straight.length[0]

    def _told(self, frames: Floats) -> Floats:
        """What others are told of frames that are kept in single precision: orthonormal to all digits."""
        return orthonormalised(frames) if self.grid.single else frames

    def series(self) -> State:
        """Volume inside the rings over that at rest: ``volume`` of the whole, ``slab_volume`` of each slab (N,); each object's `Touch`; of
        the arm on itself, see `octoctrl.sim.contact.folds.Folds.notes`.
        """
        series = self._volumes(connections_of(self.arm, self.geometry, self.rods).volumes()[None])
        touched = {} if self._around is None else self._around.now()
        folded = {} if self._folds is None else {SELF_CONTACT: self._folded.copy()}
        return {name: values[0] for name, values in series.items()} | touched | folded

    def _volumes(self, volumes: Floats) -> dict[str, Floats]:
        rest = slab_volumes(self.geometry)
        return {"volume": volumes.sum(axis=1) / rest.sum(), "slab_volume": volumes / rest}

    def speeds(self) -> tuple[Floats, Floats]:
        """Velocities and spins of the nerve cord now."""
        velocities = np.stack([self.rods.straight(AssemblyRow.V1 + i, nodes=True)[0] for i in range(3)], axis=1)
        spins = np.stack([self.rods.straight(AssemblyRow.W1 + i)[0] for i in range(3)], axis=1)
        return velocities.astype(float), spins.astype(float)

    def nodes(self) -> tuple[Floats, Floats, Floats]:
        """Node positions of the families, m: straight (9, N + 1, 3), oblique (8, 2 N, 3), rings (N, ring nodes, 3)."""
        rods = self.rods
        return rods.points(rods.straight, nodes=True), rods.points(rods.oblique, nodes=True), rods.points(rods.ring)

    def strands(self) -> dict[str, tuple[Floats, Floats]]:
        """Nodes (rods, nodes, 3) and radii at rest (rods, nodes), m, by family, as many as a picture needs; a ring ends where it begins."""
        geometry, (straight, oblique, rings) = self.geometry, self.nodes()
        along, around = _spread(straight.shape[1], STRAIGHT_SHOWN), _spread(oblique.shape[1], OBLIQUE_SHOWN)
        shown, turn = _spread(len(rings), RINGS_SHOWN), np.arange(rings.shape[1] + 1) % rings.shape[1]
        lengthwise = straight[:, along], geometry.straight.radius[:, np.minimum(along, geometry.straight.radius.shape[1] - 1)]
        return {
            "nerve cord": (lengthwise[0][:1], lengthwise[1][:1]),
            "longitudinal": (lengthwise[0][1:], lengthwise[1][1:]),
            "oblique": (oblique[:, around], geometry.oblique.radius[:, np.minimum(around, geometry.oblique.radius.shape[1] - 1)]),
            "transverse": (rings[shown][:, turn], geometry.rings.radius[shown][:, turn]),
        }

    def muscle_lengths(self) -> tuple[Floats, Floats, Floats]:
        """Lengths of the nerve cord and the eight longitudinal muscles (9,), m, the eight helices (8,) and the rings (N,)."""
        straight, oblique, rings = self.nodes()
        closed = np.concatenate([rings, rings[:, :1]], axis=1)
        return tuple(np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1) for points in (straight, oblique, closed))

    def pressure(self) -> Floats:
        """Pressure at the last step, Pa: of the slabs (N,); in the published numerics, in the cord and the longitudinal muscles (9, N)."""
        if not self.paper_compatible:
            return self.rods.slab(SlabRow.PRESSURE).astype(float)
        total, *parts = (self.rods.straight_sum(row) for row in (SpokeRow.SUM, SpokeRow.G1, SpokeRow.G2, SpokeRow.G3))
        stretch = self.rods.straight(AssemblyRow.STRETCH)
        surface = tau * self.geometry.straight.radius * self.geometry.straight.length * np.sqrt(stretch)
        return (np.abs(total) - np.linalg.norm(parts, axis=0)) / surface

    def volume(self) -> float:
        """Volume inside the rings' middle lines, from the first ring to the last, m^3: fans of tetrahedra between neighbouring rings."""
        _, _, rings = self.nodes()
        centre = rings.mean(axis=1, keepdims=True)
        left, right = rings, np.roll(rings, -1, axis=1)

        def tetrahedra(a: Floats, b: Floats, c: Floats, d: Floats) -> float:
            return np.sum(np.cross(b - a, c - a) * (d - a)) / 6

        low, high = slice(None, -1), slice(1, None)
        axis_low, axis_high = (np.broadcast_to(centre[part], left[part].shape) for part in (low, high))
        total = tetrahedra(axis_low, left[low], right[low], axis_high)
        total += tetrahedra(left[low], right[low], axis_high, left[high])
        total += tetrahedra(right[low], axis_high, left[high], right[high])
        return abs(float(total))

    def move(self, first: int, inputs: State, clock: Clock) -> Motion:
        """Take the steps of the samples between the instants of `inputs`."""
        return self._move(first, inputs, clock, watch=False)

    def _move(self, first: int, inputs: State, clock: Clock, *, watch: bool) -> Motion:
        """Move on, with the guard after every sample or, if asked to `watch`, after every step."""
        if self._around is None:
            return self._go(first, inputs, clock, watch)

        def go(part: slice) -> Motion:
            return self._go(first + part.start, {name: values[part] for name, values in inputs.items()}, clock, watch)

        return self._around.moved(first, len(inputs["arm"]) - 1, clock.sample, go)

    def _go(self, first: int, inputs: State, clock: Clock, watch: bool) -> Motion:
        along, loads, n, rods = inputs["arm"], inputs.get("loads"), self.elements, self.rods
        samples = len(along) - 1
        points, frames, stretch = np.empty((samples, n + 1, 3)), np.empty((samples, n, 3, 3)), np.empty((samples, n))
        volumes = np.empty((samples, n))
        longitudinal, oblique, transverse = self._levels(inputs, clock.instants(first, samples))
        around = self._around
        world: Any = () if around is None else around.world.with_room(samples, strict=not watch)
        folds: Any = () if self._folds is None else self._folds.with_room(samples, strict=not watch)
        memory = self._memory
        with BUILDING:
            advance, terms = compiled(
                memory.grid,
                self.geometry.inclination,
                self.paper_compatible,
                self.arm.anatomy.traits,
                loads is not None,
                around is not None,
                self._folds is not None,
            )
        if self.paper_compatible:
            set_filter_masks(rods)
        constants = self._rounded(self._h), self._rounded(self._laws), self._rounded(self._drag)
        carried, shares, outside = self._carried(loads)
        levels, shape = (longitudinal, oblique, transverse), (points, frames, stretch, volumes)
        there, folded = (item and item._replace(points=memory.points(item.points)) for item in (world, folds))
        jobs = []
        for flat, index, crew in memory.workers:
            step = Step(*constants, *index, outside, there, folded)
            called = by_address(terms, flat, flat[0], step, crew.part)
            jobs.append((flat, step, called, clock.steps, *levels, *shape, carried, shares, watch, crew))
        with memory.lent():
            done, finding, family, where, part = together(advance, tuple(jobs))
        rod, element = self.place(family, memory.where(family, int(where), part)) if finding else ("", 0)
        series = self._volumes(volumes[:done])
        if around is not None:
            series |= {name: values[:done] for name, values in around.series(world).items()}
        if self._folds is not None:
            series[SELF_CONTACT], self._folded = folds.notes[:done], folds.notes[done - 1] if done else self._folded
        return Motion(points[:done], self._told(frames[:done]), stretch[:done], series, Finding(finding), rod, element)

    def _rounded(self, numbers: Any) -> Any:
        """Numbers, in tuples of tuples, in the precision of the buffer."""
        if not isinstance(numbers, tuple):
            return self.rods.flat.dtype.type(numbers)
        rounded = map(self._rounded, numbers)
        return type(numbers)(*rounded) if hasattr(numbers, "_fields") else tuple(rounded)

    def _levels(self, inputs: State, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Levels at T `times` (s) of cord and muscles (T, rods, N), of the hands (T, 2, helix elements), right first, and rings (T, N)."""
        along, layout = inputs["arm"], self.arm.layout
        longitudinal = np.empty((len(times), self.grid.straight_rods, self.elements))
        tone = self.resting_tone * np.minimum(times / TONE_RAMP, 1.0)
        longitudinal[:, 0] = tone[:, None]
        muscles = along[:, layout.indices(layout.longitudinal)]
        longitudinal[:, 1:] = self._toned(_at_spokes(muscles, self.grid.spokes), tone[:, None, None])
        transverse = self._toned(along[:, layout.index(layout.transverse.name)], tone[:, None])
        oblique = np.zeros((len(times), 2, self.grid.helix_elements))
        for group in layout.oblique:
            oblique[:, 0 if group.hand > 0 else 1] = inputs["oblique"][:, layout.index(group.name)]
        return longitudinal, oblique, transverse

    def energies(self) -> dict[str, float]:
        """Energies by part, J, see `octoctrl.sim.assembly.account`; the published laws have no potential."""
        from .account import energies

        if self.paper_compatible:
            raise OctoctrlError(
                "the published laws have no potential, so that there is no account of their energy; leave paper_compatible or energy out"
            )
        if self.rods.flat.dtype != np.float64:
            raise OctoctrlError("energy is accounted for in double precision only; leave precision or energy out")
        return energies(self, self._h)

    def powers(self, levels: State, time: float) -> dict[str, float]:
        """Power of the muscles and of the water, W, see `octoctrl.sim.assembly.account`."""
        from .account import powers

        longitudinal, oblique, transverse = self._levels({name: values[None] for name, values in levels.items()}, np.array([time]))
        return powers(self, self._h, (longitudinal[0], oblique[0], transverse[0]))

    @property
    def drag(self) -> tuple[float, float]:
        """Normal and tangential drag of the muscles, kg/m^3."""
        return self._drag[0], self._drag[1]

    def _carried(self, loads: Floats | None) -> tuple[Floats, Floats, Floats]:
        """Loads, the shares of them that cord and muscles carry, by their areas, and a place for the forces on their nodes."""
        rods, grid = self.geometry.straight, self.grid
        if loads is None:
            return np.zeros((1, 2, 3, 1)), np.zeros((1, 1)), np.zeros((3, 1))
        if loads[:, TORQUE].any() or loads[:, TWIST:].any():
            raise OctoctrlError("the full arm carries forces only; give a torque as two forces, or take the plant 'rod'")
        area = np.concatenate([rods.area, rods.area[:, -1:]], axis=1)
        return loads, area / area.sum(axis=0), np.zeros((3, grid.straight_rods * grid.lanes))

    def explain(self, before: State, first: int, inputs: State, motion: Motion, clock: Clock) -> Stop:
        """Go again and look after every step where it began: within a sample the damage spreads over the whole arm."""
        self.restore(before)
        closer = self._move(first, inputs, clock, watch=True)
        straight, _, rings = self.nodes()
        time = (first + len(closer.points) + 1) * clock.sample
        text = cause(straight, rings, self._ring_radius, self.geometry.straight.radius[0])
        return Stop(time=time, rod=closer.rod, element=closer.element, finding=closer.finding, unstable=None, cause=text)

    def _toned(self, levels: Floats, tone: Floats) -> Floats:
        """Levels with the resting tone: at least that; in the source, that where there is no other."""
        return np.where(levels > 0, levels, tone) if self.paper_compatible else np.maximum(levels, tone)

    def place(self, family: int, where: int) -> tuple[str, int]:
        """Name of the rod and number of the element at index `where` in a row of `family` (0 open rods, 1 rings)."""
        grid = self.grid
        slot, lane = divmod(where, grid.lanes)
        if family == 1:
            return f"ring {lane - 1}", (slot - 1) % grid.ring_nodes
        if slot < grid.straight_rods:
            return ("nerve cord" if slot == 0 else f"LM{slot}"), lane - 1
        helix, late = divmod(slot - grid.straight_rods, grid.helix_nodes)
        hand, number = divmod(helix, grid.helices // 2)
        return f"{'LR'[hand]}-OM helix {number + 1}", late * grid.lanes + lane - 1

    def state(self) -> State:
        """Copies of the rows that hold the motion."""
        open_rods, rings = self.rods.state()
        motion = {"open_rods": open_rods, "rings": rings}
        motion = motion if self._around is None else motion | self._around.state()
        return motion if self._folds is None else motion | {SELF_CONTACT: self._folded.copy()}

    def restore(self, state: State) -> None:
        """Write back what `state` returned, and clear what a diverged step may have left."""
        self.rods.restore((state["open_rods"], state["rings"]))
        self._memory.renew()
        if self._around is not None:
            self._around.restore(state)
        if self._folds is not None:
            self._folded = np.array(state[SELF_CONTACT])

    def identity(self) -> dict[str, Any]:
        """What a saved state must share."""
        known = {"elements": self.elements, "ring_nodes": self.grid.ring_nodes, "resting_tone": self.resting_tone}
        known |= {"taut": True} if self.taut else {}
        known |= {"self_contact": True} if self.scene.self_contact else {}
        return known | {"objects": repr(self.scene.objects)}
