"""Random trials of the stability laboratory: what is simulated, drawn anew from seed, kind and number, so that any one can be repeated.

A trial is only a description; arms that cannot be built are part of the game, and building them is where they must be refused.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import exp, log
from typing import Any
from zlib import crc32

import numpy as np
from numpy.random import Generator

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.body.muscles import LONGITUDINAL, TRANSVERSE
from octoctrl.sim.templates import Plateau, Wave

WATER_DENSITY = 1050.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One arm, what is done to it, and for how long.

    Attributes
    ----------
    kind : str
    number : int
    plant : str
        By its name in `octoctrl.sim.plants.PLANTS`.
    duration : float, s
    arm : dict
        Fields of `octoctrl.sim.body.arm.Arm` that differ from the octopus arm.
    water : float or None
        Factor on all drag; None is a vacuum.
    activation : Activation
    stretch : float
        Uniform stretch of the arm at the begin.
    step : float or None
        Time step over the predicted limit; None is ``dt="auto"``.
    """

    kind: str
    number: int
    plant: str = "rod"
    duration: float = 0.5
    arm: dict[str, Any] = field(default_factory=dict)
    water: float | None = 1.0
    activation: Activation = field(default=Activation())
    stretch: float = 1.0
    step: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A family of trials: its share of all runs, what it is in one line, and how one is drawn from a random generator and its number."""

    share: int
    description: str
    draw: Callable[[Generator, int], dict[str, Any]]


def draw(kind: str, seed: int, number: int, plant: str = "assembly") -> Trial:
    """The trial of this `kind`, of `KINDS` or `ASSEMBLY_KINDS`, `seed` and `number`; those of the full arm are of the `plant`."""
    known, random = KINDS | ASSEMBLY_KINDS, np.random.default_rng([seed, crc32(kind.encode()), number])
    return Trial(kind=kind, number=number, plant="rod" if kind in KINDS else plant, **known[kind].draw(random, number))


def _between(random: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return exp(random.uniform(log(low), log(high)))


def _arm(random: Generator, **changes: Any) -> dict[str, Any]:
    """An arm of 2 cm to 1 m, slender or stout, soft or stiff, light or heavy, coarse or fine, weak or strong."""
    length, strength = _between(random, 0.02, 1.0), _between(random, 0.3, 2.0)
    radius, modulus = length * _between(random, 0.02, 0.12), _between(random, 2e3, 1e5)
    strong, ring = (replace(law, maximum_stress=law.maximum_stress * strength) for law in (LONGITUDINAL, TRANSVERSE))
    return {
        "length": length,
        "base_radius": radius,
        "taper": _between(random, 1.0, 30.0),
        "elements": int(_between(random, 8, 160)),
        "grading": float(random.uniform()),
        "straight_fraction": float(random.uniform(0.4, 0.75)),
        "ring_radius": length / 360 * _between(random, 0.3, 1.5),
        "oblique_radius": radius * float(random.uniform(0.05, 0.15)),
        "oblique_pitch": length * _between(random, 0.05, 0.5),
        "youngs_modulus": modulus,
        "shear_modulus": modulus / float(random.uniform(2.0, 3.0)),
        "densities": tuple(WATER_DENSITY * float(share) for share in random.uniform(0.5, 2.0, 4)),
        "longitudinal": strong,
        "oblique": strong,
        "transverse": ring,
    } | changes


def _some(random: Generator, share: float = 0.7) -> list[str]:
    groups = [group for group in MUSCLE_GROUPS if random.uniform() < share]
    return groups or [str(random.choice(MUSCLE_GROUPS))]


def _activation(
    random: Generator,
    duration: float,
    *,
    level: float = 1.0,
    rise: tuple[float, float] = (1e-3, 0.5),
    groups: Sequence[str] | None = None,
) -> Activation:
    """Every group at its own random level, rate and onset, some of them released again."""
    drives = [
        Plateau(
            groups=(group,),
            level=float(random.uniform(0.0, level)),
            rise=_between(random, *rise),
            onset=float(random.uniform(0.0, duration / 2)),
            offset=float(random.uniform(duration / 2, 2 * duration)),
            fall=_between(random, *rise),
        )
        for group in (groups or _some(random))
    ]
    return Activation(templates=tuple(drives))


def _gentle(random: Generator, number: int) -> dict[str, Any]:
    return {"arm": _arm(random), "activation": _activation(random, 1.0, level=0.3, rise=(0.1, 0.5)), "duration": 1.0}


def _all_groups(random: Generator, number: int) -> dict[str, Any]:
    return {"arm": _arm(random), "activation": _activation(random, 0.5)}


def _step(number: int) -> Activation:
    """One group at level 1 at once, the groups in turn."""
    return Activation(templates=(Plateau(groups=(MUSCLE_GROUPS[number % len(MUSCLE_GROUPS)],), level=1.0, rise=1e-6, onset=0.05),))


def _full_step(random: Generator, number: int) -> dict[str, Any]:
    return {"arm": _arm(random), "activation": _step(number)}


def _waves(random: Generator, number: int) -> dict[str, Any]:
    arm = _arm(random)
    waves = [
        Wave(
            groups=(group,),
            level=float(random.uniform(0.1, 1.0)),
            speed=arm["length"] * _between(random, 0.5, 10.0),
            width=arm["length"] * _between(random, 0.02, 0.3),
            offset=float(random.uniform(0.05, 0.4)),
        )
        for group in _some(random, 0.4)
    ]
    return {"arm": arm, "activation": Activation(templates=tuple(waves))}


def _given_step(random: Generator, number: int) -> dict[str, Any]:
    return _all_groups(random, number) | {"step": _between(random, 0.05, 1.0)}


def _huge_step(random: Generator, number: int) -> dict[str, Any]:
    return _all_groups(random, number) | {"step": _between(random, 1.001, 1e4)}


def _tiny_tip(random: Generator, number: int) -> dict[str, Any]:
    """The octopus arm, equal elements, its last one 0.2 mm long, or graded so that it is."""
    length, grading = 0.2, float(random.choice([0.0, 1.0]))
    taper = _between(random, 4.0, 20.0)
    # Graded elements: length of the last is (L log(taper) / n) / (slope taper).
    whole = length / 2e-4 if grading == 0 else length * log(taper) / ((1 - 1 / taper) * taper * 2e-4)
    arm = {"taper": taper, "grading": grading, "elements": max(8, round(whole))}
    return {"arm": arm, "activation": _activation(random, 0.2), "duration": 0.2}


def _stretched(random: Generator, number: int) -> dict[str, Any]:
    return {"arm": _arm(random), "stretch": 1.3}


def _stretched_active(random: Generator, number: int) -> dict[str, Any]:
    return {"arm": _arm(random), "stretch": 1.3, "activation": _activation(random, 0.5)}


def _water(random: Generator, number: int) -> dict[str, Any]:
    factor = None if random.uniform() < 0.5 else _between(random, 1e-3, 1e3)
    return {"arm": _arm(random), "water": factor, "activation": _activation(random, 0.5)}


def _settling(random: Generator, number: int) -> dict[str, Any]:
    """Constant levels: the muscles' work is bounded, so that the arm must come to rest."""
    drives = [Plateau(groups=(group,), level=float(random.uniform(0.1, 1.0)), rise=0.2) for group in _some(random, 0.4)]
    return {"arm": _arm(random, elements=int(_between(random, 16, 64))), "activation": Activation(templates=tuple(drives)), "duration": 6.0}


NONSENSE: tuple[Any, ...] = (0.0, -1.0, float("nan"), float("inf"), 1e-300, 1e300, -1e-9, "long", None)


def _nonsense(random: Generator, number: int) -> dict[str, Any]:
    """One field of an arm that can be built is replaced by something absurd."""
    arm = _arm(random)
    name = str(random.choice(list(arm)))
    value = NONSENSE[int(random.integers(len(NONSENSE)))]
    absurd = (value,) * 4 if name == "densities" else value
    return {"arm": arm | {name: absurd}, "activation": _activation(random, 0.1), "duration": 0.1}


KINDS = {
    "gentle": Kind(share=12, description="random arms, levels up to 0.3 within 0.1 to 0.5 s", draw=_gentle),
    "all groups": Kind(share=20, description="random arms, random groups, levels up to 1 within 1 to 500 ms", draw=_all_groups),
    "full step": Kind(share=11, description="random arms, one group at level 1 at once", draw=_full_step),
    "waves": Kind(share=10, description="random arms, travelling fronts of several groups, levels up to 1", draw=_waves),
    "given step": Kind(share=8, description="as all groups, at 0.05 to 1 of the predicted limit", draw=_given_step),
    "huge step": Kind(share=5, description="as all groups, at 1.001 to 10,000 times the predicted limit", draw=_huge_step),
    "tiny tip": Kind(share=2, description="elements of 0.2 mm at the tip, random groups", draw=_tiny_tip),
    "stretched": Kind(share=8, description="let go from 1.3 times the length, no activation", draw=_stretched),
    "stretched, active": Kind(share=6, description="the same with random groups", draw=_stretched_active),
    "water": Kind(share=6, description="as all groups, in a vacuum or 0.001 to 1,000 times the drag", draw=_water),
    "restart": Kind(share=4, description="as all groups, saved and loaded on the way: the same bits", draw=_all_groups),
    "threads": Kind(share=4, description="as all groups, in a batch on two threads: the same bits", draw=_all_groups),
    "settling": Kind(share=2, description="constant levels for 6 s: the arm must come to rest", draw=_settling),
    "nonsense": Kind(share=6, description="one field of the arm is absurd", draw=_nonsense),
}
"""Trials of the rod."""


def _assembly_full_step(random: Generator, number: int) -> dict[str, Any]:
    return {"activation": _step(number)}


def _assembly_all_groups(random: Generator, number: int) -> dict[str, Any]:
    return {"activation": _activation(random, 10.0, rise=(0.02, 2.0), groups=MUSCLE_GROUPS), "duration": 10.0}


ASSEMBLY_KINDS = {
    "full arm, full step": Kind(share=1, description="one group at level 1 at once", draw=_assembly_full_step),
    "full arm, all groups": Kind(share=2, description="all groups, levels up to 1 within 20 ms to 2 s, 10 s", draw=_assembly_all_groups),
}
"""Trials of the assembly, which always is the octopus arm."""
