"""Where corrections act: on the muscles that a plan uses, and along the arm only where its templates use them.

A correction of a muscle that a plan contracts in a part of the arm must stay in that part: elsewhere the muscle rests and could not be
relaxed, so that only half of all corrections would do what the regulator believes. A template whose place moves takes its corrections
with it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.templates import Template

from ..contracts import Floats

MAINLY = 0.5
"""Share of a section from which its level counts as one of the channel."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One number that feedback may change: the level of a muscle group where a template acts."""

    group: str
    template: Template

    def shares(self, times: Floats, edges: Floats) -> Floats:
        """Share (T, n) in which a correction reaches the cells between `edges`, m, at `times`, s."""
        edges = np.asarray(edges, dtype=float)
        found = self.template.place(np, np.asarray(times, dtype=float)[:, None], edges[:-1], edges[1:])
        return np.broadcast_to(found, (len(times), len(edges) - 1))


class Channels:
    """The channels of an activation; templates in one place share theirs.

    Parameters
    ----------
    activation : Activation
    gains : mapping of str to float
        What of their level muscle groups do, all of it if not named; those that do nothing have no channels.

    Attributes
    ----------
    each : tuple of Channel
        By muscle group in the order of the layout, then in the order of the templates.
    groups : tuple of str
        Muscle groups that are used.
    members : (channels, groups) float64
        1 where a channel is one of a group.
    """

    def __init__(self, activation: Activation, gains: Mapping[str, float] | None = None) -> None:
        gains = gains or {}
        self.groups: tuple[str, ...] = tuple(group for group in activation.groups if gains.get(group, 1.0) > 0)
        found: dict[object, Channel] = {}
        for group in self.groups:
            for template in activation.templates:
                if group in template.groups:
                    found.setdefault((group, template.whereabouts), Channel(group, template))
        self.each = tuple(found.values())
        self._columns = [activation.layout.index(channel.group) for channel in self.each]
        self._gains = np.array([gains.get(channel.group, 1.0) for channel in self.each])
        self.members = np.array([[float(channel.group == group) for group in self.groups] for channel in self.each])

    def __len__(self) -> int:
        return len(self.each)

    def shares(self, times: Floats, edges: Floats) -> Floats:
        """Shares (T, channels, n) in which corrections reach the cells between `edges`, m, at `times`, s, of the activation's clock."""
        return np.stack([channel.shares(times, edges) for channel in self.each], axis=1)

    def planned(self, levels: Floats, shares: Floats) -> Floats:
        """Level (T, channels) of each channel: the largest of the sections that it mainly covers, of those felt (T, groups, S)."""
        mainly = shares >= MAINLY * shares.max(axis=2, keepdims=True)
        found: Floats = np.where(mainly & (shares > 0), levels[:, self._columns], 0.0).max(axis=2) / self._gains
        return found

    def corrected(self, levels: Floats, shares: Floats, correction: Floats) -> Floats:
        """Levels (groups, S) that are felt, from those planned, the channels' shares (channels, S), and a correction (channels,)."""
        found = levels.copy()
        np.add.at(found, self._columns, shares * (self._gains * correction)[:, None])
        return np.asarray(np.clip(found, 0.0, 1.0))

    def influence(self, influence: Floats, shares: Floats) -> Floats:
        """What the channels do (T, n, channels), from what every group does in every section (T, n, groups, S)."""
        found: Floats = np.einsum("tncs,tcs->tnc", influence[:, :, self._columns], shares) * self._gains
        return found
