"""Shares of the arm: arclengths and lengths that are known once the arm is, so that one task fits many arms."""

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

from octoctrl.sim.errors import OctoctrlError, check_number

from .registry import register_part

Item = TypeVar("Item")


@register_part
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Share:
    """A share of the arm's rest length, in place of a length in metres.

    Attributes
    ----------
    percent : float
        Of the arm.
    """

    percent: float

    def __post_init__(self) -> None:
        check_number("share of the arm", self.percent, at_least=-1000.0, at_most=1000.0, unit="%")

    def __str__(self) -> str:
        return f"{self.percent:g} %"

    def __repr__(self) -> str:
        return f"{self} of the arm"

    def __float__(self) -> float:
        raise OctoctrlError(f"{self!r} is no length before the arm is known; take task.on(arm)")


Length = float | Share
"""Metres, or a share of the arm."""


def unresolved(item: object) -> bool:
    """Whether an object holds shares of the arm: its lengths are not known yet and cannot be checked."""
    if isinstance(item, Share):
        return True
    if is_dataclass(item):
        return any(unresolved(getattr(item, entry.name)) for entry in fields(item))
    return isinstance(item, tuple) and any(map(unresolved, item))


def resolved(item: Item, length: float) -> Item:
    """An object with all shares in it turned into metres; the same object if it holds none.

    Parameters
    ----------
    item : dataclass, tuple or anything else
    length : float, m
        Of the arm.
    """
    made: Any = item
    if isinstance(item, Share):
        made = item.percent * length / 100
    elif isinstance(item, tuple) and unresolved(item):
        made = tuple(resolved(inner, length) for inner in item)
    elif is_dataclass(item) and unresolved(item):
        values = {entry.name: getattr(item, entry.name) for entry in fields(item)}
        made = replace(item, **{name: resolved(value, length) for name, value in values.items() if unresolved(value)})  # type: ignore[type-var]
    found: Item = made
    return found
