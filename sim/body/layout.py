"""The muscle layout as data: which groups can be activated, of which family, and where they run.

Everything that differs between groups is read from here: the rod's compiled loop, the section's areas, the levels of an assembly. Another
layout is another `MuscleLayout`, given by an arm's property `layout`:

    class Hexapus(Arm):
        layout = MuscleLayout.evenly(6)

"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from itertools import combinations
from math import cos, sin, tau

import numpy as np
from numpy.typing import NDArray

from ..annotations import settle
from ..errors import OctoctrlError, check_choice, check_count, check_number


class Family(IntEnum):
    """What the fibres of a group run along."""

    LONGITUDINAL = 0
    OBLIQUE = 1
    TRANSVERSE = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class MuscleGroup:
    """Fibres that are activated together.

    Attributes
    ----------
    name : str
    family : Family
    azimuth : float, rad
        Of a longitudinal muscle, from +x (d2) towards +z (d1).
    hand : {0, 1, -1}
        Of an oblique family: 1 winds like a right-handed screw (its contraction gives negative twist), -1 like a left-handed one.

    Raises
    ------
    OctoctrlError
        If an oblique group has no hand, or another one has.
    """

    name: str
    family: Family
    azimuth: float = 0.0
    hand: int = 0

    def __post_init__(self) -> None:
        settle(self)
        check_number(f"{self.name}: azimuth", self.azimuth, unit="rad")
        check_count(f"{self.name}: hand", self.hand, at_least=-1, at_most=1)
        allowed = (1, -1) if self.family is Family.OBLIQUE else (0,)
        if self.hand not in allowed:
            raise OctoctrlError(f"{self.name}: hand={self.hand}; oblique groups have hand 1 or -1, all others 0")

    @property
    def place(self) -> tuple[float, float]:
        """What tells a group from its family in the compiled loop: sine and cosine of the azimuth, or the hand and zero."""
        if self.family is Family.LONGITUDINAL:
            return sin(self.azimuth), cos(self.azimuth)
        return float(self.hand), 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MuscleLayout:
    """The muscle groups of an arm, in the order of every array indexed by group.

    Attributes
    ----------
    groups : tuple of MuscleGroup

    Raises
    ------
    OctoctrlError
        If two groups have one name or two oblique groups one hand, if there are fewer than three longitudinal muscles, or not exactly one
        transverse group.
    """

    groups: tuple[MuscleGroup, ...]

    def __post_init__(self) -> None:
        settle(self)
        names = self.names
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise OctoctrlError(f"two muscle groups are called {twice}; give each its own name")
        for first, second in combinations(self.oblique, 2):
            if first.hand == second.hand:
                raise OctoctrlError(
                    f"oblique groups {first.name} and {second.name} have one hand, {first.hand}: at most one group of each hand is possible"
                )
        if len(self.longitudinal) < 3:
            raise OctoctrlError(f"{len(self.longitudinal)} longitudinal muscles: at least 3 are needed around the nerve cord")
        rings = self.of(Family.TRANSVERSE)
        if len(rings) != 1:
            raise OctoctrlError(f"{len(rings)} transverse groups: exactly 1 is needed")

    @classmethod
    def evenly(cls, muscles: int, *, oblique: bool = True) -> "MuscleLayout":
        """So many longitudinal muscles LM1, LM2, ... evenly around the axis, the first at +x; both oblique families or none; TM.

        Parameters
        ----------
        muscles : int
        oblique : bool
        """
        groups = [MuscleGroup(name=f"LM{index + 1}", family=Family.LONGITUDINAL, azimuth=index * tau / muscles) for index in range(muscles)]
        if oblique:
            groups += [MuscleGroup(name=f"{letter}-OM", family=Family.OBLIQUE, hand=hand) for letter, hand in (("R", 1), ("L", -1))]
        return cls(groups=(*groups, MuscleGroup(name="TM", family=Family.TRANSVERSE)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all groups, in order."""
        return tuple(group.name for group in self.groups)

    def of(self, family: Family) -> tuple[MuscleGroup, ...]:
        """The groups of a family, in order."""
        return tuple(group for group in self.groups if group.family is family)

    @property
    def longitudinal(self) -> tuple[MuscleGroup, ...]:
        """The longitudinal muscles."""
        return self.of(Family.LONGITUDINAL)

    @property
    def oblique(self) -> tuple[MuscleGroup, ...]:
        """The oblique families."""
        return self.of(Family.OBLIQUE)

    @property
    def transverse(self) -> MuscleGroup:
        """The transverse group."""
        return self.of(Family.TRANSVERSE)[0]

    def __len__(self) -> int:
        return len(self.groups)

    def __getitem__(self, name: str) -> MuscleGroup:
        return self.groups[self.index(name)]

    def index(self, name: str) -> int:
        """Place of a group in arrays.

        Raises
        ------
        OctoctrlError
            If there is no group of that `name`.
        """
        check_choice("muscle group", name, self.names)
        return self.names.index(name)

    def indices(self, groups: Iterable[MuscleGroup]) -> list[int]:
        """Places of some of the `groups` in arrays."""
        return [self.groups.index(group) for group in groups]

    @property
    def families(self) -> NDArray[np.int64]:
        """Family of every group (G,)."""
        return np.array([int(group.family) for group in self.groups])

    @property
    def places(self) -> NDArray[np.float64]:
        """`MuscleGroup.place` of every group (G, 2)."""
        return np.array([group.place for group in self.groups])


OCTOPUS_MUSCLES = MuscleLayout.evenly(8)
"""Eight longitudinal muscles, two oblique families of four helices each, transverse muscle."""
