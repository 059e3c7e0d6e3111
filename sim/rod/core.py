"""The core of the plant ``"rod"``: one Cosserat rod of the arm's outline, whose muscle fibres act at their places off the axis."""

from collections.abc import Callable
from functools import cache
from math import ceil, tau
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..body.anatomy import OCTOPUS
from ..body.arm import REST_FRAME, Arm
from ..body.layout import MuscleLayout
from ..compiler import BUILDING
from ..contracts import Floats, Motion, State
from ..errors import OctoctrlError
from ..findings import Finding, Stop
from ..physics.fibre_kernels import law_constants
from ..running.clock import SAFETY, Clock, StepLimit
from ..scene.scene import SELF_CONTACT, Scene, Water
from .buffer import joint_curvature, node_masses, rod_energy, set_damping, set_joints, set_state
from .diagnosis import ALTERNATING, TRAIL, alternation, explained, substeps
from .layout import STATE_ROWS, Row, new_buffer, stride_for
from .step_limits import predict_limit

if TYPE_CHECKING:
    from ..contact.folds import Folds
    from ..contact.surroundings import Surroundings
    from ..contact.world import Points

LARGEST_STEP = 1e-3
"""What ``dt="auto"`` takes at most, s: coarse arms would be stable beyond, but miss the onset of their muscles."""

TOUCHING_STEP = 7e-4
"""The same where the arm can touch objects or itself, s: at 1 ms what is held by friction can go on trembling, by some mm/s."""

NO_LOADS = np.zeros((1, 5, 3, 1))

_LIMITS: dict[tuple[Arm, Water | None], StepLimit] = {}
"""Step limits at rest by arm and water: many plants of a study are alike."""


@cache
def _muscular_advance(stride: int, layout: MuscleLayout, loaded: bool, touching: bool, folding: bool) -> Callable[..., Any]:
    from .stepping import muscular_stepper

    return muscular_stepper(stride, layout, loaded, touching, folding)


class RodCore:
    """One rod in place of the whole arm, see `octoctrl.sim.contracts.Core`.

    Parameters
    ----------
    arm : Arm
    scene : Scene
    complete : bool
        Whether every active law and the drag are evaluated, needed or not: to measure what leaving them out saves. No bit differs.

    Attributes
    ----------
    buffer : (rows * stride,) float64
        All that the compiled code reads and writes, by `octoctrl.sim.rod.layout.Row`.
    node_mass : (n + 1,) float64, kg

    Raises
    ------
    OctoctrlError
        If the arm is not built as an octopus arm.
    """

    model = "rod"
    works = ("muscles", "water")
    loadable = True
    finer = (2, 4)
    """Driven tips now and then outrun the step at rest."""
    period = 0.05

    def __init__(self, arm: Arm, scene: Scene, *, complete: bool = False) -> None:
        if arm.anatomy is not OCTOPUS:
            raise OctoctrlError(
                f"arm '{arm.name}' is not built as an octopus arm, as the one-rod plant is; use make_plant('assembly', arm)"
            )
        self.arm, self.scene, self.elements = arm, scene, arm.elements
        edges = arm.edges
        self.partitions = {"arm": edges}
        self._lengths = np.diff(edges)
        self._section = arm.section((edges[1:] + edges[:-1]) / 2)
        self.buffer, _ = new_buffer(self.elements)
        self._complete, self._loaded = complete, False
        self._steppers: dict[bool, Callable[..., Any]] = {}
        self.node_mass = node_masses(sum(self._section.masses) * self._lengths)
        self._fill_parameters()
        self._around, self._folds = self._surroundings(), self._own_folds()
        self.rest()
        self.limit = self._limit_at_rest()

    def _surroundings(self) -> "Surroundings | None":
        """The scene's objects; None without any."""
        if not self.scene.objects:
            return None
        from ..contact.surroundings import Surroundings
        from ..contact.world import points_of

        water = self.scene.water
        points = points_of(self.partitions["arm"], np.asarray(self._section.outer_radius), min(item.bend for item in self.scene.objects))
        thickness = float(self.arm.section(0.0).outer_radius)
        density = 0.0 if water is None else water.density
        found = Surroundings(self.scene.objects, points, thickness=thickness, water_density=density)
        place = self._along(points)
        found.check(np.stack([np.zeros_like(place), place, np.zeros_like(place)], axis=1))
        return found

    def _own_folds(self) -> "Folds | None":
        """What of the arm may touch itself; None where that is not asked for."""
        if not self.scene.self_contact:
            return None
        from ..contact.folds import Folds
        from ..contact.world import points_of

        radius = np.asarray(self._section.outer_radius)
        points = points_of(self.partitions["arm"], radius, float(radius.min()))
        return Folds.of(points, self._along(points))

    def _along(self, points: "Points") -> Floats:
        """Rest arclength of material points, m."""
        element = points.element.astype(int) - 1
        place: Floats = self.partitions["arm"][element] + points.share * self._lengths[element]
        return place

    @property
    def rows(self) -> Floats:
        """View of the buffer as rows; made anew each time, so that copies of a core are not bound to one another."""
        return self.buffer.reshape(len(Row), -1)

    @property
    def usual(self) -> float:
        """What ``dt="auto"`` takes, s."""
        alone = self._around is None and self._folds is None
        return min(SAFETY * self.limit.step, LARGEST_STEP if alone else TOUCHING_STEP)

    def _limit_at_rest(self) -> StepLimit:
        key = self.arm, self.scene.water
        if key not in _LIMITS:
            _LIMITS[key] = self.step_limit()
        return _LIMITS[key]

    def start(self, clock: Clock) -> None:
        """Set all that depends on the step."""
        self._prepare(clock.step)
        if self._around is not None:
            self._around.start(clock.step)

    def _prepare(self, h: float) -> None:
        self._h = h
        self._fill_damping(h)
        self._scalars = self._compiled_scalars(h)

    def step_limit(self, levels: Floats | None = None) -> StepLimit:
        """Predict the largest stable step in the present state.

        Parameters
        ----------
        levels : (groups, n) float64, optional
            Activation; none if omitted.

        Returns
        -------
        StepLimit
        """
        n = self.elements
        levels = np.zeros((len(self.arm.layout), n)) if levels is None else np.asarray(levels, dtype=float)
        both, before = np.stack([levels, levels]), getattr(self, "_h", None)
        scratch = np.empty((1, n + 1, 3)), np.empty((1, n, 3, 3)), np.empty((1, n))
        around = None if self._around is None else self._around.state()
        world = () if self._around is None else self._around.world.with_room(1)
        folds = () if self._folds is None else self._folds.with_room(1)
        found = predict_limit(self.rows, n, self.node_mass, self._prepare, lambda h: self._step(h, 1, both, None, world, folds, *scratch))
        if self._around is not None and around is not None:
            self._around.restore(around)
        if before is not None:
            self._prepare(before)
        return found

    def _fill_parameters(self) -> None:
        n, rows, section, length = self.elements, self.rows, self._section, self._lengths
        cord, longitudinal, ring, oblique = section.areas
        inside = slice(1, n + 1)
        for row, values in (
            (Row.SHEAR, section.shear_stiffness),
            (Row.OFFSET, section.muscle_offset),
            (Row.HELIX, section.oblique_offset),
            (Row.CORD_AREA, cord),
            (Row.LONGITUDINAL_AREA, longitudinal),
            (Row.RING_AREA, ring),
            (Row.OBLIQUE_AREA, oblique),
            (Row.OBLIQUE_REST, section.oblique_stretch),
        ):
            rows[row, inside] = values
        # The implicit step treats spin alike in all directions, and so must inertia: with the true polar / 2 in bending the step is not
        # symmetric and feeds a flutter of tight curls. The larger value moves the tip of the published coil by 0.1 % of L (rms).
        rows[Row.INERTIA1, inside] = rows[Row.INERTIA2, inside] = rows[Row.INERTIA3, inside] = sum(section.polar_inertias) * length
        set_joints(rows, n, length, section.bending_stiffness, section.twist_stiffness, clamped=True)
        rows[Row.NODE_MOBILITY, 1 : n + 2] = 1 / self.node_mass

    def _fill_damping(self, h: float) -> None:
        n, rows, water, section = self.elements, self.rows, self.scene.water, self._section
        if water is None:
            set_damping(rows, n, h, 0.0, 0.0, 0.0, fixed="clamped", masses=self.node_mass)
            return
        rates = water.factor * np.array([0.0, 0.0, water.ring_rate, water.oblique_rate])
        force_rate = node_masses(rates @ np.array(section.masses) * self._lengths) / self.node_mass
        spin_rate = rates @ np.array(section.polar_inertias) / sum(section.polar_inertias)
        set_damping(rows, n, h, force_rate, spin_rate, spin_rate, fixed="clamped", masses=self.node_mass)
        width = section.muscle_count * section.muscle_radius * self._lengths * water.density * water.factor
        rows[Row.DRAG_NORMAL, 1 : n + 2] = node_masses(width) * water.normal_coefficient
        rows[Row.DRAG_TANGENT, 1 : n + 2] = node_masses(width) * water.tangential_coefficient * tau / 2

    def _compiled_scalars(self, h: float) -> Any:
        from .stepping import MuscleScalars

        arm, lumped = self.arm, self.arm.lumped
        return MuscleScalars(
            hoop_ratio=float(lumped.hoop_ratio),
            winding=tau / arm.oblique_pitch,
            elastic=h / 2,
            longitudinal=law_constants(arm.longitudinal, 1.0, lumped.longitudinal_stress),
            oblique=law_constants(arm.oblique, lumped.oblique_passive, lumped.oblique_stress),
            transverse=law_constants(arm.transverse),
            wet=self._complete or (self.scene.water is not None and self.scene.water.factor > 0),
        )

    def rest(self) -> None:
        """Put the arm to rest, straight along +y."""
        points = np.zeros((self.elements + 1, 3))
        points[:, 1] = self.partitions["arm"]
        set_state(self.rows, self.elements, points, np.broadcast_to(REST_FRAME, (self.elements, 3, 3)), REST_FRAME)
        if self._around is not None:
            self._around.rest()
        self._folded = np.zeros(3)

    def shape(self) -> tuple[Floats, Floats, Floats]:
        """Points (n + 1, 3), frames (n, 3, 3) and stretch (n,) now."""
        n, rows = self.elements, self.rows
        points = rows[Row.X1 : Row.X3 + 1, 1 : n + 2].T.copy()
        frames = rows[Row.Q11 : Row.Q33 + 1, 1 : n + 1].T.reshape(n, 3, 3)
        return points, frames, np.linalg.norm(np.diff(points, axis=0), axis=1) / self._lengths

    def series(self) -> State:
        """Of each object of the scene, see `octoctrl.sim.contact.surroundings.Touch`; of the arm on itself, see `Folds.notes`."""
        found = {} if self._around is None else self._around.now()
        return found if self._folds is None else found | {SELF_CONTACT: self._folded.copy()}

    def speeds(self) -> tuple[Floats, Floats]:
        """Velocities (n + 1, 3) of the nodes and spins (n, 3) of the elements now."""
        n, rows = self.elements, self.rows
        return rows[Row.V1 : Row.V3 + 1, 1 : n + 2].T.copy(), rows[Row.W1 : Row.W3 + 1, 1 : n + 1].T.copy()

    def move(self, first: int, inputs: State, clock: Clock) -> Motion:
        """Take the steps of the samples between the instants of `inputs`, from sample number `first` on."""
        levels, loads, around = inputs["arm"], inputs.get("loads"), self._around
        if around is None:
            return self._move(levels, loads, clock.steps)
        return around.moved(
            first,
            len(levels) - 1,
            clock.sample,
            lambda part: self._move(levels[part], None if loads is None else loads[part], clock.steps),
        )

    def _move(self, levels: Floats, loads: Floats | None, steps: int, *, strict: bool = True) -> Motion:
        n, samples = self.elements, len(levels) - 1
        points, frames, stretch = np.empty((samples, n + 1, 3)), np.empty((samples, n, 3, 3)), np.empty((samples, n))
        world: Any = () if self._around is None else self._around.world.with_room(samples, strict=strict)
        folds: Any = () if self._folds is None else self._folds.with_room(samples, strict=strict)
        done, finding, element = self._step(self._h, steps, levels, loads, world, folds, points, frames, stretch)
        series = {} if self._around is None else self._around.series(world)
        if self._folds is not None:
            series[SELF_CONTACT], self._folded = folds.notes, folds.notes[done - 1] if done else self._folded
        return Motion(
            points[:done],
            frames[:done],
            stretch[:done],
            series={name: values[:done] for name, values in series.items()},
            finding=Finding(finding),
            element=int(element) - 1,
        )

    def _step(
        self, h: float, steps: int, levels: Floats, loads: Floats | None, world: Any, folds: Any, points: Floats, frames: Floats,
        stretch: Floats,
    ) -> tuple[int, int, int]:  # fmt: skip
        """The compiled loop: `steps` of h in each sample -> samples done, finding, element."""
        loaded = loads is not None
        step = self._steppers.get(loaded)
        if step is None:
            with BUILDING:
                touching, folding = self._around is not None, self._folds is not None
                step = _muscular_advance(stride_for(self.elements), self.arm.layout, loaded, touching, folding)
            self._steppers[loaded] = step
        if self._loaded and not loaded:
            self.rows[Row.FORCE1 : Row.COUPLE3 + 1] = 0.0
        self._loaded = loaded
        count = np.uint64(self.elements)
        active = np.ones((len(levels) - 1, levels.shape[1]), dtype=bool) if self._complete else self._active(levels)
        given = NO_LOADS if loads is None else loads
        found: tuple[int, int, int] = step(
            self.buffer, count, h, steps, levels, active, self._scalars, given, world, folds, points, frames, stretch
        )
        return found

    def __getstate__(self) -> dict[str, Any]:
        # Compiled code is found again; it is no part of a copy.
        return self.__dict__ | {"_steppers": {}}

    @staticmethod
    def _active(levels: Floats) -> NDArray[np.bool_]:
        """Which groups pull in each sample (samples, groups); the others' active laws are left out, which changes no bit."""
        pulls = levels @ np.ones(levels.shape[2]) > 0
        return pulls[1:] | pulls[:-1]

    def explain(self, before: State, first: int, inputs: State, motion: Motion, clock: Clock) -> Stop:
        """Go the last samples again, step by step: where and when it began, and whether the motion alternated."""
        levels, loads, done = inputs["arm"], inputs.get("loads"), len(motion.points)
        skip = max(0, done - ceil(TRAIL / clock.steps))
        last = slice(skip, done + 2)
        self.restore(before)
        if skip:
            self._move(levels[: skip + 1], None if loads is None else loads[: skip + 1], clock.steps, strict=False)
        loads = None if loads is None else substeps(loads[last], clock.steps)
        closer = self._move(substeps(levels[last], clock.steps), loads, 1, strict=False)
        where = closer if closer.finding else motion
        share = alternation(closer.frames[:, max(0, where.element - 1) : where.element + 2])
        time = (first + skip) * clock.sample + (len(closer.frames) + 1) * clock.step
        return explained(time, where.element, where.finding, None if share is None else share > ALTERNATING)

    def state(self) -> State:
        """Copies of the rows that hold the motion."""
        motion = {"state": self.rows[:STATE_ROWS, : self.elements + 2].copy()}
        motion = motion if self._around is None else motion | self._around.state()
        return motion if self._folds is None else motion | {SELF_CONTACT: self._folded.copy()}

    def restore(self, state: State) -> None:
        """Write back what `state` returned."""
        self.rows[:STATE_ROWS, : self.elements + 2] = state["state"]
        if self._around is not None:
            self._around.restore(state)
        if self._folds is not None:
            self._folded = np.array(state[SELF_CONTACT])

    def displace(self, shift: ArrayLike = 0.0, velocities: ArrayLike = 0.0) -> None:
        """Move the nodes that are free to.

        Parameters
        ----------
        shift : (n + 1, 3) array_like, m
        velocities : (n + 1, 3) array_like, m/s
            What is added to theirs.
        """
        nodes = slice(1, self.elements + 2)
        free = self.rows[Row.NODE_MOBILITY, nodes] > 0
        self.rows[Row.X1 : Row.X3 + 1, nodes] += free * np.transpose(shift)
        self.rows[Row.V1 : Row.V3 + 1, nodes] += free * np.transpose(velocities)

    def energies(self) -> dict[str, float]:
        """Energies by part, J, see `octoctrl.sim.rod.account`."""
        from .account import energies

        return energies(self)

    def powers(self, levels: State, time: float) -> dict[str, float]:
        """Power of the muscles and of the water, W, see `octoctrl.sim.rod.account`."""
        from .account import powers

        return powers(self, levels["arm"])

    def energy(self) -> dict[str, float]:
        """Kinetic energy, and elastic energy of the straight rods about their own axes, J; what muscle tissue stores is not in it."""
        return rod_energy(self.rows, self.elements, self.node_mass, constant_section=False)

    def curvature(self) -> Floats:
        """Curvature (n, 3) of the joints in the material frame, 1/m, base first."""
        return joint_curvature(self.rows, self.elements).T

    def identity(self) -> dict[str, Any]:
        """What a saved state must share."""
        return {
            "grading": self.arm.grading,
            "elements": self.elements,
            "objects": repr(self.scene.objects),
            "self_contact": self.scene.self_contact,
        }
