"""The packet of bending over a run, as it was planned and as it went: where it is, how fast, how wide, how strong."""

from dataclasses import dataclass

import numpy as np

from octoctrl.planners.asking.goals.packet import POWER, bending_strain, places
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording

from ..carrying.results import Execution
from .comparison import Floats, planned_strains

OVER = 0.05
"""Time over which a speed is taken, s."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PacketTrack(Record):
    """The packet of bending at T instants.

    Attributes
    ----------
    time : (T,) float64, s
    places : (M,) float64, m
        Rest arclengths at which bending is read.
    strain : (T, M) float64
        Bending strain r |k| there, with the arm's nominal radius.
    position : (T,) float64, m
        Rest arclength of the packet: the centroid of the fourth power of the bending strain, which is what the goal `packet` reads.
    speed : (T,) float64, m/s
        Of that arclength.
    way : (T, 3) float64, m
        Its place in the laboratory.
    pace : (T,) float64, m/s
        How fast that place moves.
    width : (T,) float64, m
        Twice the standard deviation about the position with the same weights: of a Gaussian packet its own standard deviation.
    amplitude : (T,) float64
        Largest bending strain.
    """

    time: Floats
    places: Floats
    strain: Floats
    position: Floats
    speed: Floats
    way: Floats
    pace: Floats
    width: Floats
    amplitude: Floats


def packet_of(recording: Recording, arm: Arm) -> PacketTrack:
    """Track the packet of bending through a recording.

    Parameters
    ----------
    recording : Recording
    arm : Arm

    Returns
    -------
    PacketTrack
    """
    outputs = RecordedOutputs(recording, None, arm)
    strain, along = bending_strain(outputs), places(outputs)
    weights = strain**POWER
    weights /= weights.sum(axis=1, keepdims=True)
    position = weights @ along
    width = 2 * np.sqrt(np.sum(weights * (along - position[:, None]) ** 2, axis=1))
    edges = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(recording.points[0], axis=0), axis=1) / recording.stretch[0])])
    way = np.array([[np.interp(place, edges, axis) for axis in points.T] for place, points in zip(position, recording.points, strict=True)])
    return PacketTrack(
        time=recording.time,
        places=along,
        strain=strain,
        position=position,
        speed=_rate(recording.time, position[:, None])[:, 0],
        way=way,
        pace=np.linalg.norm(_rate(recording.time, way), axis=1),
        width=width,
        amplitude=strain.max(axis=1),
    )


def packets(run: Execution) -> tuple[PacketTrack | None, PacketTrack]:
    """The packet as planned and as simulated.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    planned : PacketTrack or None
        At the readings of the plan's clock; None if the plan carries no shape.
    simulated : PacketTrack
        At the same instants.
    """
    strains = planned_strains(run.plan, run.clock)
    planned = None if strains is None else packet_of(run.plan.model.recording(run.recording.time, strains), run.plan.arm)
    return planned, packet_of(run.recording, run.plan.arm)


def _rate(time: Floats, values: Floats) -> Floats:
    """How fast `values` (T, n) change, over `OVER`, or what of it lies in the recording."""
    before, after = np.maximum(time - OVER / 2, time[0]), np.minimum(time + OVER / 2, time[-1])
    ends = [np.stack([np.interp(when, time, column) for column in values.T], axis=1) for when in (before, after)]
    return (ends[1] - ends[0]) / np.maximum(after - before, 1e-9)[:, None]
