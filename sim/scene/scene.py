"""The scene: the water that the arm moves in. What a scene does not name costs nothing."""

from dataclasses import dataclass, field

from ..annotations import settle
from ..errors import check_number
from .loads import Load, PointLoad, SpreadLoad, checked_loads
from .objects import RigidObject
from .shapes import checked_objects

SELF_CONTACT = "self contact"
"""Name, in the series of a recording, of what the arm does to itself, see `octoctrl.sim.contact.folds.Folds`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Water:
    """Resistance of water and of the tissue's own layers.

    Two parts, as in the source study: a force quadratic in the velocity on each of the eight longitudinal muscles, normal and tangential,
    and a linear rate on the two outer layers. Rates are physical (per second, per mass) and do not depend on the time step.

    Attributes
    ----------
    density : float, kg/m^3
    normal_coefficient, tangential_coefficient : float
        Quadratic drag coefficients on projected width and wetted perimeter (Yekutieli et al. 2005).
    ring_rate, oblique_rate : float, 1/s
        Linear drag rates of the transverse and oblique layers.
    factor : float
        One factor on all of the above, for studies of model error.
    """

    density: float = 1050.0
    normal_coefficient: float = 1.013
    tangential_coefficient: float = 0.0256
    ring_rate: float = 250 / 12
    oblique_rate: float = 125.0
    factor: float = 1.0

    def __post_init__(self) -> None:
        for name, most, unit in (
            ("density", 1e5, "kg/m^3"), ("normal_coefficient", 1e3, ""), ("tangential_coefficient", 1e3, ""), ("ring_rate", 1e6, "1/s"),
            ("oblique_rate", 1e6, "1/s"), ("factor", 1e6, ""),
        ):  # fmt: skip
            check_number(name, getattr(self, name), at_least=0.0, at_most=most, unit=unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Everything around the arm.

    Attributes
    ----------
    water : Water or None
        None is a vacuum.
    loads : tuple of Load
        Forces and torques on the arm from outside, see `octoctrl.sim.scene.loads`.
    objects : tuple of RigidObject
        What the arm may touch, see `octoctrl.sim.scene.objects`.
    self_contact : bool
        Whether the arm touches itself, without friction; otherwise it passes through itself, as coils do that are told by their link.

    Raises
    ------
    OctoctrlError
        If something else than a load is among the loads, or something else than an object, or a name twice, among the objects.
    """

    water: Water | None = field(default=Water())
    loads: tuple[PointLoad | SpreadLoad | Load, ...] = ()
    objects: tuple[RigidObject, ...] = ()
    self_contact: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "loads", checked_loads(self.loads))
        object.__setattr__(self, "objects", checked_objects(self.objects))
        settle(self)

    @classmethod
    def free(cls, *, loads: tuple[Load, ...] = (), **water: float) -> "Scene":
        """An arm alone in water, with `loads` or none; further keywords change fields of `Water`."""
        return cls(water=Water(**water), loads=loads)


def self_contact(scene: Scene) -> str:
    """Whether the arm touches itself, as headers say it."""
    return f"self-contact {'on' if scene.self_contact else 'off'}"
