"""The full arm as a plant: 1 nerve cord, 8 longitudinal muscles, 8 oblique helices and all rings, connected and under pressure.

Numerics: position Verlet at a fixed step, stretch from length, muscle force along the tangent, linearly implicit force-velocity law, exact
damping, rotary inertia of thin elements raised to what the step can carry, softened contacts, no filter.
"""

from functools import cache
from math import ceil, sqrt, tau

import numpy as np

from ..body.anatomy import PLAIN
from ..body.arm import Arm
from ..errors import OctoctrlError, PlantUnstableError, check_count, check_number
from ..rod.elastic import FINDINGS as ROD_FINDINGS
from ..rod.plant import BUILDING, Observation, Plant
from ..running.clock import StepLimit
from ..scene.scene import Scene
from ..sources import sampled
from .buffer import fill_parameters, new_assembly, set_filter_masks, set_rest
from .constants import thin_ring_limit
from .diagnosis import cause
from .geometry import assembly_geometry, assembly_grid
from .layout import AssemblyRow, SpokeRow

DEFAULT_SHARE, LARGEST_SHARE = 0.58, 0.695
"""Shares of the linear limit that a step takes, and may take: 50 and 60 of 86 microseconds for the published arm, where 70 diverges."""
PUBLISHED_STEP = 1e-5
FINDINGS = ROD_FINDINGS | {4: "moves faster than 10 m/s"}
TONE_RAMP = 0.01
"""Time (s) in which the resting tone comes up."""


@cache
def _compiled(grid, inclination, published=False, traits=PLAIN):
    from .stepping import assembly_stepper

    return assembly_stepper(grid, inclination, published, traits)


def _at_spokes(levels, spokes):
    """Levels (T, spokes, n) of that many longitudinal muscles, linear in azimuth between those of evenly spaced groups (T, groups, n)."""
    groups = levels.shape[1]
    before, share = np.divmod(np.arange(spokes) * groups, spokes)
    share = share[:, None] / spokes
    return (1 - share) * levels[:, before] + share * levels[:, (before + 1) % groups]


class AssemblyPlant(Plant):
    """A simulated arm of 197 rods, with the interface of `Plant`.

    Parameters
    ----------
    arm : Arm
    scene : Scene
    rings : int, optional
        Resolution: the same arm with more rings than the published 180, each a part of one (360, ...), which costs as much more as it has
        elements.
    ring_nodes : int, optional
        Coarse rings: 8 nodes, one at each longitudinal muscle, instead of the published 40 take a third of the time, see docs/assembly.md.
    dt : float or "auto", s
        Largest time step; ``"auto"`` is `DEFAULT_SHARE` of the limit of the thinnest rings, or the arm's own.
    resting_tone : float or None
        Smallest activation of the nerve cord, the longitudinal and the transverse muscles; None takes the arm's, for the octopus 0.001 in
        both numerics. Within 2.5 % of rest no passive stress resists, so that even this keeps the rings round and sets how much the arm
        shortens when it is twisted.
    paper_compatible : bool
        Integrate as published (Tekinalp et al. 2024): muscle force along d3, explicit force-velocity law, velocity filter, at 1e-5 s.
        Only for comparison: the motion depends on the step and active oblique rods buckle in shear.
    sample_interval, record_every
        As in `Plant`.

    Raises
    ------
    OctoctrlError
        If an argument is out of range or the arm's fibres do not fit the grid.
    """

    def __init__(
        self,
        arm=None,
        scene=None,
        *,
        rings=None,
        ring_nodes=None,
        dt="auto",
        resting_tone=None,
        paper_compatible=False,
        sample_interval=5e-3,
        record_every=2,
    ):
        self.arm = Arm.octopus() if arm is None else arm
        self.scene = Scene() if scene is None else scene
        check_number("sample_interval", sample_interval, at_least=1e-4, at_most=0.1, unit="s")
        record_every = check_count("record_every", record_every)
        anatomy = self.arm.anatomy
        if resting_tone is None:
            resting_tone = anatomy.published_tone if paper_compatible else anatomy.resting_tone
        check_number("resting_tone", resting_tone, at_least=0.0, at_most=1.0)
        self.resting_tone, self.paper_compatible = resting_tone, paper_compatible
        self.sample_interval, self.record_every = sample_interval, record_every
        self.grid = assembly_grid(self.arm, rings, ring_nodes)
        if paper_compatible and self.grid != assembly_grid(self.arm):
            raise OctoctrlError("paper_compatible is the published arm with its own numbers of rings and ring nodes; leave both out")
        self.geometry = assembly_geometry(self.arm, self.grid)
        limit, thinnest = thin_ring_limit(self.arm, self.geometry)
        # Finer cells have a mode at the muscles' tips that the limit of the rings does not see: 360 rings run at 30 us and diverge at 33.6.
        limit *= sqrt(self.grid.bundle)
        usual, allowed = (anatomy.step or round(share * limit, 6) for share in (DEFAULT_SHARE, LARGEST_SHARE))
        largest = dt if dt != "auto" else (anatomy.published_step or PUBLISHED_STEP) if paper_compatible else usual
        check_number("dt", largest, above=0.0, at_most=allowed, unit="s", advice="use dt='auto'")
        self.elements = self.grid.rings
        self._ring_radius = np.linalg.norm(self.geometry.rings.points[..., ::2], axis=2).mean(axis=1)
        self.edges = np.linspace(0.0, self.arm.length, self.elements + 1)
        self.stations = np.concatenate([[0.0], (self.edges[1:] + self.edges[:-1]) / 2, [self.arm.length]])
        self.limit = StepLimit(
            step=allowed, mechanism="thin rings" if anatomy.step is None else "contacts of straight rods", element=thinnest
        )
        self.steps = max(1, ceil(sample_interval / largest - 1e-9))
        self.h = sample_interval / self.steps
        self.rods = new_assembly(self.geometry)
        set_rest(self.rods, self.geometry)
        water = self.scene.water
        fill_parameters(self.rods, self.arm, self.geometry, self.h, water, published=paper_compatible)
        drag = (0.0, 0.0) if water is None else (water.normal_coefficient, water.tangential_coefficient)
        density = 0.0 if water is None else water.density * water.factor
        rates = (0.0, 0.0) if water is None else (water.factor * water.oblique_rate, water.factor * water.ring_rate)
        self._drag = (density * drag[0], density * drag[1], *rates)
        self._laws = self._law_constants()
        self.reset()

    @property
    def model(self):
        """Name of the model with its numerics, as written into saved states."""
        if self.paper_compatible:
            return "assembly, as published"
        return "assembly-coarse" if self.grid.between else "assembly"

    def _law_constants(self):
        from ..physics.fibre_kernels import law_constants

        return tuple(law_constants(law) for law in (self.arm.longitudinal, self.arm.oblique, self.arm.transverse))

    def reset(self):
        """Put the arm back to rest at time zero; returns the first `Observation`."""
        set_rest(self.rods, self.geometry)
        self.samples = 0
        return self.observe()

    def observe(self):
        """Positions, frames and stretch of the nerve cord now, as an `Observation`."""
        points = np.stack([self.rods.straight(AssemblyRow.X1 + i, nodes=True)[0] for i in range(3)], axis=1)
        frames = np.stack([self.rods.straight(AssemblyRow.Q11 + i)[0] for i in range(9)], axis=1).reshape(-1, 3, 3)
        stretch = np.linalg.norm(np.diff(points, axis=0), axis=1) / self.geometry.straight.length[0]
        return Observation(time=self.time, points=points, frames=self._with_ends(frames), stations=self.stations, stretch=stretch)

    def nodes(self):
        """Node positions of the families, m: straight (9, N + 1, 3), oblique (8, 2 N, 3), rings (N, ring nodes, 3)."""
        rows = range(AssemblyRow.X1, AssemblyRow.X3 + 1)
        straight = np.stack([self.rods.straight(row, nodes=True) for row in rows], axis=-1)
        oblique = np.stack([self.rods.oblique(row, nodes=True) for row in rows], axis=-1)
        return straight, oblique, np.stack([self.rods.ring(row) for row in rows], axis=-1)

    def muscle_lengths(self):
        """Lengths of the nerve cord and the eight longitudinal muscles (9,), m, the eight helices (8,) and the rings (N,)."""
        straight, oblique, rings = self.nodes()
        closed = np.concatenate([rings, rings[:, :1]], axis=1)
        return tuple(np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1) for points in (straight, oblique, closed))

    def pressure(self):
        """Intramuscular pressure (9, N) in the nerve cord and the longitudinal muscles at the last step, Pa."""
        total, *parts = (self.rods.straight_sum(row) for row in (SpokeRow.SUM, SpokeRow.G1, SpokeRow.G2, SpokeRow.G3))
        stretch = self.rods.straight(AssemblyRow.STRETCH)
        surface = tau * self.geometry.straight.radius * self.geometry.straight.length * np.sqrt(stretch)
        return (np.abs(total) - np.linalg.norm(parts, axis=0)) / surface

    def volume(self):
        """Volume inside the rings' middle lines, from the first ring to the last, m^3: fans of tetrahedra between neighbouring rings."""
        _, _, rings = self.nodes()
        centre = rings.mean(axis=1, keepdims=True)
        left, right = rings, np.roll(rings, -1, axis=1)

        def tetrahedra(a, b, c, d):
            return np.sum(np.cross(b - a, c - a) * (d - a)) / 6

        low, high = slice(None, -1), slice(1, None)
        axis_low, axis_high = (np.broadcast_to(centre[part], left[part].shape) for part in (low, high))
        total = tetrahedra(axis_low, left[low], right[low], axis_high)
        total += tetrahedra(left[low], right[low], axis_high, left[high])
        total += tetrahedra(right[low], axis_high, left[high], right[high])
        return abs(float(total))

    def _levels(self, activation, samples):
        times = (self.samples + np.arange(samples + 1)) * self.sample_interval
        layout = self.arm.layout
        levels = sampled(activation, times, {"arm": self.edges, "oblique": self.geometry.oblique_edges}, layout)
        self._oblique_levels = np.zeros((samples + 1, 2, levels["oblique"].shape[2]))
        for group in layout.oblique:
            self._oblique_levels[:, 0 if group.hand > 0 else 1] = levels["oblique"][:, layout.index(group.name)]
        return levels["arm"]

    def _advance_samples(self, levels):
        n, samples, rods = self.elements, len(levels) - 1, self.rods
        points, frames, stretch = np.empty((samples, n + 1, 3)), np.empty((samples, n, 3, 3)), np.empty((samples, n))
        longitudinal = np.empty((samples + 1, self.grid.straight_rods, n))
        since = (self.samples + np.arange(samples + 1)) * self.sample_interval
        tone = self.resting_tone * np.minimum(since / TONE_RAMP, 1.0)
        longitudinal[:, 0] = tone[:, None]
        layout = self.arm.layout
        along = levels[:, layout.indices(layout.longitudinal)]
        longitudinal[:, 1:] = self._toned(_at_spokes(along, self.grid.spokes), tone[:, None, None])
        transverse = self._toned(levels[:, layout.index(layout.transverse.name)], tone[:, None])
        good = rods.state()
        with BUILDING:
            step, _ = _compiled(self.grid, self.geometry.inclination, self.paper_compatible, self.arm.anatomy.traits)
        if self.paper_compatible:
            set_filter_masks(rods)
        arguments = (
            rods.flat, self.h, self.steps, longitudinal, self._oblique_levels, transverse, self._laws, self._drag,
            rods.ring_index, rods.helix_index, points, frames, stretch,
        )  # fmt: skip
        done, finding, family, where = step(*arguments, False)
        first = self.samples
        if finding:
            # Within a sample the damage spreads over the whole arm: run again and look after every step where it began.
            rods.restore(good)
            if self.paper_compatible:
                set_filter_masks(rods)
            done, finding, family, where = step(*arguments, True)
            straight, _, rings = self.nodes()
            rods.restore(good)
            time = (first + done + 1) * self.sample_interval
            rod, element = self.place(family, int(where))
            raise PlantUnstableError(
                f"unstable at t={time:.3f} s: element {element} of {rod} {FINDINGS[finding]} (dt={self.h:.2g} s); "
                + cause(straight, rings, self._ring_radius, self.geometry.straight.radius[0]),
                time=time,
                rod=rod,
                element=element,
                mechanism=FINDINGS[finding],
                recording=self._piece(first, points[:done], frames[:done], stretch[:done], levels),
            )
        self.samples += samples
        return self._piece(first, points, frames, stretch, levels)

    def _toned(self, levels, tone):
        """Levels with the resting tone: at least that; in the source, that where there is no other."""
        return np.where(levels > 0, levels, tone) if self.paper_compatible else np.maximum(levels, tone)

    def place(self, family, where):
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

    def _identity(self):
        return super()._identity() | {"ring_nodes": self.grid.ring_nodes, "resting_tone": self.resting_tone}

    def _state(self):
        open_rods, rings = self.rods.state()
        return {"open_rods": open_rods, "rings": rings}

    def _restore(self, data):
        self.rods.restore((data["open_rods"], data["rings"]))
