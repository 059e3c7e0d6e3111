"""Tables that users may add to, by name: plants, controllers, primitives, goals, what files may hold."""

from typing import Any, TypeVar

from .errors import OctoctrlError

Item = TypeVar("Item")


def enter(table: dict[str, Any], what: str, name: str, item: Item) -> Item:
    """Enter an item of a user's own into a table.

    Parameters
    ----------
    table : dict of str to item
    what : str
        What its items are, for the message.
    name : str
    item : object
        The same may come twice; so may a class of the same name, from a module that is loaded again.

    Returns
    -------
    object
        The item.

    Raises
    ------
    OctoctrlError
        If the name belongs to another.
    """
    other = table.get(name, item)
    if other is not item and not (isinstance(item, type) and _origin(other) == _origin(item)):
        raise OctoctrlError(f"a {what} called '{name}' exists already; choose another name")
    table[name] = item
    return item


def _origin(item: Any) -> tuple[str, str]:
    """Where a class was written."""
    return getattr(item, "__module__", ""), getattr(item, "__qualname__", "")
