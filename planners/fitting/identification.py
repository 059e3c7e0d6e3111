"""Identification of the reduced model from recorded runs of a plant.

A handful of runs, 20 s in all, excites every muscle group alone and in pairs; the factors of `ReducedParameters` are then fitted by output
error: the model runs under the recorded activation, and what it predicts is compared every 60 ms with

    tangents at 8 stations          over sqrt(24)
    twist between base and station  in turns, times 2 over sqrt(8)
    mean stretch                    times 1/2

in a soft-L1 sum, which forgives the instants at which branches part. Tangents and accumulated twist are compared, never local strains:
curvature goes with the inverse of the radius, and its size at the thin tip would decide the fit.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.sim.activation import Activation, Plateau
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.scene import Scene

from ..model.kinematics import element_lengths, rotation_vectors, section_bounds
from ..model.parameters import ReducedParameters, factor_indices
from ..model.reach import ReachLimits
from ..model.reduced import ReducedModel

Floats = NDArray[np.float64]

INTERVAL = 0.06
"""Time between compared instants, s; also the model's step while it is fitted."""

COMPARED = 8
"""Stations along the arm at which tangents and twist are compared."""

TOLERANCE = 0.02
"""Residual beyond which the soft-L1 loss grows linearly."""

RAMP = 1.7
"""Stretches the ramps of the experiments: faster ones would teach the model to make up for inertia, which it does not have."""

PRIOR = 1.8e-4
"""Weight of a factor's distance from its first guess, per compared number. Residuals are errors of form and not of chance: without it,
factors that hardly matter run away to mend what they do not cause."""

KNOWN_FREE = (
    "longitudinal_stress", "oblique_stress", "transverse_stress", "oblique_passive", "hoop_ratio", "bending", "torsion", "viscosity",
    "quadratic_drag",
)  # fmt: skip
"""Factors fitted with the known laws."""

GENERIC_FREE = (
    *KNOWN_FREE, "passive_stress", "compression", "rotational_drag", "length_slope", "length_curvature", "passive_onset",
)  # fmt: skip
"""Factors fitted with the generic laws."""

RESTING_TONE = 1e-3
"""Level that the muscles of the full arm keep at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidityRegion:
    """What the runs visited; outside of it the model extrapolates.

    Attributes
    ----------
    levels : dict of str to float
        Largest level of each muscle group.
    level_rate : float, 1/s
        Fastest change of a level.
    bend : float
        Largest curvature times the distance of the longitudinal muscles from the axis.
    stretch : (float, float)
    """

    levels: dict[str, float]
    level_rate: float
    bend: float
    stretch: tuple[float, float]

    def outside(self, arm: Arm, strains: ArrayLike, levels: ArrayLike, margin: float = 0.05) -> tuple[str, ...]:
        """Sentences on what of a motion lies outside the region, by more than `margin` of its size; empty if nothing does.

        Parameters
        ----------
        arm : Arm
        strains : (T, S, 4) array_like
        levels : (T, 11, S) array_like
        margin : float

        Returns
        -------
        tuple of str
        """
        found = []
        peak = np.asarray(levels).max(axis=(0, 2))
        for group, value in zip(MUSCLE_GROUPS, peak, strict=True):
            if value > self.levels[group] * (1 + margin) + 1e-9:
                found.append(f"{group} reaches {value:.2f}, identified up to {self.levels[group]:.2f}")
        bend, low, high = _extent(arm, strains)
        if bend > self.bend * (1 + margin):
            found.append(f"bending strain reaches {bend:.2f}, identified up to {self.bend:.2f}")
        if low < self.stretch[0] - margin or high > self.stretch[1] + margin:
            found.append(f"stretch spans {low:.2f}…{high:.2f}, identified within {self.stretch[0]:.2f}…{self.stretch[1]:.2f}")
        return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class IdentifiedModel(Record):
    """A reduced model with identified factors, and how well they are known.

    Attributes
    ----------
    model : ReducedModel
    names : tuple of str
        Factors that were fitted.
    covariance : (n, n) float64
        Of these factors, linearised and with residuals taken as independent, which makes it optimistic.
    residual_rms : float
        Root mean square of the weighted residual.
    validity : ValidityRegion
    reach : ReachLimits
        What the arm can do at rest under levels up to the primitives' bound, found in advance so that a task can be refused at once.
    fingerprint : str
        Of the arm.
    plant : str
        Name of the plant that was recorded: ``"rod"`` or ``"assembly"``.
    statistics : dict
        Evaluations, wall time, software versions, runs.
    """

    model: ReducedModel
    names: tuple[str, ...]
    covariance: Floats
    residual_rms: float
    validity: ValidityRegion
    reach: ReachLimits
    fingerprint: str
    plant: str = "rod"
    statistics: dict[str, Any] = field(default_factory=dict)

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviation of each fitted factor."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def save(self, path: str | Path) -> None:
        """Write everything but arm and scene to a ``.json`` file."""
        content = {
            "arm": self.fingerprint,
            "plant": self.plant,
            "laws": self.model.laws,
            "sections": self.model.sections,
            "parameters": asdict(self.model.parameters),
            "names": self.names,
            "covariance": self.covariance.tolist(),
            "residual_rms": self.residual_rms,
            "validity": asdict(self.validity),
            "reach": asdict(self.reach),
            "statistics": self.statistics,
        }
        Path(path).write_text(json.dumps(content, indent=1), encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path, arm: Arm, scene: Scene | None = None) -> "IdentifiedModel":
        """Read a file written by `save`.

        Raises
        ------
        OctoctrlError
            If it was identified for another arm.
        """
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["arm"] != arm.fingerprint:
            raise OctoctrlError(
                f"{path}: identified for an arm with hash {content['arm']}, this arm '{arm.name}' has {arm.fingerprint}; identify again"
            )
        reach: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in content["reach"].items()}
        validity = content["validity"] | {"stretch": tuple(content["validity"]["stretch"])}
        return cls(
            model=ReducedModel(
                arm=arm,
                scene=Scene() if scene is None else scene,
                laws=content["laws"],
                sections=content["sections"],
                parameters=ReducedParameters(**content["parameters"]),
            ),
            names=tuple(content["names"]),
            covariance=np.array(content["covariance"]),
            residual_rms=content["residual_rms"],
            validity=ValidityRegion(**validity),
            reach=ReachLimits(**reach),
            fingerprint=content["arm"],
            plant=content.get("plant", "rod"),
            statistics=content["statistics"],
        )


def experiments(arm: Arm) -> tuple[tuple[str, Activation, float], ...]:
    """Activations for identification, of one rod and of the full arm.

    Parameters
    ----------
    arm : Arm

    Returns
    -------
    tuple of (str, Activation, float)
        Name, activation and duration (s) of each run, 20 s in all. The published coil-and-telescope programme is not among them: it
        stays held out.
    """
    half = arm.length / 2
    outer = (half, np.inf)
    runs: tuple[tuple[str, float, tuple[Plateau, ...]], ...] = (
        ("oblique step and release", 2.5, (_on("R-OM", 0.3, 0.0, 0.3, 1.3),)),
        ("oblique stairs", 2.5, (_on("L-OM", 0.15, 0.0, 0.3), _on("L-OM", 0.35, 1.2, 0.3))),
        ("bend and release", 3.0, (_on("LM8 LM1 LM2", 0.3, 0.0, 0.5, 1.6),)),
        ("twist, bend, untwist", 3.0, (_on("L-OM", 0.25, 0.0, 0.4, 1.8), _on("LM4 LM5 LM6", 0.3, 0.7, 1.0))),
        ("bend, then twist", 2.5, (_on("LM8 LM1 LM2", 0.2, 0.0, 0.4), _on("L-OM", 0.25, 1.2, 0.4))),
        ("shorten, then elongate", 2.0, (_on(" ".join(LONGITUDINAL_GROUPS), 0.2, 0.0, 0.3, 0.9), _on("TM", 0.6, 1.0, 0.3))),
        ("half bend, half twist", 1.5, (_on("LM6 LM7 LM8", 0.3, 0.0, 0.4, window=(0.0, half)), _on("R-OM", 0.2, 0.1, 0.4, window=outer))),
        ("random levels", 3.0, _random_levels(3.0)),
    )
    return tuple((name, Activation(templates=templates, composition="max"), duration) for name, duration, templates in runs)


def first_guess(arm: Arm, plant: str = "rod") -> ReducedParameters:
    """Factors from which identification starts.

    Parameters
    ----------
    arm : Arm
    plant : {"rod", "assembly"}
        What `Arm.lumped` makes up for in one rod, the full arm has in bodies of their own; nothing squeezes it, as it keeps its volume.

    Returns
    -------
    ReducedParameters
    """
    if plant == "rod":
        return ReducedParameters()
    lumped = arm.lumped
    return ReducedParameters(oblique_passive=1 / lumped.oblique_passive, torsion=1 / lumped.torsion, ring_torsion=0.1, tone=RESTING_TONE)


def free_factors(laws: str, plant: str = "rod") -> tuple[str, ...]:
    """Names of the factors that are fitted for a kind of muscle laws and a plant, tuple of str."""
    free = KNOWN_FREE if laws == "known" else GENERIC_FREE
    return free if plant == "rod" else (*(name for name in free if name != "torsion"), "ring_torsion")


def load_identified(arm: Arm, scene: Scene | None = None, laws: str = "known", plant: str = "rod") -> IdentifiedModel:
    """The model that comes with octoctrl for an arm, or one without identified factors if the arm is another one.

    Parameters
    ----------
    arm : Arm
    scene : Scene, optional
    laws : {"known", "generic"}
    plant : {"rod", "assembly"}

    Returns
    -------
    IdentifiedModel
        Without an identification the factors are those of `first_guess`, ``names`` is empty and the validity region covers nothing.
    """
    path = Path(__file__).parent / "models" / f"{arm.fingerprint}-{plant}-{laws}.json"
    if path.is_file():
        return IdentifiedModel.load(path, arm, scene)
    model = ReducedModel(arm=arm, scene=Scene() if scene is None else scene, laws=laws, parameters=first_guess(arm, plant))
    return IdentifiedModel(
        model=model,
        names=(),
        covariance=np.zeros((0, 0)),
        residual_rms=float("nan"),
        validity=ValidityRegion(levels=dict.fromkeys(MUSCLE_GROUPS, 0.0), level_rate=0.0, bend=0.0, stretch=(1.0, 1.0)),
        reach=model.reach_limits(),
        fingerprint=arm.fingerprint,
        plant=plant,
    )


def identify(
    recordings: Sequence[tuple[Activation, Recording]],
    arm: Arm | None = None,
    scene: Scene | None = None,
    *,
    laws: str = "known",
    plant: str = "rod",
    start: ReducedParameters | None = None,
    free: Sequence[str] | None = None,
    sections: int = 8,
    max_evaluations: int = 15,
) -> IdentifiedModel:
    """Fit the factors of the reduced model to recorded runs.

    Parameters
    ----------
    recordings : sequence of (Activation, recording)
        The activation of each run, and what was recorded: ``time`` (T,), s; ``stations`` (m,), m;
        ``frames`` (T, m, 3, 3); ``stretch`` (T, n) of the elements.
        Every run begins at rest or anywhere else; its first instant is the model's start.
    arm : Arm
    scene : Scene
    laws : {"known", "generic"}
    plant : {"rod", "assembly"}
        What was recorded.
    start : ReducedParameters, optional
        First guess, and the value of the factors that are not fitted; `first_guess` when omitted.
    free : tuple of str, optional
        Factors to fit; `free_factors` when omitted. The linear drag sets the scale of forces: leave it out.
    sections : int
    max_evaluations : int
        Of the whole set of runs, not counting those for derivatives.

    Returns
    -------
    IdentifiedModel

    Raises
    ------
    OctoctrlError
        If there are no recordings or a factor is unknown.
    """
    from scipy.optimize import least_squares

    if not recordings:
        raise OctoctrlError("no recordings given; run `experiments(arm)` on a plant and pass (activation, recording) of each")
    check_number("max_evaluations", max_evaluations, at_least=1)
    begin = perf_counter()
    arm, free = arm or Arm.octopus(), free_factors(laws, plant) if free is None else tuple(free)
    indices = factor_indices(free)
    model = ReducedModel(arm=arm, scene=scene or Scene(), laws=laws, sections=sections, parameters=start or first_guess(arm, plant))
    runs = [_Run(model, activation, recording) for activation, recording in recordings]
    base, compared = model.parameters.vector(), sum(run.measured.size for run in runs)

    def adjusted(factors: Floats) -> ReducedModel:
        vector = base.copy()
        vector[indices] *= factors
        return replace(model, parameters=ReducedParameters.from_vector(vector))

    def residual(factors: Floats) -> Floats:
        candidate = adjusted(factors)
        return np.concatenate([PRIOR * compared * (factors - 1), *(run.residual(candidate) for run in runs)])

    # Multiplicative unknowns that start at 1: a relative difference step at 0 would be no step at all.
    fit = least_squares(
        residual,
        np.ones(len(free)),
        bounds=(0.1, 10.0),
        diff_step=3e-3,
        loss="soft_l1",
        f_scale=TOLERANCE,
        ftol=1e-3,
        xtol=1e-3,
        max_nfev=max_evaluations,
    )
    plain = fit.fun[len(free) :]
    spread = (plain @ plain) / max(len(plain) - len(free), 1)
    covariance = spread * np.linalg.pinv(fit.jac.T @ fit.jac) * np.outer(base[indices], base[indices])
    found = adjusted(fit.x)
    return IdentifiedModel(
        model=found,
        names=free,
        covariance=covariance,
        residual_rms=float(np.sqrt(np.mean(plain**2))),
        validity=_visited(model, runs),
        reach=found.reach_limits(),
        fingerprint=model.arm.fingerprint,
        plant=plant,
        statistics={
            "evaluations": int(fit.nfev),
            "wall_time": perf_counter() - begin,
            "converged": bool(fit.success),
            "runs": len(runs),
            "seconds": float(sum(run.steps.sum() for run in runs)),
            "versions": _versions(),
        },
    )


class _Run:
    """One recording, reduced to what the fit compares."""

    def __init__(self, model: ReducedModel, activation: Activation, recording: Recording) -> None:
        time = np.asarray(recording.time, dtype=float)
        count = int((time[-1] - time[0]) / INTERVAL + 1e-9)
        if count < 2:
            raise OctoctrlError(f"a recording of {time[-1] - time[0]:.3f} s is too short; at least {2 * INTERVAL:g} s are needed")
        picked = np.searchsorted(time, time[0] + INTERVAL * np.arange(count + 1) - 1e-9)
        self.stations = np.asarray(recording.stations, dtype=float)
        self.compared = np.searchsorted(self.stations, np.arange(1, COMPARED + 1) * model.arm.length / COMPARED - 1e-9)
        frames, stretch = np.asarray(recording.frames)[picked], np.asarray(recording.stretch)[picked]
        self.start = model.strains_from_frames(self.stations, frames[0], stretch[0])
        self.strains = model.strains_from_frames(self.stations, frames, stretch)
        self.begin, self.steps = time[picked[0]], np.diff(time[picked])
        self.levels = model.levels(activation, time[picked[1:]])
        self.measured = self._features(frames[1:], stretch[1:] @ element_lengths(self.stations) / model.arm.length)

    def _features(self, frames: Floats, stretch: Floats) -> Floats:
        turns = rotation_vectors(frames[:, :-1] @ np.swapaxes(frames[:, 1:], -1, -2))[..., 2]
        twist = np.cumsum(turns, axis=1)[:, self.compared - 1] / (2 * np.pi)
        tangents = frames[:, self.compared, 2].reshape(len(frames), -1)
        return np.concatenate([tangents / np.sqrt(3 * COMPARED), 2 * twist / np.sqrt(COMPARED), 0.5 * stretch[:, None]], axis=1)

    def residual(self, model: ReducedModel) -> Floats:
        strains = model.simulate(self.levels, self.steps, start=self.start).strains[1:]
        predicted = self._features(model.frames(strains, self.stations), strains[..., 3] @ model.shares)
        return np.nan_to_num(predicted - self.measured, nan=10.0, posinf=10.0, neginf=-10.0).ravel()


def _visited(model: ReducedModel, runs: "Sequence[_Run]") -> ValidityRegion:
    levels = [run.levels for run in runs]
    peaks = np.max([part.max(axis=(0, 2)) for part in levels], axis=0)
    rates = [np.abs(np.diff(run.levels, axis=0) / run.steps[1:, None, None]).max(initial=0.0) for run in runs]
    extents = np.array([_extent(model.arm, run.strains) for run in runs])
    return ValidityRegion(
        levels=dict(zip(MUSCLE_GROUPS, peaks.tolist(), strict=True)),
        level_rate=float(max(rates)),
        bend=float(extents[:, 0].max()),
        stretch=(float(extents[:, 1].min()), float(extents[:, 2].max())),
    )


def _extent(arm: Arm, strains: ArrayLike) -> tuple[float, float, float]:
    """Largest bending strain, smallest and largest stretch of section strains (T, S, 4)."""
    strains = np.asarray(strains)
    bounds = section_bounds(arm, strains.shape[-2])
    offsets = arm.section((bounds[1:] + bounds[:-1]) / 2).muscle_offset
    bend = np.linalg.norm(strains[..., :2], axis=-1) * offsets
    return float(bend.max()), float(strains[..., 3].min()), float(strains[..., 3].max())


def _on(
    groups: str, level: float, onset: float, rise: float, offset: float = np.inf, window: tuple[float, float] = (0.0, np.inf)
) -> Plateau:
    return Plateau(groups=tuple(groups.split()), level=level, onset=onset, rise=RAMP * rise, offset=offset, fall=RAMP * 0.4, window=window)


def _random_levels(duration: float, dwell: float = 0.6) -> tuple[Plateau, ...]:
    """Levels of a twisting and a bending group that change every `dwell` seconds; the same ones every time."""
    draw = np.random.default_rng(2024)
    sides = tuple(" ".join((first, second)) for first, second in pairwise((*LONGITUDINAL_GROUPS, "LM1")))
    templates = []
    for onset in np.arange(0.0, duration - dwell / 2, dwell):
        for choice in (sides, ("R-OM", "L-OM")):
            groups = choice[draw.integers(len(choice))]
            templates.append(_on(groups, round(float(draw.uniform(0.05, 0.3)), 3), float(onset), 0.25, float(onset) + dwell))
    return tuple(templates)


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("octoctrl", "casadi", "numpy", "scipy")}
