"""Fit the reduced model of an arm to runs of its plant."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from octoctrl.sim.archives import check_source
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError, check_choice, check_kind
from octoctrl.sim.plants import check_plant, make_plant, warmup
from octoctrl.sim.scene.scene import Scene

from ..files.writing import check_target, written_aside
from ..progress import NullProgress, Progress

if TYPE_CHECKING:
    from octoctrl.planners.fitting.identified import IdentifiedModel

LEAST_RUN, LOST = 0.5, 0.2
"""Shortest stretch of a programme that is used, and the stretch before a divergence that is not, s."""


def identify(
    arm: Arm | None = None,
    scene: Scene | None = None,
    *,
    plant: str = "rod",
    path: str | Path | None = None,
    overwrite: bool = False,
    laws: str = "known",
    progress: Progress | None = None,
) -> "IdentifiedModel":
    """Move the plant through a few short programmes and fit the reduced model to what it does.

    Parameters
    ----------
    arm : Arm, optional
        The octopus arm if omitted.
    scene : Scene, optional
        Its water is used.
    plant : str
        What is moved, by its name in `octoctrl.sim.plants.PLANTS`; the full arm takes some three minutes.
    path : str or Path, optional
        Where to keep the model (.json), to be passed to `plan`.
    overwrite : bool
        Whether an existing file may be replaced.
    laws : {"known", "generic"}
        The plant's own muscle curves, or simpler ones whose shape is fitted too.
    progress : Progress, optional

    Returns
    -------
    IdentifiedModel

    Raises
    ------
    OctoctrlError
        If the file exists, its suffix is unknown, or there are no such laws.
    PlantUnstableError
        If the plant diverges within the first `LEAST_RUN` seconds of a programme. A later divergence cuts that programme short, which
        ``statistics["cut_short"]`` says.
    """
    from octoctrl.planners.fitting import experiments, fit
    from octoctrl.planners.model.reduced import LAWS

    check_choice("laws", laws, LAWS)
    if path is not None:
        path = check_target(path, overwrite=overwrite, suffixes=(".json",))
    arm, scene = arm or Arm.octopus(), scene or Scene()
    display = progress or NullProgress()
    warmup(plant, progress)
    runs = experiments.experiments(arm)
    recordings, cut_short, done = [], {}, 0.0
    display.start("running the plant", sum(duration for _, _, duration in runs))
    try:
        for name, activation, duration in runs:
            moved = make_plant(plant, arm, scene)
            try:
                recording = moved.advance(activation, duration, progress=_after(done, name, display))
                if not recording.complete:
                    raise KeyboardInterrupt
            except PlantUnstableError as error:
                if error.time < LEAST_RUN:
                    raise
                recording, cut_short[name] = error.recording.until(error.time - LOST), str(error)
            recordings.append((activation, recording))
            done += duration
        display.start(f"fitting {laws} laws to {len(recordings)} runs")
        found = fit.identify(recordings, arm, scene, laws=laws, plant=check_plant(plant).modelled_as)
    finally:
        display.stop()
    found.statistics.update(recorded=plant, cut_short=cut_short)
    if path is not None:
        with written_aside(path) as part:
            found.save(part)
    return found


def _after(done: float, name: str, display: Progress) -> Callable[[float], None]:
    """What shows the progress of the programme `name`, before which so many seconds were `done`."""
    return lambda now: display.advance(done + now, name)


def load_model(model: "str | Path | IdentifiedModel | None", arm: Arm, scene: Scene, plant: str = "rod") -> "IdentifiedModel":
    """The identified model that belongs to an arm.

    Parameters
    ----------
    model : str, Path, IdentifiedModel or None
        A file written by `identify`, such a model, or None for the one that comes with octoctrl.
    arm : Arm
    scene : Scene
    plant : str
        What the model should describe, by its name in `octoctrl.sim.plants.PLANTS`.

    Returns
    -------
    IdentifiedModel

    Raises
    ------
    OctoctrlError
        If there is no such file, or the model belongs to another arm or plant.
    """
    from octoctrl.planners.fitting import identified

    plant = check_plant(plant).modelled_as
    if model is None:
        return identified.load_identified(arm, scene, plant=plant)
    if isinstance(model, str | Path):
        check_source(model, f"make one with: octoctrl identify -o {Path(model).name}")
        name, loaded = str(model), identified.IdentifiedModel.load(model, arm, scene)
    else:
        check_kind(
            "model", model, identified.IdentifiedModel, "the path of a file that octoctrl identify wrote, or IdentifiedModel.load of it"
        )
        name, loaded = "the model", model
    if loaded.plant != plant:
        raise OctoctrlError(
            f"{name} was identified on the plant '{loaded.plant}', the plan is for '{plant}'; plan for '{loaded.plant}' or identify again"
        )
    return loaded


def identification_text(found: "IdentifiedModel") -> str:
    """Write an identified model as a table.

    Parameters
    ----------
    found : IdentifiedModel

    Returns
    -------
    str
    """
    from ..tables import table

    model = found.model
    rows = [(name, f"{getattr(model.parameters, name):.4f}", f"{deviation:.4f}") for name, deviation in found.deviations.items()]
    fitted = f"plant {found.plant}, {model.laws} laws, {model.sections} sections"
    lines = [f"reduced model of arm {model.arm.name} ({found.fingerprint}), {fitted}"]
    lines += table(("factor", "value", "deviation"), rows)
    lines.append(f" residual rms {found.residual_rms:.4f}")
    lines += [f" cut short: '{name}', {message}" for name, message in found.statistics.get("cut_short", {}).items()]
    return "\n".join(lines)
