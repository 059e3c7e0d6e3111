"""Identification of the reduced model from recorded runs of a plant, those of `experiments` or others.

The factors of `ReducedParameters` are fitted by output error: the model runs under the recorded activation, and what it predicts is
compared every 60 ms with

    tangents at 8 stations          over sqrt(24)
    twist between base and station  in turns, times 2 over sqrt(8)
    mean stretch                    times 1/2

in a soft-L1 sum, which forgives the instants at which branches part. Tangents and accumulated twist are compared, never local strains:
curvature goes with the inverse of the radius, and its size at the thin tip would decide the fit.
"""

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.scene import Scene

from ..model.kinematics import element_lengths, rotation_vectors
from ..model.parameters import ReducedParameters, factor_indices
from ..model.reduced import ReducedModel
from .identified import IdentifiedModel, ValidityRegion, extent, first_guess

Floats = NDArray[np.float64]

INTERVAL = 0.06
"""Time between compared instants, s; also the model's step while it is fitted."""

COMPARED = 8
"""Stations along the arm at which tangents and twist are compared."""

TOLERANCE = 0.02
"""Residual beyond which the soft-L1 loss grows linearly."""

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


def free_factors(laws: str, plant: str = "rod") -> tuple[str, ...]:
    """Names of the factors that are fitted for a kind of muscle laws and a plant, tuple of str."""
    free = KNOWN_FREE if laws == "known" else GENERIC_FREE
    return free if plant == "rod" else (*free, "ring_torsion", "oblique_bending")


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
    runs = [ComparedRun(model, activation, recording) for activation, recording in recordings]
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


class ComparedRun:
    """One recording, reduced to what the fit compares.

    Attributes
    ----------
    start : (S, 4) float64
        The model's strains at the begin.
    strains : (N + 1, S, 4) float64
        Those of the plant.
    steps : (N,) float64, s
    levels : (N, 11, S) float64
    measured : (N, 33) float64
        Weighted tangents, twist and stretch, as the module says.
    """

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
        """What `model` predicts minus what was measured, in a row."""
        strains = model.simulate(self.levels, self.steps, start=self.start).strains[1:]
        predicted = self._features(model.frames(strains, self.stations), strains[..., 3] @ model.shares)
        return np.nan_to_num(predicted - self.measured, nan=10.0, posinf=10.0, neginf=-10.0).ravel()


def _visited(model: ReducedModel, runs: "Sequence[ComparedRun]") -> ValidityRegion:
    levels = [run.levels for run in runs]
    peaks = np.max([part.max(axis=(0, 2)) for part in levels], axis=0)
    rates = [np.abs(np.diff(run.levels, axis=0) / run.steps[1:, None, None]).max(initial=0.0) for run in runs]
    extents = np.array([extent(model.arm, run.strains) for run in runs])
    return ValidityRegion(
        levels=dict(zip(MUSCLE_GROUPS, peaks.tolist(), strict=True)),
        level_rate=float(max(rates)),
        bend=float(extents[:, 0].max()),
        stretch=(float(extents[:, 1].min()), float(extents[:, 2].max())),
    )


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("octoctrl", "casadi", "numpy", "scipy")}
