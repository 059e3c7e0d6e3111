"""Rows of a flat buffer, numbered from zero in the order in which they are named."""

from enum import IntEnum
from typing import Any


class Rows(IntEnum):
    """Base of the tables of rows of a plant's buffer: ``auto()`` counts from zero."""

    @staticmethod
    def _generate_next_value_(name: str, start: int, count: int, last_values: list[Any]) -> int:
        return count
