"""The plants by name: what a plan can be carried out on."""

from time import perf_counter

from .errors import check_choice

PLANTS = {
    "rod": "one Cosserat rod of the arm's outline",
    "assembly": "the full arm of 197 rods",
    "assembly-coarse": "the full arm of 197 rods with coarse rings, in a third of the time",
}
"""Name of each plant, and what it is."""

MODELLED_AS = {"rod": "rod", "assembly": "assembly", "assembly-coarse": "assembly"}
"""For which plant the reduced model of each is identified."""

_FIRST_TIME = {"rod": "some seconds", "assembly": "about a minute", "assembly-coarse": "about a minute"}

COARSE_RING = 8


def check_plant(name):
    """Check the name of a plant.

    Parameters
    ----------
    name : str

    Raises
    ------
    OctoctrlError
        If it is unknown; the message suggests the nearest.
    """
    check_choice("plant", name, tuple(PLANTS))


def make_plant(name="rod", arm=None, scene=None, **options):
    """Make a plant by name.

    Parameters
    ----------
    name : {"rod", "assembly", "assembly-coarse"}
        One Cosserat rod of the arm's outline (`octoctrl.sim.rod.plant.Plant`); the full arm of 197 rods
        (`octoctrl.sim.assembly.plant.AssemblyPlant`), which takes some 500 times as long; or that with rings of `COARSE_RING` nodes.
    arm : Arm, optional
        The octopus arm if omitted.
    scene : Scene, optional
    **options
        As the class takes them, such as ``dt`` and ``record_every``.

    Returns
    -------
    Plant

    Raises
    ------
    OctoctrlError
        If the name is unknown or an argument is out of range.
    """
    check_plant(name)
    if name == "rod":
        from .rod.plant import Plant

        return Plant(arm, scene, **options)
    from .assembly.plant import AssemblyPlant

    if name == "assembly-coarse":
        options = {"ring_nodes": COARSE_RING} | options
    return AssemblyPlant(arm, scene, **options)


def warmup(name="rod", progress=None):
    """Compile a plant, or load it from the cache on disk.

    Parameters
    ----------
    name : {"rod", "assembly", "assembly-coarse"}
    progress : Progress, optional
        Live display.

    Returns
    -------
    float, s
        How long it took.
    """
    from .activation import Activation

    begin = perf_counter()
    check_plant(name)
    if progress is not None:
        progress.start(f"preparing the plant '{name}' (the first time {_FIRST_TIME[name]})")
    try:
        plant = make_plant(name)
        plant.advance(Activation(), plant.sample_interval)
    finally:
        if progress is not None:
            progress.stop()
    return perf_counter() - begin
