"""Fit the reduced model of an arm to runs of its plant."""

from pathlib import Path

from octoctrl.sim.arm import Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene import Scene

from .progress import NullProgress
from .store import check_target


def identify(arm=None, scene=None, *, path=None, overwrite=False, laws="known", progress=None):
    """Move the plant through a few short programmes and fit the reduced model to what it does.

    Parameters
    ----------
    arm : Arm, optional
        The octopus arm if omitted.
    scene : Scene, optional
        Its water is used.
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
        If the file exists or its suffix is unknown.
    PlantUnstableError
        If the plant diverges.
    """
    from octoctrl.planners import identification
    from octoctrl.sim.plant import Plant

    if path is not None:
        path = check_target(path, overwrite=overwrite, suffixes=(".json",))
    arm, scene = arm or Arm.octopus(), scene or Scene()
    display = progress or NullProgress()
    runs = identification.experiments(arm)
    recordings, done = [], 0.0
    display.start("running the plant", sum(duration for _, _, duration in runs))
    try:
        for name, activation, duration in runs:
            display.advance(done, name)
            recording = Plant(arm, scene).advance(activation, duration)
            if not recording.complete:
                raise KeyboardInterrupt
            recordings.append((activation, recording))
            done += duration
        display.start(f"fitting {laws} laws to {len(recordings)} runs")
        found = identification.identify(recordings, arm, scene, laws=laws)
    finally:
        display.stop()
    if path is not None:
        found.save(path)
    return found


def load_model(model, arm, scene):
    """The identified model that belongs to an arm.

    Parameters
    ----------
    model : str, Path, IdentifiedModel or None
        A file written by `identify`, such a model, or None for the one that comes with octoctrl.
    arm : Arm
    scene : Scene

    Returns
    -------
    IdentifiedModel
    """
    from octoctrl.planners import identification

    if model is None:
        return identification.load_identified(arm, scene)
    if isinstance(model, str | Path):
        if not Path(model).is_file():
            raise OctoctrlError(f"{model} does not exist; make one with: octoctrl identify -o {Path(model).name}")
        return identification.IdentifiedModel.load(model, arm, scene)
    return model


def identification_text(found):
    """Write an identified model as a table.

    Parameters
    ----------
    found : IdentifiedModel

    Returns
    -------
    str
    """
    from .console import table

    parameters = found.model.parameters
    rows = [(name, f"{getattr(parameters, name):.4f}", f"{deviation:.4f}") for name, deviation in found.deviations.items()]
    lines = [f"reduced model of arm {found.model.arm.name} ({found.fingerprint}), {found.model.laws} laws, {found.model.sections} sections"]
    lines += table(("factor", "value", "deviation"), rows)
    lines.append(f" residual rms {found.residual_rms:.4f}")
    return "\n".join(lines)
