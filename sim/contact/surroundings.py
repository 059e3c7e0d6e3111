"""The objects of a scene during a run: from their rest through releases to what is recorded of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from ..contracts import Motion, joined
from ..errors import OctoctrlError
from ..findings import Finding
from ..scene.objects import BEARABLE, RigidObject, frame_of
from ..scene.supports import Free, Springs
from .bodies import notes_of, release
from .columns import Anchor, Body, Note
from .markers import markers_of
from .measures import gaps
from .world import Nodes, Points, World

Floats = NDArray[np.float64]

EXPLAINED = 1e-3
"""Share of the arm's radius at the base, of `BEARABLE`, that is left to what the spring of a contact explains."""
ROUNDING = 1e-6
"""Overlap (m) of two objects that counts as touching."""
FASTEST = 10.0
"""Speed (m/s) of an object beyond which nothing is certain any more, as of the arm."""
PREFIX = "touch "
"""Before the names of objects in the series of a recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One object over a recording, T instants.

    Attributes
    ----------
    position, velocity : (T, 3) float64, m, m/s
    frame : (T, 3, 3) float64
        Directors, rows.
    force, couple : (T, 3) float64, N, N m
        From the arm on the object about its centre, mean of the sample before.
    normal_force : (T,) float64, N
        Sum of the sizes of the normal forces, mean of the sample.
    deepest : (T,) float64, m
        Largest overlap within the sample.
    loaded : (T,) float64
        Points of the arm that lie on it, mean of the sample.
    slip : (T,) float64, m
        Largest path slid by a point since it first touched.
    """

    position: Floats
    frame: Floats
    velocity: Floats
    force: Floats
    couple: Floats
    normal_force: Floats
    deepest: Floats
    loaded: Floats
    slip: Floats

    @classmethod
    def of(cls, series: Mapping[str, Floats], name: str) -> "Touch":
        """The object called `name` of the `series` of a recording.

        Raises
        ------
        OctoctrlError
            If nothing of it was recorded.
        """
        if PREFIX + name not in series:
            known = [key.removeprefix(PREFIX) for key in series if key.startswith(PREFIX)]
            raise OctoctrlError(f"no object '{name}' was recorded; there are: {', '.join(known) or 'none'}")
        note = series[PREFIX + name]
        return cls(
            position=note[:, Note.POSITION : Note.POSITION + 3],
            frame=note[:, Note.FRAME : Note.FRAME + 9].reshape(-1, 3, 3),
            velocity=note[:, Note.VELOCITY : Note.VELOCITY + 3],
            force=note[:, Note.FORCE : Note.FORCE + 3],
            couple=note[:, Note.COUPLE : Note.COUPLE + 3],
            normal_force=note[:, Note.NORMAL],
            deepest=note[:, Note.DEEPEST],
            loaded=note[:, Note.LOADED],
            slip=note[:, Note.SLIPPED],
        )


class Surroundings:
    """Bodies and anchors of a run.

    Parameters
    ----------
    objects : sequence of RigidObject
        At least one.
    points : Points or Nodes
        Of the arm.
    thickness : float, m
        Radius of the arm at its base.
    water_density : float, kg/m^3
    """

    def __init__(
        self, objects: Sequence[RigidObject], points: Points | Nodes, *, thickness: float = inf, water_density: float = 0.0
    ) -> None:
        self.objects, self.points, self.thickness, self.water_density = tuple(objects), points, thickness, water_density
        self._step = 0.0
        self._changing = [number for number, item in enumerate(self.objects) if _times(item)]
        self.rest()

    def rest(self) -> None:
        """Put every object where it begins, untouched."""
        bearable = (BEARABLE - EXPLAINED) * self.thickness
        self.world = World.of(self.points, self.objects, water_density=self.water_density, bearable=bearable, step=self._step)

    def start(self, step: float) -> None:
        """Set all that depends on the `step`, s."""
        self._step = step
        for item, body in zip(self.objects, self.world.bodies, strict=True):
            if isinstance(item.support, Springs):
                release(body, item, self.water_density, step)

    def check(self, places: Floats) -> None:
        """Check that nothing overlaps the arm whose points are at `places` (P, 3), m, or what can be moved.

        Objects that stay where they are may overlap one another: together they are one of another shape.

        Raises
        ------
        OctoctrlError
            If something does; the message names it, the depth and the place.
        """
        for item in self.objects:
            depth, where = _overlap(places, self.points.radius, item)
            if depth > 0:
                raise OctoctrlError(
                    f"object '{item.name}' overlaps the arm at rest by {_millimetres(depth)}, near {where} m; move it or make it smaller"
                )
        for small, large in self.world.pairs.pairs:
            one, other = self.objects[small], self.objects[large]
            rows = markers_of(one)
            depth, where = _overlap(np.asarray(one.position) + rows[:, :3] @ frame_of(one), rows[:, 3], other)
            if depth > ROUNDING:
                raise OctoctrlError(
                    f"object '{one.name}' overlaps object '{other.name}' by {_millimetres(depth)}, near {where} m; move one of them"
                )

    def moved(self, first: int, samples: int, sample: float, go: Callable[[slice], Motion]) -> Motion:
        """Go over so many samples of that many seconds, from number `first` on; objects are let go between two calls.

        Parameters
        ----------
        first, samples : int
        sample : float, s
        go : callable
            Moves over a part of the instants, samples + 1 of them.

        Returns
        -------
        Motion
            Of all parts.
        """
        motions: list[Motion] = []
        done = 0
        while done < samples:
            self.change(first + done, sample)
            left = self.before_change(first + done, sample)
            motions.append(self._followed(go(slice(done, (samples if left is None else min(samples, done + left)) + 1))))
            done += len(motions[-1].points)
            if motions[-1].finding:
                break
        return joined(motions)

    def _followed(self, motion: Motion) -> Motion:
        """A `motion` up to where the first object goes astray, if one does: nobody would see it pass through the arm."""
        for item, body in zip(self.objects, self.world.bodies, strict=True):
            if not body[Body.MOVING]:
                continue
            notes = motion.series[PREFIX + item.name]
            speed = np.linalg.norm(notes[:, Note.VELOCITY : Note.VELOCITY + 3], axis=1)
            astray = ~((speed < FASTEST) & np.isfinite(notes[:, : Note.VELOCITY]).all(axis=1))
            if astray.any():
                motion = motion.until(int(astray.argmax()))
                motion = motion._replace(finding=Finding.ASTRAY, rod=f"object '{item.name}'")
        return motion

    def before_change(self, first: int, sample: float) -> int | None:
        """Samples from number `first` to where an object is let go, or a push begins or ends; None if there is no such."""
        changes = {round(time / sample) for index in self._changing for time in _times(self.objects[index])}
        return min((number - first for number in changes if number > first), default=None)

    def change(self, first: int, sample: float) -> None:
        """Let go of the objects whose time has come at sample number `first`, and begin or end what pushes them."""
        for item, body in ((self.objects[index], self.world.bodies[index]) for index in self._changing):
            support = item.support
            if isinstance(support, Free) and body[Body.INVERSE_MASS] == 0 and round(support.since / sample) <= first:
                release(body, item, self.water_density)
            if first in {round(time / sample) for time in _times(item)}:
                acting = [push.force for push in item.pushes if _number(push.since, sample) <= first < _number(push.until, sample)]
                body[Body.PUSH : Body.PUSH + 3] = np.sum(acting, axis=0) if acting else 0.0

    def series(self, world: World) -> dict[str, Floats]:
        """What `world` has notes of, by name of the object: to be read as a `Touch`."""
        return {f"{PREFIX}{item.name}": notes for item, notes in zip(self.objects, world.kept(), strict=True)}

    def now(self) -> dict[str, Floats]:
        """What is to be noted of the present instant, by name of the object."""
        bodies, forces = self.world.bodies, self.world.anchors[..., Anchor.NORMAL]
        notes = notes_of(bodies)
        notes[:, Note.NORMAL], notes[:, Note.LOADED] = forces.sum(axis=1), (forces > 0).sum(axis=1)
        return {f"{PREFIX}{item.name}": note for item, note in zip(self.objects, notes, strict=True)}

    def state(self) -> dict[str, Floats]:
        """Copies of the arrays that hold all of it."""
        world = self.world
        return {"bodies": world.bodies[:, : Body.WIDTH].copy(), "anchors": world.anchors.copy(), "between": world.pairs.anchors.copy()}

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Go back to a `state`."""
        world = self.world
        world.bodies[:, : Body.WIDTH], world.anchors[:], world.pairs.anchors[:] = state["bodies"], state["anchors"], state["between"]


def _times(item: RigidObject) -> list[float]:
    """When an object is let go, and pushes on it begin and end, s."""
    times = [item.support.since] if isinstance(item.support, Free) and item.support.since > 0 else []
    return times + [time for push in item.pushes for time in (push.since, push.until) if isfinite(time)]


def _number(time: float, sample: float) -> float:
    """Number of the sample at a `time` (s), which may be never."""
    return round(time / sample) if isfinite(time) else time


def _millimetres(length: float) -> str:
    """A `length`, m, to two digits."""
    return f"{float(f'{1e3 * length:.2g}'):g} mm"


def _overlap(places: Floats, radius: Floats, item: RigidObject) -> tuple[float, str]:
    """How deep balls at `places` (P, 3) lie in an object at its begin, m, and where the deepest is."""
    gap = gaps(places[None], item, np.array([item.position]), frame_of(item)[None])[0] - radius
    worst = int(gap.argmin())
    return -float(gap[worst]), f"({', '.join(f'{value:.3g}' for value in places[worst])})"
