"""A run in parts: how it began, what has come since and all that it needs to go on; and going on with the bits of the unbroken run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from octoctrl.planners.contracts import ControllerReport
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording, StrandMotion
from octoctrl.sim.running.sensors import Sensors

from .replanning import Replanning
from .results import Event, Execution, ExecutionReport, ExecutionStatus, Replan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RunPart(Record):
    """What has come since the part before, and where everything stands.

    Attributes
    ----------
    recording : Recording
    strands : StrandMotion or None
    marks : tuple of (float, float)
        The plant's time and the plan's clock, s, at the ends of the periods since.
    events : tuple of Event
        All so far.
    ahead : tuple of str
        Phases that have not ended.
    waited, missed : float
        For how long the present phase has waited, s, and by how many tolerances it missed its goals at its planned end.
    plant, controller, sensors : mapping or None
        Their states; None for one that does not know how to go on.
    wall_time : float, s
        So far.
    report : ControllerReport
    plan : Plan, optional
        The one that is followed, if it is not that of the begin.
    replans : tuple of Replan
        All so far.
    dead : mapping of str to float
        Muscle groups for which was planned again.
    """

    recording: Recording
    strands: StrandMotion | None
    marks: tuple[tuple[float, float], ...]
    events: tuple[Event, ...]
    ahead: tuple[str, ...]
    waited: float
    missed: float
    plant: Mapping[str, Any] | None
    controller: Mapping[str, Any] | None
    sensors: Mapping[str, Any]
    wall_time: float
    report: ControllerReport
    plan: Plan | None = None
    replans: tuple[Replan, ...] = ()
    dead: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RunStart(Record):
    """How a run began.

    Attributes
    ----------
    plan : Plan
    plant, feedback : str
        What they call themselves.
    controlled : str
        Name by which the controller is made again; empty for an object of the caller's, which has to be given again.
    identity : mapping
        What the plant must be that goes on.
    period, settle : float, s
    patience : float
    sensors : Sensors
    time_step : float, s
    step_limit : str
    replan : Replanning, optional
    origin : mapping of str to str
        For the header of the file.
    """

    plan: Plan
    plant: str
    feedback: str
    controlled: str
    identity: Mapping[str, Any]
    period: float
    patience: float
    settle: float
    sensors: Sensors
    time_step: float
    step_limit: str
    replan: Replanning | None = None
    origin: Mapping[str, str] = field(default_factory=dict)

    def joined(self, parts: Sequence[RunPart]) -> Execution:
        """The run as far as its `parts` go.

        Raises
        ------
        OctoctrlError
            If there are none.
        """
        from octoctrl.sim.topology.meter import Meter

        if not parts:
            raise OctoctrlError("the run was broken off before anything was recorded; run the plan anew")
        if not all(isinstance(part, RunPart) for part in parts):
            raise OctoctrlError("the parts of the run are damaged; run the plan anew")
        recording, last = Recording.joined([part.recording for part in parts]), parts[-1]
        meter = Meter(self.plan.task.convention)
        meter.extend(recording.time, recording.points, recording.frames)
        marks = [(0.0, 0.0), *(mark for part in parts for mark in part.marks)]
        note = f"broken off after t={recording.time[-1]:.2f} s"
        return Execution(
            plan=last.plan or self.plan,
            recording=replace(recording, complete=False, note=note),
            trace=meter.trace,
            clock=np.interp(recording.time, *np.array(marks).T),
            feedback=self.feedback,
            report=ExecutionReport(wall_time=last.wall_time, time_step=self.time_step, step_limit=self.step_limit, controller=last.report),
            plant=self.plant,
            events=last.events,
            replans=last.replans,
            status=ExecutionStatus.INTERRUPTED,
            strands=StrandMotion.joined([part.strands for part in parts if part.strands is not None]),
        )
