"""The time loop of the muscular rod: many steps, activation, guard and recording inside one compiled call.

A call covers whole *samples*; at the end of each, positions and velocities belong to the same instant, the motion is checked and, if
asked, recorded. Inside a sample the two half drifts that meet between steps are merged into one. Cutting a run into calls at samples
does not change a single bit, so that a saved state continues exactly.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..body.layout import Family, MuscleLayout
from ..compiler import kernel
from ..contact.body_kernels import drift_bodies, kick_bodies
from ..contact.fold_kernels import fold_sweeps
from ..contact.near_kernels import CLOSE, MEETING, MOVES, SINKS
from ..contact.note_kernels import note
from ..contact.pair_kernels import meet
from ..contact.sweep_kernels import contact_sweeps
from ..contracts import Floats
from ..physics.fibre_kernels import LawConstants
from .contact_kernels import rod_surface
from .elastic_kernels import frame_kernel, rod_kernels
from .guard_kernels import FINE, SUNK, guard_kernel, record_kernel
from .layout import offsets
from .load_kernels import load_kernel
from .section_kernels import fibre_kernels, section_kernels

ONE = np.uint64(1)


class MuscleScalars(NamedTuple):
    """Scalars of a muscular rod for the compiled loop."""

    hoop_ratio: float
    winding: float
    elastic: float
    longitudinal: LawConstants
    oblique: LawConstants
    transverse: LawConstants
    wet: bool


def muscular_stepper(
    stride: int, layout: MuscleLayout, loaded: bool = False, touching: bool = False, folding: bool = False
) -> Callable[..., Any]:
    """Compile the loop of a rod with muscle fibres.

    Parameters
    ----------
    stride : int
        Of the buffer.
    layout : MuscleLayout
    loaded : bool
        Whether loads act from outside.
    touching : bool
        Whether there are bodies to touch.
    folding : bool
        Whether the arm touches itself. Of what there is not, nothing is compiled.

    Returns
    -------
    advance : compiled function
        ``advance(buffer, n, h, steps, levels, active, scalars, loads, world, folds, points, directors, stretch)`` takes `steps` steps of
        `h` for each of the samples, whose count is the length of `points`, and fills the three arrays. Returns ``(samples done, finding,
        element)``; `levels` (samples + 1, groups, n), linear in time between samples, `active` (samples, groups) bool, which groups
        differ from zero in each (others are left out, which changes no bit), `loads` as in `octoctrl.sim.scene.loads.sampled_loads`,
        `world` an `octoctrl.sim.contact.world.World` and `folds` an `octoctrl.sim.contact.folds.Folds`, or empty tuples.
    """
    drift, strain, curvature, curvature_rate, moment, transport, kick, water = rod_kernels(stride)
    measure, straight, wound, apply, remember, brake, relax, keep, answer = section_kernels(stride, layout)
    longitudinal, oblique, transverse = fibre_kernels(stride)
    guard, straighten, record = guard_kernel(stride), frame_kernel(stride), record_kernel(stride)
    load = load_kernel(stride)
    surface = rod_surface(stride)
    watch, touch, follow = contact_sweeps(surface)
    watch_folds, part, note_folds = fold_sweeps(surface)
    LEVEL = offsets(stride)["LEVEL"]
    families, places = layout.families, layout.places
    groups, along, across = len(layout), int(Family.LONGITUDINAL), int(Family.TRANSVERSE)

    @kernel
    def set_level(b: Floats, n: np.uint64, before: Floats, after: Floats, share: float) -> None:
        for k in range(ONE, n + ONE):
            b[LEVEL + k] = (1 - share) * before[k - ONE] + share * after[k - ONE]

    @kernel
    def advance(
        b: Floats,
        n: np.uint64,
        h: float,
        steps: int,
        levels: Floats,
        active: NDArray[np.bool_],
        scalars: MuscleScalars,
        loads: Floats,
        world: Any,
        folds: Any,
        points: Floats,
        directors: Floats,
        stretch: Floats,
    ) -> tuple[int, int, Any]:
        nu, elastic = scalars.hoop_ratio, scalars.elastic
        for sample in range(points.shape[0]):
            if touching:
                watch(b, world, h * steps)
                moves, close, meeting = world.seen[MOVES], world.seen[CLOSE], world.seen[MEETING]
                if moves:
                    drift_bodies(world.bodies, 0.5 * h)
            laps = False
            if folding:
                watch_folds(b, folds, h * steps)
                laps = folds.found[0] > 0
            drift(b, n, 0.5 * h)
            before, after = levels[sample], levels[sample + 1]
            changing = True
            for step in range(steps):
                share = (step + 0.5) / steps
                if loaded and (step == 0 or changing):
                    changing = load(b, n, loads[sample], loads[sample + 1], share)
                strain(b, n)
                curvature(b, n)
                curvature_rate(b, n)
                moment(b, n)
                measure(b, n, nu)
                straight(b, n, scalars.longitudinal, elastic)
                wound(b, n, scalars.winding, scalars.oblique, scalars.transverse, elastic)
                for group in range(groups):
                    if active[sample, group]:
                        set_level(b, n, before[group], after[group], share)
                        if families[group] == along:
                            longitudinal(b, n, places[group, 0], places[group, 1], scalars.longitudinal)
                        elif families[group] == across:
                            transverse(b, n, scalars.transverse)
                        else:
                            oblique(b, n, places[group, 0] * scalars.winding, scalars.oblique)
                apply(b, n)
                transport(b, n)
                if scalars.wet:
                    water(b, n)
                remember(b, n)
                kick(b, n)
                brake(b, n)
                relax(b, n)
                if touching and moves:
                    kick_bodies(world.bodies, h)
                if (touching and close) or laps:
                    keep(b, n)
                    pushed = False
                    if touching and close:
                        pushed = touch(b, world, h)
                    if folding:
                        pushed = part(b, folds, h) or pushed
                    if pushed:
                        answer(b, n)
                if touching:
                    if meeting:
                        meet(world, h)
                    if close:
                        follow(b, world, h)
                    if moves:
                        drift_bodies(world.bodies, h if step + 1 < steps else 0.5 * h)
                drift(b, n, h if step + 1 < steps else 0.5 * h)
            if touching:
                note(world, sample, h, steps)
            sunk = note_folds(folds, sample, h, steps) if folding else False
            finding, element = guard(b, n)
            if finding != FINE:
                return sample, finding, element
            straighten(b, n)
            record(b, n, points[sample], directors[sample], stretch[sample])
            if sunk or (touching and world.seen[SINKS]):
                return sample + 1, SUNK, ONE
        return points.shape[0], FINE, ONE

    return advance
