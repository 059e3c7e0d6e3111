"""What a searched plan must withstand: muscles that do more or less than planned, an object that stands elsewhere, more or less friction.

A plan that was searched for one scenario holds in no other. So every candidate is judged in several, and by the worst of them as much as
by their mean.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.scene.scene import Scene

from ..contracts import Primitive

Floats = NDArray[np.float64]

SHIFT = 2.5e-3
"""How far an object stands from where it was taken to stand, m."""

ERRORS = ("twist", "bend", "profile", "oblique")
"""What of a plan may come out otherwise, as `four` takes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One way in which the world may differ from the plan.

    Attributes
    ----------
    twist, bend : float
        Factors on turns that are stored, and on levels that bend.
    profile : float
        What is added to the profile of a bend along the arm.
    oblique : float
        Factor on what the oblique muscles pull with, which tells also where they are asked for all that they have.
    friction : float
        Factor on both coefficients of the objects that are held.
    shift : (float, float, float), m
        By which these stand elsewhere.
    """

    twist: float = 1.0
    bend: float = 1.0
    profile: float = 0.0
    oblique: float = 1.0
    friction: float = 1.0
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def primitive(self, planned: Primitive) -> Primitive:
        """What becomes of a planned primitive."""
        known = {item.name for item in fields(planned)}  # type: ignore[arg-type]
        numbers: Any = planned
        changes: dict[str, float] = {}
        if "turns" in known:
            changes["turns"] = numbers.turns * self.twist
        elif "level" in known:
            changes["level"] = min(numbers.level * self.bend, 1.0)
        if "profile" in known:
            changes["profile"] = max(numbers.profile + self.profile, -1.0)
        changed: Primitive = replace(numbers, **changes)
        return changed

    def arm(self, planned: Arm) -> Arm:
        """What becomes of a planned arm."""
        return planned if self.oblique == 1 else replace(planned, oblique=planned.oblique.stronger(self.oblique))

    def scene(self, planned: Scene, held: set[str]) -> Scene:
        """What becomes of a planned scene, in which the objects by the names `held` are to be held."""

        def moved(item: Any) -> Any:
            if item.name not in held:
                return item
            x, y, z = np.add(item.position, self.shift)
            static, kinetic = item.friction
            return replace(item, position=(float(x), float(y), float(z)), friction=(self.friction * static, self.friction * kinetic))

        return replace(planned, objects=tuple(map(moved, planned.objects)))


PLANNED = Scenario()
"""All is as planned."""


def four(
    draw: np.random.Generator, *, twist: float = 0.3, bend: float = 0.15, profile: float = 0.25, oblique: float = 0.0
) -> tuple[Scenario, ...]:
    """The scenario as planned and three others.

    Parameters
    ----------
    draw : Generator
        Of the directions in which objects are shifted.
    twist, bend, profile, oblique : float
        How far off these are at most.
    """

    def off(share: float, bent: float, **other: float) -> Scenario:
        sign = 1 if bent > 0 else -1
        return Scenario(
            twist=1 + share * twist, oblique=1 + share * oblique, bend=1 + bent * bend, profile=-sign * profile, shift=_aside(draw), **other
        )

    return PLANNED, off(1, 1, friction=2.0), off(-1, -1, friction=0.5), off(2 / 3, -0.87)


def _aside(draw: np.random.Generator) -> tuple[float, float, float]:
    direction = draw.normal(size=3)
    x, y, z = SHIFT * direction / np.linalg.norm(direction)
    return float(x), float(y), float(z)
