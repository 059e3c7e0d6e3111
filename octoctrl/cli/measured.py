"""Commands for what was measured elsewhere: the topology of an animal's or a robot's arm, and the fibres in it."""

from pathlib import Path
from typing import Annotated

import typer

from octoctrl.sim.errors import OctoctrlError

from .codes import ExitCode
from .options import AsJson, Overwrite
from .output import report, say


def topology(
    measured_file: Annotated[
        Path, typer.Argument(metavar="ARM.csv", help="Columns time, point, x, y, z; perhaps line.", show_default=False)
    ],
    unit: Annotated[
        str | None, typer.Option("--unit", metavar="UNIT", help="Of the lengths: m, cm or mm, if the headings do not say.")
    ] = None,
    pole: Annotated[str | None, typer.Option("--pole", metavar="X,Y,Z", help="Axis of the expected coil.")] = None,
    sections: Annotated[int, typer.Option("--sections", metavar="N", help="Stretches to call straight, planar or helical.")] = 8,
    picture: Annotated[Path | None, typer.Option("--plot", metavar="PICTURE", help="Draw it: .png, .pdf or .svg.")] = None,
    force: Overwrite = False,
    as_json: AsJson = False,
) -> ExitCode:
    """Measure link, writhe and twist of a filmed or captured arm, and what noise does to them."""
    from octoctrl.sim.topology.measured import QUANTITIES, topology_of

    from ..files.centreline import read_centreline
    from ..files.writing import check_target

    if picture is not None:
        check_target(picture, overwrite=force, suffixes=(".png", ".pdf", ".svg"))
    found = topology_of(read_centreline(measured_file, unit=unit), pole=None if pole is None else _direction(pole), sections=sections)
    if picture is not None:
        from ..pictures.measured import plot_measured

        plot_measured(found, picture, overwrite=force)
        say(f"wrote {picture}")
    trace = found.trace
    content = {name: getattr(trace, name) for name in ("time", *QUANTITIES, "link", "writhe", "crossings", "residual", "uturn")}
    content |= {"sections": found.sections, "noise": found.noise, "bias": found.bias, "spread": found.spread}
    report(found, content | {"pole": trace.convention.pole, "notes": found.notes}, as_json)
    return ExitCode.WELL


def fibres(
    fibre_file: Annotated[Path, typer.Argument(metavar="ARM.trk", help="Fibre tracts, .trk or .tck.", show_default=False)],
    as_json: AsJson = False,
) -> ExitCode:
    """Say how traced fibres wind about an arm's axis: angle, hand, pitch and muscle layout."""
    from ..files.fibres import read_fibres

    found = read_fibres(fibre_file)
    content = {
        "length": found.length,
        "base_radius": found.base_radius,
        "taper": found.taper,
        "pitch": found.pitch,
        "muscles": found.muscles,
    }
    each = {"turns_per_metre": found.turns, "angle": found.angle, "radius_share": found.radius_share, "azimuth": found.azimuth}
    report(found, content | each | {"kinds": [kind.value for kind in found.kinds]}, as_json)
    return ExitCode.WELL


def _direction(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise OctoctrlError(f"--pole is '{text}'; three numbers with commas are needed, for example 0,0,1") from None
