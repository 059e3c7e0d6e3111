"""The plant: an arm in a scene, moved by activations.

Model ``"rod"``: one Cosserat rod of the arm's outline, whose muscle fibres act at their off-axis places on the cross-section.
"""

from dataclasses import dataclass, replace
from functools import cache
from math import ceil, tau
from pathlib import Path
from threading import Lock

import numpy as np

from ..body.anatomy import OCTOPUS
from ..body.arm import Arm
from ..errors import OctoctrlError, PlantUnstableError, check_choice, check_count, check_number
from ..records import Record
from ..rotations import rotation_matrix, rotation_vector
from ..running.clock import StepLimit, choose_step
from ..running.recording import Recording
from ..scene.scene import Scene
from ..sources import sampled
from .diagnosis import ALTERNATING, TRAIL, Stop, alternation, substeps
from .elastic import node_masses, set_damping, set_joints, set_state
from .layout import STATE_ROWS, Row, new_buffer, stride_for
from .step_limits import predict_limit

MODELS = ("rod",)
REST_FRAME = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rows d1 = +z, d2 = +x, d3 = +y (arm axis)."""

LARGEST_STEP = 1e-3
"""What ``dt="auto"`` takes at most, s: coarse arms would be stable beyond, but miss the onset of their muscles."""

CHUNK = 100
"""Samples per compiled call: how often progress is shown and Ctrl-C is answered."""

_LIMITS: dict[tuple[Arm, Scene], StepLimit] = {}
"""Step limits at rest by arm and scene: many plants of a study are alike."""

FINER = (2, 4)
"""Parts of the step at which ``dt="auto"`` tries a sample again before it stops: driven tips now and then outrun the step at rest."""

MOST_STEPS = 100_000
"""Steps per sample: more would hold up progress and Ctrl-C for minutes."""

BUILDING = Lock()
"""Held while compiled code is put together, so that plants in several threads share it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Observation(Record):
    """What a controller may see at one instant.

    Attributes
    ----------
    time : float, s
    points : (n + 1, 3) float64, m
    frames : (n + 2, 3, 3) float64
        Directors at `stations`.
    stations : (n + 2,) float64, m
        Rest arclength of the frames: base, element centres, tip.
    stretch : (n,) float64
    """

    time: float
    points: np.ndarray
    frames: np.ndarray
    stations: np.ndarray
    stretch: np.ndarray


@cache
def _muscular_advance(stride, layout):
    from .stepping import muscular_stepper

    return muscular_stepper(stride, layout)


class Plant:
    """A simulated arm.

    Parameters
    ----------
    arm : Arm
    scene : Scene
    model : {"rod"}
    dt : float or "auto", s
        Largest time step; the step in use divides `sample_interval`. ``"auto"`` takes 0.8 of the predicted stability limit, or
        `LARGEST_STEP`.
    sample_interval : float, s
        How often activation is sampled (linear in between) and the motion is checked.
    record_every : int
        Record every so many samples.

    Attributes
    ----------
    time : float, s
    limit : StepLimit
        Predicted largest stable step at rest, and what would grow above it.
    h : float, s
        Time step in use.
    automatic : bool
        Whether `dt` was ``"auto"``. A sample in which the run would stop is then tried again at a half and at a quarter of the step.
    retried : int
        How often that helped.

    Raises
    ------
    OctoctrlError
        If an argument is out of range, or `dt` exceeds the stability limit.
    """

    def __init__(self, arm=None, scene=None, model="rod", *, dt="auto", sample_interval=5e-3, record_every=2):
        self.arm = Arm.octopus() if arm is None else arm
        self.scene = Scene() if scene is None else scene
        check_choice("model", model, MODELS)
        if self.arm.anatomy is not OCTOPUS:
            raise OctoctrlError(f"arm '{self.arm.name}' is not built as an octopus arm, as the one-rod plant is; use AssemblyPlant")
        self.model = model
        check_number("sample_interval", sample_interval, at_least=1e-4, at_most=0.1, unit="s")
        record_every = check_count("record_every", record_every)
        self.sample_interval = sample_interval
        self.record_every = record_every
        self.elements = self.arm.elements
        self.edges = self.arm.edges
        self.stations = np.concatenate([[0.0], (self.edges[1:] + self.edges[:-1]) / 2, [self.arm.length]])
        self.buffer, self.rows = new_buffer(self.elements)
        self._fill_parameters()
        self.reset()
        self.limit = self._limit_at_rest()
        self.steps = max(1, ceil(sample_interval / choose_step(dt, self.limit, LARGEST_STEP) - 1e-9))
        if self.steps > MOST_STEPS:
            raise OctoctrlError(
                f"the arm needs steps of {sample_interval / self.steps:.1g} s, {self.steps} in each sample_interval={sample_interval:g} s; "
                f"at most {MOST_STEPS} are done - use fewer elements or softer tissue"
            )
        self._prepare(sample_interval / self.steps)
        self.automatic, self.retried = dt == "auto", 0

    def _limit_at_rest(self):
        key = self.arm, self.scene
        if key not in _LIMITS:
            _LIMITS[key] = self.step_limit()
        return _LIMITS[key]

    def set_steps(self, steps):
        """Take `steps` steps in each sample, stable or not, and try no others: for studies of stability."""
        self.automatic = False
        self._divide(steps)

    def _divide(self, steps):
        self.steps = steps
        self._prepare(self.sample_interval / steps)

    def _prepare(self, h):
        """Set all that depends on the step."""
        self.h = h
        self._fill_damping()
        self._scalars = self._compiled_scalars()

    def step_limit(self, levels=None):
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
        both, before = np.stack([levels, levels]), getattr(self, "h", None)
        scratch = np.empty((1, n + 1, 3)), np.empty((1, n, 3, 3)), np.empty((1, n))
        found = predict_limit(self.rows, n, self.node_mass, self._prepare, lambda h: self._step(h, 1, both, *scratch))
        if before is not None:
            self._prepare(before)
        return found

    def _fill_parameters(self):
        n, rows, arm = self.elements, self.rows, self.arm
        section = arm.section((self.edges[1:] + self.edges[:-1]) / 2)
        length = np.diff(self.edges)
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
        self.node_mass = node_masses(sum(section.masses) * length)
        rows[Row.NODE_MOBILITY, 1 : n + 2] = 1 / self.node_mass
        self._section = section

    def _fill_damping(self):
        n, rows, water, section = self.elements, self.rows, self.scene.water, self._section
        if water is None:
            set_damping(rows, n, self.h, 0.0, 0.0, 0.0, fixed="clamped", masses=self.node_mass)
            return
        rates = water.factor * np.array([0.0, 0.0, water.ring_rate, water.oblique_rate])
        length = np.diff(self.edges)
        force_rate = node_masses(rates @ np.array(section.masses) * length) / self.node_mass
        spin_rate = rates @ np.array(section.polar_inertias) / sum(section.polar_inertias)
        set_damping(rows, n, self.h, force_rate, spin_rate, spin_rate, fixed="clamped", masses=self.node_mass)
        width = section.muscle_count * section.muscle_radius * length * water.density * water.factor
        rows[Row.DRAG_NORMAL, 1 : n + 2] = node_masses(width) * water.normal_coefficient
        rows[Row.DRAG_TANGENT, 1 : n + 2] = node_masses(width) * water.tangential_coefficient * tau / 2

    def _compiled_scalars(self):
        from ..physics.fibre_kernels import law_constants
        from .stepping import MuscleScalars

        arm = self.arm
        return MuscleScalars(
            hoop_ratio=float(arm.lumped.hoop_ratio),
            winding=tau / arm.oblique_pitch,
            elastic=self.h / 2,
            longitudinal=law_constants(arm.longitudinal),
            oblique=law_constants(arm.oblique, arm.lumped.oblique_passive),
            transverse=law_constants(arm.transverse),
            wet=self.scene.water is not None and self.scene.water.factor > 0,
        )

    def reset(self):
        """Put the arm back to rest at time zero; returns the first `Observation`."""
        points = np.zeros((self.elements + 1, 3))
        points[:, 1] = self.edges
        set_state(self.rows, self.elements, points, np.broadcast_to(REST_FRAME, (self.elements, 3, 3)), REST_FRAME)
        self.samples = 0
        return self.observe()

    @property
    def time(self):
        """Simulated time, s."""
        return self.samples * self.sample_interval

    def observe(self):
        """Positions, frames and stretch now, as an `Observation`."""
        n = self.elements
        points = self.rows[Row.X1 : Row.X3 + 1, 1 : n + 2].T.copy()
        frames = self.rows[Row.Q11 : Row.Q33 + 1, 1 : n + 1].T.reshape(n, 3, 3)
        stretch = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(self.edges)
        return Observation(time=self.time, points=points, frames=self._with_ends(frames), stations=self.stations, stretch=stretch)

    def advance(self, activation, duration, *, progress=None):
        """Move on by `duration` under `activation`.

        Parameters
        ----------
        activation : Activation, or any object with ``levels(times, edges)``
            Levels (T, groups, n) of the groups of the arm's layout, in the plant's own time.
        duration : float, s
            A multiple of `sample_interval`.
        progress : callable, optional
            Called with the simulated seconds done, at the begin and after each chunk.

        Returns
        -------
        Recording
            From now (included) to the end. A KeyboardInterrupt ends it at the last chunk, with ``complete=False``.

        Raises
        ------
        PlantUnstableError
            If the motion diverges; carries the recording up to the last good sample. The plant goes back to the begin of the chunk in
            which it happened, at most `CHUNK` samples earlier.
        OctoctrlError
            If `duration` is not a multiple of the sample interval, or a level leaves [0, 1].
        """
        samples = round(duration / self.sample_interval)
        if samples < 1 or abs(samples * self.sample_interval - duration) > 1e-9:
            raise OctoctrlError(f"duration={duration:g} s: needs a positive multiple of the sample interval {self.sample_interval:g} s")
        pieces = [self._now(self._levels(activation, 0)[0])]
        done, note = 0, ""
        try:
            if progress is not None:
                progress(0.0)
            while done < samples:
                count = min(CHUNK, samples - done)
                levels = self._levels(activation, count)
                pieces.append(self._advance_samples(levels))
                done += count
                if progress is not None:
                    progress(done * self.sample_interval)
        except KeyboardInterrupt:
            note = f"interrupted at t={self.time:.3f} s"
        except PlantUnstableError as error:
            if error.recording is not None:
                pieces.append(error.recording)
            error.recording = self._joined(pieces, str(error))
            raise
        return self._joined(pieces, note)

    def _levels(self, activation, samples):
        times = (self.samples + np.arange(samples + 1)) * self.sample_interval
        return sampled(activation, times, {"arm": self.edges}, self.arm.layout)["arm"]

    @staticmethod
    def _active(levels):
        """Which groups pull in each sample (samples, groups); the others' active laws are left out, which changes no bit."""
        pulls = levels @ np.ones(levels.shape[2]) > 0
        return pulls[1:] | pulls[:-1]

    def _step(self, h, steps, levels, points, frames, stretch):
        """The compiled loop: `steps` of h in each sample -> samples done, finding, element."""
        with BUILDING:
            step = _muscular_advance(stride_for(self.elements), self.arm.layout)
        count, active = np.uint64(self.elements), self._active(levels)
        return step(self.buffer, count, h, steps, levels, active, self._scalars, points, frames, stretch)

    def _advance_samples(self, levels):
        good, first, pieces = self.rows[:STATE_ROWS].copy(), self.samples, []
        while self.samples - first < len(levels) - 1:
            before, rest = self.rows[:STATE_ROWS].copy(), levels[self.samples - first :]
            *motion, finding, element = self._move(rest, self.steps)
            done = len(motion[0])
            pieces.append(self._piece(self.samples, *motion, rest))
            if not finding:
                self.samples += done
                break
            self._return(before, rest[: done + 1])
            finer = self._finer(self.samples + done, rest[done : done + 2]) if self.automatic else None
            if finer is None:
                stop = self._second_look(rest, done, before, finding, element)
                self.rows[:STATE_ROWS], self.samples = good, first
                kept = Recording.joined(pieces)
                raise PlantUnstableError(
                    stop.message(self.h, self.limit),
                    time=stop.time,
                    element=stop.element,
                    mechanism=stop.mechanism,
                    recording=kept.until(stop.time - 0.5 * self.h),
                )
            self.samples += done + 1
            pieces.append(finer)
        return Recording.joined(pieces)

    def _return(self, before, levels):
        """Go to the last instant of `levels` from the state `before` at their first, with the same bits."""
        self.rows[:STATE_ROWS] = before
        if len(levels) > 1:
            self._move(levels, self.steps)

    def _finer(self, index, levels):
        """The sample that stopped, at a half or a quarter of the step, as a piece of the recording; None if it stops there too."""
        before, planned = self.rows[:STATE_ROWS].copy(), self.steps
        try:
            for part in FINER:
                self._divide(planned * part)
                *motion, finding, _ = self._move(levels, self.steps)
                if not finding:
                    self.retried += 1
                    return self._piece(index, *motion, levels)
                self.rows[:STATE_ROWS] = before
        finally:
            self._divide(planned)
        return None

    def _move(self, levels, steps):
        """Take `steps` steps between instants of `levels`; returns points, frames and stretch up to a stop, what it is, and the element."""
        n, samples = self.elements, len(levels) - 1
        points, frames, stretch = np.empty((samples, n + 1, 3)), np.empty((samples, n, 3, 3)), np.empty((samples, n))
        done, finding, element = self._step(self.h, steps, levels, points, frames, stretch)
        return points[:done], frames[:done], stretch[:done], finding, int(element) - 1

    def _second_look(self, levels, done, good, finding, element):
        """Go the last samples again, step by step: where and when it began, and whether the motion alternated."""
        skip = max(0, done - ceil(TRAIL / self.steps))
        self.rows[:STATE_ROWS] = good
        if skip:
            self._move(levels[: skip + 1], self.steps)
        _, frames, _, first_finding, first_element = self._move(substeps(levels[skip : done + 2], self.steps), 1)
        time = (self.samples + skip) * self.sample_interval + (len(frames) + 1) * self.h
        if first_finding:
            finding, element = first_finding, first_element
        share = alternation(frames[:, max(0, element - 1) : element + 2])
        return Stop(time=time, element=element, finding=finding, unstable=None if share is None else share > ALTERNATING)

    def _piece(self, first, points, frames, stretch, levels):
        index = first + 1 + np.arange(len(points))
        keep = index % self.record_every == 0
        return Recording(
            time=index[keep] * self.sample_interval,
            points=points[keep],
            frames=self._with_ends(frames[keep]),
            stations=self.stations,
            stretch=stretch[keep],
            levels=levels[1 : len(points) + 1][keep],
        )

    def _now(self, levels):
        seen = self.observe()
        return Recording(
            time=np.array([seen.time]),
            points=seen.points[None],
            frames=seen.frames[None],
            stations=self.stations,
            stretch=seen.stretch[None],
            levels=levels[None],
        )

    @staticmethod
    def _joined(pieces, note):
        return replace(Recording.joined(pieces), complete=not note, note=note)

    def _with_ends(self, frames):
        """Frames (..., n, 3, 3) of elements with those of base and tip, the latter turned on by half an element of the last curvature."""
        length = np.diff(self.edges)
        share = length[-1] / (length[-1] + length[-2])
        last = frames[..., -1, :, :] @ np.swapaxes(frames[..., -2, :, :], -1, -2)
        tip = rotation_matrix(share * rotation_vector(last)) @ frames[..., -1, :, :]
        base = np.broadcast_to(REST_FRAME, (*frames.shape[:-3], 1, 3, 3))
        return np.concatenate([base, frames, tip[..., None, :, :]], axis=-3)

    def save(self, path):
        """Write the state to an ``.npz`` file; `load` continues from it bit by bit.

        Raises
        ------
        OctoctrlError
            If the file's suffix is not ``.npz``.
        """
        if Path(path).suffix != ".npz":
            raise OctoctrlError(f"unknown format '{Path(path).suffix}'; use .npz")
        np.savez(path, **self._state(), **self._identity(), samples=self.samples)

    def load(self, path):
        """Read a state written by `save`.

        Raises
        ------
        OctoctrlError
            If it belongs to another model, arm, resolution or step.
        """
        with np.load(path) as data:
            for name, mine in self._identity().items():
                found = data[name] if name in data else "of another model"
                if found != mine:
                    raise OctoctrlError(f"{path}: state has {name}={found}, this plant {name}={mine}; make the plant as it was when saved")
            self._restore(data)
            self.samples = int(data["samples"])
        return self.observe()

    def _identity(self):
        """What a saved state must share with the plant that goes on from it."""
        arm = self.arm
        return {"model": self.model, "arm": arm.fingerprint, "grading": arm.grading, "elements": self.elements, "steps": self.steps}

    def _state(self):
        """Arrays that hold the whole motion, by name."""
        return {"state": self.rows[:STATE_ROWS, : self.elements + 2]}

    def _restore(self, data):
        """Take up the arrays of `_state`."""
        self.rows[:STATE_ROWS, : self.elements + 2] = data["state"]
