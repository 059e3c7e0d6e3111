"""The objects of a scene during a run: from their rest through releases to what is recorded of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contracts import Motion, joined
from ..errors import OctoctrlError
from ..scene.objects import RigidObject
from ..scene.supports import Free
from .bodies import release
from .columns import Anchor, Body
from .measures import gaps
from .world import Nodes, Points, World

Floats = NDArray[np.float64]

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
            position=note[:, Body.POSITION : Body.POSITION + 3],
            frame=note[:, Body.FRAME : Body.FRAME + 9].reshape(-1, 3, 3),
            velocity=note[:, Body.VELOCITY : Body.VELOCITY + 3],
            force=note[:, Body.IMPULSE : Body.IMPULSE + 3],
            couple=note[:, Body.COUPLE : Body.COUPLE + 3],
            normal_force=note[:, Body.NORMAL],
            deepest=note[:, Body.DEEPEST],
            loaded=note[:, Body.LOADED],
            slip=note[:, Body.SLIPPED],
        )


class Surroundings:
    """Bodies and anchors of a run.

    Parameters
    ----------
    objects : sequence of RigidObject
        At least one.
    points : Points or Nodes
        Of the arm.
    water_density : float, kg/m^3
    """

    def __init__(self, objects: Sequence[RigidObject], points: Points | Nodes, *, water_density: float = 0.0) -> None:
        self.objects, self.points, self.water_density = tuple(objects), points, water_density
        self.rest()

    def rest(self) -> None:
        """Put every object where it begins, untouched."""
        self.world = World.of(self.points, self.objects, water_density=self.water_density)

    def check(self, places: Floats) -> None:
        """Check that no object overlaps the arm whose points are at `places` (P, 3), m.

        Raises
        ------
        OctoctrlError
            If one does; the message names it, the depth and the place.
        """
        for item in self.objects:
            frame = self.world.bodies[self.objects.index(item), Body.FRAME : Body.FRAME + 9].reshape(1, 3, 3)
            gap = gaps(places[None], item, np.array([item.position]), frame)[0] - self.points.radius
            worst = int(gap.argmin())
            if gap[worst] < 0:
                where = ", ".join(f"{value:.3g}" for value in places[worst])
                raise OctoctrlError(
                    f"object '{item.name}' overlaps the arm at rest by {-1e3 * gap[worst]:.2g} mm, near ({where}) m; "
                    "move it or make it smaller"
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
            self.release(first + done, sample)
            free = self.before_release(first + done, sample)
            motions.append(go(slice(done, (samples if free is None else min(samples, done + free)) + 1)))
            done += len(motions[-1].points)
            if motions[-1].finding:
                break
        return joined(motions)

    def before_release(self, first: int, sample: float) -> int | None:
        """Samples from number `first` to the next release of an object; None if there is none."""
        due = [
            max(round(item.support.since / sample), first) - first
            for item, body in zip(self.objects, self.world.bodies, strict=True)
            if isinstance(item.support, Free) and body[Body.INVERSE_MASS] == 0
        ]
        return min(due, default=None)

    def release(self, first: int, sample: float) -> None:
        """Let go of the objects whose time has come at sample number `first`."""
        for item, body in zip(self.objects, self.world.bodies, strict=True):
            held = isinstance(item.support, Free) and body[Body.INVERSE_MASS] == 0
            if held and round(item.support.since / sample) <= first:  # type: ignore[union-attr]
                release(body, item, self.water_density)

    def series(self, world: World) -> dict[str, Floats]:
        """What `world` has notes of, by name of the object: to be read as a `Touch`."""
        return {f"{PREFIX}{item.name}": world.notes[:, index] for index, item in enumerate(self.objects)}

    def now(self) -> dict[str, Floats]:
        """What is to be noted of the present instant, by name of the object."""
        notes, forces = self.world.bodies.copy(), self.world.anchors[..., Anchor.NORMAL]
        notes[:, Body.NORMAL], notes[:, Body.LOADED] = forces.sum(axis=1), (forces > 0).sum(axis=1)
        return {f"{PREFIX}{item.name}": note for item, note in zip(self.objects, notes, strict=True)}

    def state(self) -> dict[str, Floats]:
        """Copies of the arrays that hold all of it."""
        return {"bodies": self.world.bodies.copy(), "anchors": self.world.anchors.copy()}

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Go back to a `state`."""
        self.world.bodies[:], self.world.anchors[:] = state["bodies"], state["anchors"]
