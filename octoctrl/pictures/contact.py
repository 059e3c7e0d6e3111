"""How an arm held the objects of its scene: numbers for a table, and a picture over time."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from octoctrl.sim.contact.measures import covered_winding, winding
from octoctrl.sim.contact.surroundings import PREFIX, Touch
from octoctrl.sim.records import Record
from octoctrl.sim.scene.mesh import Mesh
from octoctrl.sim.scene.objects import Capsule, Cylinder

from ..carrying.results import Execution
from .inline import inline_svg
from .motion import Floats, outer_radius

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Of the objects, in the order of the scene, from the palette of Okabe and Ito."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Grip(Record):
    """One object over a run, T instants.

    Attributes
    ----------
    name : str
    normal_force : (T,) float64, N
    winding, covered : (T,) float64, turns
        About the object's axis: of the centreline, and of what of it lies on the object; none for an object without an axis.
    slip, deepest : float, m
        Longest path slid by a point, and deepest overlap, of the whole run.
    """

    name: str
    normal_force: Floats
    winding: Floats | None
    covered: Floats | None
    slip: float
    deepest: float

    def first_touch(self, time: Floats) -> float:
        """Instant, of `time` (T,), s, at which it is first touched; not a number if it never is."""
        touched = np.flatnonzero(self.normal_force > 0)
        return float(time[touched[0]]) if touched.size else np.nan


def grips(run: Execution) -> list[Grip]:
    """Read how the arm held each object of its scene that was recorded.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    list of Grip
    """
    recording, arm = run.recording, run.plan.arm
    middle = (recording.stations[1:-1]) if len(recording.stations) > 2 else recording.stations
    radius = outer_radius(arm, middle)
    found = []
    for item in run.plan.scene.objects:
        if PREFIX + item.name not in recording.series:
            continue
        touch = Touch.of(recording.series, item.name)
        turned = isinstance(item, Capsule | Cylinder | Mesh)
        found.append(
            Grip(
                name=item.name,
                normal_force=touch.normal_force,
                winding=winding(recording.points, touch.position, touch.frame) if turned else None,
                covered=covered_winding(recording.points, radius, item, touch.position, touch.frame) if turned else None,
                slip=float(touch.slip.max()),
                deepest=float(touch.deepest.max()),
            )
        )
    return found


def contact_picture(run: Execution, held: list[Grip], left: float, width: float) -> str:
    """Normal force and winding over time.

    Parameters
    ----------
    run : Execution
    held : list of Grip
        At least one.
    left, width : float
        Where the time axis begins and how long it is, in percent of the picture's width.

    Returns
    -------
    str
        SVG, with text as text; the same run gives the same bytes.
    """
    time = run.recording.time
    turned = [grip for grip in held if grip.covered is not None]

    def draw(figure: "Figure") -> None:
        panels = figure.subplots(1 + bool(turned), 1, squeeze=False)[:, 0]
        figure.subplots_adjust(left=left / 100, right=(left + width) / 100, top=0.93, bottom=0.17 if turned else 0.28, hspace=0.25)
        for number, grip in enumerate(held):
            colour = COLOURS[number % len(COLOURS)]
            panels[0].plot(time, grip.normal_force, color=colour, lw=1.8, label=grip.name.replace("$", r"\$"))
            if grip.covered is not None and grip.winding is not None:
                panels[1].plot(time, grip.winding, color=colour, lw=1.0, ls=":")
                panels[1].plot(time, grip.covered, color=colour, lw=1.8)
        panels[0].set_ylabel("normal force\n[N]", fontsize=9)
        panels[0].legend(fontsize=7.5, frameon=False, loc="upper left", ncols=4, borderaxespad=0.1)
        if turned:
            panels[1].set_ylabel("winding\n[turns]", fontsize=9)
            panels[1].text(0.005, 0.95, "on the object; dotted: all of the arm", transform=panels[1].transAxes, va="top", fontsize=7.5)
        for axes in panels:
            axes.set_xlim(0.0, time[-1] or 1.0)
            axes.margins(y=0.15)
            axes.tick_params(labelsize=8, labelbottom=axes is panels[-1])
            axes.spines[["top", "right"]].set_visible(False)
        panels[-1].set_xlabel("time [s]", fontsize=9)
        figure.align_ylabels(panels)

    return inline_svg(2.6 if turned else 1.6, draw)
