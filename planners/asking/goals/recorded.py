"""What goals read, on a recording: the same quantities that the reduced model gives as expressions."""

from functools import cached_property
from typing import Any

import numpy as np

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.rotations import ribbon_frames, rotation_vector
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.topology.trace import TopologyTrace

from ...contracts import Floats


class RecordedOutputs:
    """`octoctrl.planners.contracts.Outputs` of a recording, T instants.

    Parameters
    ----------
    recording : Recording
    trace : TopologyTrace or None
        Of the same instants; none where no goal reads topology.
    arm : Arm

    Attributes
    ----------
    holds : dict of str to Hold
        How objects are held, by name, as far as it was asked for.
    """

    math: Any = np

    def __init__(self, recording: Recording, trace: TopologyTrace | None, arm: Arm) -> None:
        self.recording, self.trace, self.arm = recording, trace, arm
        self.holds: dict[str, Any] = {}

    @property
    def _topology(self) -> TopologyTrace:
        if self.trace is None:
            raise ValueError("a goal reads topology, and no trace of it was measured")
        return self.trace

    @property
    def twist(self) -> Floats:
        """(T,), turns."""
        return self._topology.twist

    @property
    def lifted_writhe(self) -> Floats:
        """(T,), turns."""
        return self._topology.lifted_writhe

    @property
    def lifted_link(self) -> Floats:
        """(T,), turns."""
        return self._topology.lifted_link

    @property
    def length(self) -> Floats:
        """(T,), m."""
        return self.recording.length

    @property
    def uturn(self) -> Floats:
        """1 + tip tangent . base tangent, (T,)."""
        return 1 + np.einsum("ti,ti->t", self.recording.frames[:, 0, 2], self.tip_tangent)

    @property
    def tip(self) -> Floats:
        """(T, 3), m."""
        return self.recording.tip

    @property
    def tip_tangent(self) -> Floats:
        """Unit vectors (T, 3)."""
        return self.recording.frames[:, -1, 2]

    @property
    def stations(self) -> Floats:
        """(n + 2,), m."""
        return self.recording.stations

    @cached_property
    def curvatures(self) -> tuple[Floats, Floats, Floats]:
        """k1, k2, k3, each (T, n + 1), 1/m, of the ribbon along the centreline, as twist is measured."""
        frames = ribbon_frames(self.recording.points, self.recording.frames)
        turns = rotation_vector(frames[:, 1:] @ np.swapaxes(frames[:, :-1], -1, -2)) / np.diff(self.stations)[:, None]
        return turns[..., 0], turns[..., 1], turns[..., 2]

    @property
    def points(self) -> tuple[Floats, Floats, Floats]:
        """x, y, z, each (T, n + 1), m."""
        points = self.recording.points
        return points[..., 0], points[..., 1], points[..., 2]
