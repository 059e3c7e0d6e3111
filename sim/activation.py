"""Activation a(t, s, group) in [0, 1]: templates composed explicitly."""

from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .annotations import settle
from .body.layout import OCTOPUS_MUSCLES, MuscleLayout
from .errors import OctoctrlError, check_choice
from .templates import Template, timing

Floats = NDArray[np.float64]

COMPOSITIONS = ("override", "handover", "max", "add")
SATURATIONS = ("error", "clip")


@dataclass(frozen=True, slots=True, kw_only=True)
class Activation:
    """A composition of templates.

    Attributes
    ----------
    templates : tuple of Template
        In order; with ``composition="override"`` the last one that writes a place wins; with ``"handover"`` a later one takes over from
        the level that it finds, within its own rise, and gives back what lies beneath as it falls, so that levels stay smooth in time and
        in every number.
    composition : {"override", "handover", "max", "add"}
    on_saturation : {"error", "clip"}
        What to do where the composition exceeds 1.
    layout : MuscleLayout
        Of the arm that is activated: names and order of the groups.

    Raises
    ------
    OctoctrlError
        If a name is unknown.
    """

    templates: tuple[Template, ...] = ()
    composition: str = "override"
    on_saturation: str = "error"
    layout: MuscleLayout = field(default=OCTOPUS_MUSCLES, repr=False)

    def __post_init__(self) -> None:
        settle(self)
        for template in self.templates:
            for group in template.groups:
                check_choice("muscle group", group, self.layout.names)
        check_choice("composition", self.composition, COMPOSITIONS)
        check_choice("on_saturation", self.on_saturation, SATURATIONS)

    @property
    def groups(self) -> tuple[str, ...]:
        """The muscle groups that are ever activated, in the order of the layout."""
        used = {group for template in self.templates for group in template.groups}
        return tuple(group for group in self.layout.names if group in used)

    def compose(
        self, math: Any, group: str, time: Any, lower: Any, upper: Any, known: dict[Any, Any] | None = None, ahead: Any = 0.0
    ) -> Any:
        """Mean activation of `group` in the cells [lower, upper] at `time`, with the module `math`; not checked for saturation.

        A dict `known` keeps what the groups of a template share, and templates that differ by their levels, and groups whose templates
        are the same. The clock of what travels is `ahead`, s.
        """
        known = {} if known is None else known
        here = tuple(index for index, template in enumerate(self.templates) if group in template.groups)
        if here in known:
            return known[here]
        total = 0.0 * (time + lower)
        for index in here:
            template = self.templates[index]
            if index not in known:
                clock = time + ahead if template.travels else time
                if (kin := timing(template)) not in known:
                    known[kin] = template.shape(math, clock, lower, upper), template.coverage(lower, upper)
                shape, coverage = known[kin]
                weight = template.weight(math, clock, lower, upper, shape) if self.composition == "handover" else None
                known[index] = template.values(math, clock, lower, upper, shape), coverage, weight
            value, coverage, weight = known[index]
            if self.composition == "add":
                total = total + coverage * value
            elif self.composition == "handover":
                total = (1 - coverage * weight) * total + coverage * value
            elif self.composition == "max":
                total = math.fmax(total, coverage * value)
            else:
                where = np.where if math is np else math.if_else
                total = where(template.wrote(math, value), coverage * value + (1 - coverage) * total, total)
        known[here] = total
        return total

    def levels(self, times: ArrayLike, edges: ArrayLike, ahead: ArrayLike = 0.0) -> Floats:
        """Cell averages of every group.

        Parameters
        ----------
        times : (T,) float64, s
        edges : (n + 1,) float64, m
            Arclengths that bound the cells.
        ahead : float or (T,) float64, s
            By how much the clock of templates that travel is ahead.

        Returns
        -------
        (T, groups, n) float64

        Raises
        ------
        OctoctrlError
            If a level leaves [0, 1] and `on_saturation` is ``"error"``.
        """
        times, edges = np.asarray(times, dtype=float), np.asarray(edges, dtype=float)
        clocks, early = times[:, None], np.asarray(ahead, dtype=float)[..., None]
        levels = np.zeros((times.size, len(self.layout), edges.size - 1))
        known: dict[Any, Any] = {}
        for group in self.groups:
            levels[:, self.layout.index(group)] = self.compose(np, group, clocks, edges[:-1], edges[1:], known, early)
        if levels.max(initial=0.0) > 1 + 1e-12 and self.on_saturation == "error":
            self._raise_saturated(levels, times, edges)
        return np.clip(levels, 0.0, 1.0, out=levels)

    def _raise_saturated(self, levels: Floats, times: Floats, edges: Floats) -> NoReturn:
        k, g, i = np.unravel_index(np.argmax(levels), levels.shape)
        group, middle = self.layout.names[g], (edges[i] + edges[i + 1]) / 2
        parts = [
            f"{type(template).__name__} {float(np.squeeze(template.values(np, times[k], edges[i], edges[i + 1]))):.2f}"
            for template in self.templates
            if group in template.groups
        ]
        raise OctoctrlError(
            f"activation of {group} reaches {levels[k, g, i]:.2f} at t={times[k]:.2f} s, s={middle:.2f} m ({' + '.join(parts)}); "
            "scale, shift, or pass on_saturation='clip'"
        )
