"""The plants by name: one row each, and all that the rest of the package knows of a plant by its name.

A row names what the plant is and how its core is made. One of your own is entered with `register` and is then as good as the others, in
the library, in task files and on the command line; see docs/plants.md.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal, Protocol, cast

from .body.arm import Arm
from .contracts import Core
from .errors import OctoctrlError, check_choice, check_kind, suggest
from .registries import enter
from .running import plant as running
from .running.clock import RECORD, SAMPLE, Clock
from .scene.scene import Scene

COARSE_RING = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantRow:
    """What there is to know of a plant by its name.

    Attributes
    ----------
    name : str
    text : str
        What it is, as a line of a list.
    core : callable
        ``core(arm, scene, **options)`` -> `octoctrl.sim.contracts.Core`.
    modelled_as : str
        Name of the plant for which its reduced model is identified.
    first_time : str
        How long it takes to compile, as a part of a sentence.
    lumped : str
        What of the arm it leaves out, empty if nothing.
    law_of_each : bool
        Whether a muscle group that is at rest is left out of the computation.
    compiled : str
        Function whose compiled loop is kept on disk, as ``module:name``; empty if there is none.
    """

    name: str
    text: str
    core: Callable[..., Core]
    modelled_as: str
    first_time: str = "some seconds"
    lumped: str = ""
    law_of_each: bool = False
    compiled: str = ""


def _check_options(plant: str, options: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for name in options:
        if name not in known:
            raise OctoctrlError(f"the plant '{plant}' has no option '{name}'{suggest(name, known)} ({', '.join(known)})")


def _rod(arm: Arm, scene: Scene, **options: Any) -> Core:
    from .rod.core import RodCore

    _check_options("rod", options, ("complete",))
    return RodCore(arm, scene, **options)


def _assembly(arm: Arm, scene: Scene, **options: Any) -> Core:
    from .assembly.core import AssemblyCore

    _check_options("assembly", options, ("paper_compatible", "precision", "resting_tone", "ring_nodes", "rings", "taut", "threads"))
    return AssemblyCore(arm, scene, **options)


def _coarse(arm: Arm, scene: Scene, **options: Any) -> Core:
    return _assembly(arm, scene, **{"ring_nodes": COARSE_RING} | options)


def _mixed(arm: Arm, scene: Scene, **options: Any) -> Core:
    return _assembly(arm, scene, **{"precision": "mixed"} | options)


def _coarse_mixed(arm: Arm, scene: Scene, **options: Any) -> Core:
    return _coarse(arm, scene, **{"precision": "mixed"} | options)


def _full_arm(name: str, text: str, core: Callable[..., Core]) -> PlantRow:
    """A row of the full arm, whatever its rings and its precision."""
    stepper = "octoctrl.sim.assembly.stepping:assembly_stepper"
    return PlantRow(name=name, text=text, core=core, modelled_as="assembly", first_time="about a minute", compiled=stepper)


PLANTS: dict[str, PlantRow] = {
    row.name: row
    for row in (
        PlantRow(
            name="rod",
            text="one Cosserat rod of the arm's outline",
            core=_rod,
            modelled_as="rod",
            lumped="rings, helices, cord",
            law_of_each=True,
            compiled="octoctrl.sim.rod.stepping:muscular_stepper",
        ),
        _full_arm("assembly", "the full arm of 197 rods", _assembly),
        _full_arm("assembly-coarse", "the full arm of 197 rods with coarse rings, in a third of the time", _coarse),
        _full_arm("assembly-mixed", "the full arm of 197 rods in mixed precision, in half the time", _mixed),
        _full_arm(
            "assembly-coarse-mixed", "the full arm of 197 rods with coarse rings in mixed precision, in a sixth of the time", _coarse_mixed
        ),
    )
}
"""Each plant by its name."""


def register(row: PlantRow) -> PlantRow:
    """Enter a plant of one's own into the table.

    Parameters
    ----------
    row : PlantRow

    Returns
    -------
    PlantRow
        The same.

    Raises
    ------
    OctoctrlError
        If the name is taken, or it is modelled as a plant that is not there.
    """
    if row.modelled_as != row.name:
        check_choice("plant", row.modelled_as, tuple(PLANTS))
    return enter(PLANTS, "plant", row.name, row)


def check_plant(name: object) -> PlantRow:
    """Check the name of a plant.

    Parameters
    ----------
    name : str

    Returns
    -------
    PlantRow
        Its row.

    Raises
    ------
    OctoctrlError
        If it is unknown; the message suggests the nearest.
    """
    check_choice("plant", name, tuple(PLANTS))
    return PLANTS[str(name)]


class Plant(running.Plant):
    """A simulated arm by the name of its model: `octoctrl.sim.running.plant.Plant` with the core and the clock that belong to it.

    Parameters
    ----------
    arm : Arm, optional
        The octopus arm if omitted.
    scene : Scene, optional
    model : str
        A name in `PLANTS`: ``"rod"``, one Cosserat rod of the arm's outline; ``"assembly"``, the full arm of 197 rods, which takes some 500
        times as long; ``"assembly-coarse"``, that with rings of `COARSE_RING` nodes; either with ``"-mixed"``, in mixed precision.
    dt : float or "auto", s
        Largest time step; the step in use divides `sample_interval`. ``"auto"`` takes the usual share of the predicted stability limit.
    sample_interval : float, s
        How often activation is sampled (linear in between) and the motion is checked.
    record_every : int
        Record every so many samples.
    gains : mapping of str to float, optional
        Factors in [0, 1] on the levels of muscle groups, 0 for a dead one.
    energy : bool
        Whether recordings keep account of the energy, in ``series``: ``energy_...`` of the parts, ``work_muscles`` and ``work_water`` done
        since the begin, J. No bit of the motion differs, but it takes longer; not asked for it costs nothing.
    **options
        Of the core: ``rings``, ``ring_nodes``, ``resting_tone``, ``precision``, ``threads`` and ``paper_compatible`` of the full arm, see
        `octoctrl.sim.assembly.core.AssemblyCore`.

    Raises
    ------
    OctoctrlError
        If the name is unknown or an argument is out of range.
    """

    def __init__(
        self,
        arm: Arm | None = None,
        scene: Scene | None = None,
        model: str = "rod",
        *,
        dt: float | Literal["auto"] = "auto",
        sample_interval: float = SAMPLE,
        record_every: int = RECORD,
        gains: Mapping[str, float] | None = None,
        energy: bool = False,
        **options: Any,
    ) -> None:
        make = check_plant(model).core
        arm, scene = Arm.octopus() if arm is None else arm, Scene() if scene is None else scene
        check_kind("arm", arm, Arm)
        check_kind("scene", scene, Scene)
        check_kind("energy", energy, bool)
        core = make(arm, scene, **options)
        if energy:
            from .running.account import Accounted

            core = cast(Core, Accounted(core))
        clock = Clock.choose(core.limit, core.usual, dt=dt, sample_interval=sample_interval, record_every=record_every)
        super().__init__(core, clock, gains=gains, automatic=dt == "auto")


def make_plant(name: str = "rod", arm: Arm | None = None, scene: Scene | None = None, **options: Any) -> Plant:
    """Make a plant by name.

    Parameters
    ----------
    name : {"rod", "assembly", "assembly-coarse", "assembly-mixed", "assembly-coarse-mixed"}
        Or one that was entered with `register`.
    arm : Arm, optional
        The octopus arm if omitted.
    scene : Scene, optional
    **options
        As `Plant` takes them, such as ``dt`` and ``record_every``.

    Returns
    -------
    Plant

    Raises
    ------
    OctoctrlError
        If the name is unknown or an argument is out of range.
    """
    return Plant(arm, scene, name, **options)


class _Shown(Protocol):
    """Where the user can see what takes its time, such as `octoctrl.progress.Progress`."""

    def start(self, text: str) -> None: ...

    def stop(self) -> None: ...


def warmup(name: str = "rod", progress: _Shown | None = None) -> float:
    """Compile a plant, or load it from the cache on disk.

    Parameters
    ----------
    name : {"rod", "assembly", "assembly-coarse", "assembly-mixed", "assembly-coarse-mixed"}
    progress : Progress, optional
        Live display.

    Returns
    -------
    float, s
        How long it took.
    """
    from .activation import Activation

    begin = perf_counter()
    row = check_plant(name)
    if progress is not None:
        progress.start(f"preparing the plant '{name}' (the first time {row.first_time})")
    try:
        plant = make_plant(name)
        plant.advance(Activation(), plant.sample_interval)
    finally:
        if progress is not None:
            progress.stop()
    return perf_counter() - begin
