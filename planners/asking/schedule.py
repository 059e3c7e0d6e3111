"""A schedule: primitives in order, as one activation."""

from dataclasses import dataclass

from octoctrl.sim.activation import COMPOSITIONS, SATURATIONS, Activation
from octoctrl.sim.annotations import settle
from octoctrl.sim.errors import OctoctrlError, check_choice, check_number

from ..contracts import Primitive
from .registry import primitive_kinds


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """An ordered composition of primitives.

    Attributes
    ----------
    primitives : tuple of Primitive
    duration : float, s
    composition : {"override", "handover", "max", "add"}
        How activations that meet in one place combine; see `octoctrl.sim.activation.Activation`.
    on_saturation : {"error", "clip"}
        What to do where that exceeds 1.

    Raises
    ------
    OctoctrlError
        If there is no primitive, something else than one, or the duration is not positive.
    """

    primitives: tuple[Primitive, ...]
    duration: float
    composition: str = "override"
    on_saturation: str = "error"

    def __post_init__(self) -> None:
        settle(self)
        if not self.primitives:
            raise OctoctrlError(
                f"no primitives given; pass at least one or leave it out for the task's default ({', '.join(primitive_kinds())})"
            )
        for primitive in self.primitives:
            check_primitive("schedule", primitive)
        check_number("duration", self.duration, above=0.0, unit="s")
        check_choice("composition", self.composition, COMPOSITIONS)
        check_choice("on_saturation", self.on_saturation, SATURATIONS)

    def activation(self) -> Activation:
        """The activation of the whole schedule."""
        templates = tuple(template for primitive in self.primitives for template in primitive.templates())
        return Activation(templates=templates, composition=self.composition, on_saturation=self.on_saturation)


def check_primitive(owner: str, primitive: object) -> None:
    """Check that something is a primitive.

    Parameters
    ----------
    owner : str
        Whose it is, for the message.
    primitive : object

    Raises
    ------
    OctoctrlError
        If it lacks a method of `octoctrl.planners.contracts.Primitive`.
    """
    missing = [name for name in ("templates", "bounds", "effort") if not callable(getattr(primitive, name, None))]
    if missing:
        raise OctoctrlError(
            f"{owner}: {primitive!r} is no primitive, it has no {' and no '.join(missing)} ({', '.join(primitive_kinds())})"
        )
