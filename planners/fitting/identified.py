"""An identified model: the reduced model with its factors, how well they are known, and where it was tried; as a file, and by arm."""

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.sim.annotations import made
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, brief
from octoctrl.sim.records import Record
from octoctrl.sim.scene.scene import Scene

from ..model.kinematics import section_bounds
from ..model.parameters import ReducedParameters
from ..model.reach import ReachLimits
from ..model.reduced import ReducedModel

Floats = NDArray[np.float64]

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
        bend, low, high = extent(arm, strains)
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

    def divided(self, sections: int) -> "IdentifiedModel":
        """The same with so many sections: the factors are of the tissue and the water, not of how the arm is divided.

        Parameters
        ----------
        sections : int

        Returns
        -------
        IdentifiedModel
        """
        return replace(self, model=replace(self.model, sections=sections))

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
            If it is no such file, or was identified for another arm.
        """
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            if not content["arm"].isalnum():
                raise ValueError("no fingerprint")
            if content["arm"] != arm.fingerprint:
                other = brief(content["arm"])
                raise OctoctrlError(
                    f"{path}: identified for an arm with hash {other}, this arm '{arm.name}' has {arm.fingerprint}; identify again"
                )
            listed = {name: {key: _tuple(value) for key, value in content[name].items()} for name in ("validity", "reach", "parameters")}
            model = {
                "arm": arm,
                "scene": Scene() if scene is None else scene,
                "laws": content["laws"],
                "sections": content["sections"],
                "parameters": made(ReducedParameters, listed["parameters"]),
            }
            values = {
                "model": made(ReducedModel, model),
                "names": tuple(content["names"]),
                "covariance": np.array(content["covariance"], dtype=np.float64),
                "residual_rms": content["residual_rms"],
                "validity": made(ValidityRegion, listed["validity"]),
                "reach": made(ReachLimits, listed["reach"]),
                "fingerprint": content["arm"],
                "plant": content.get("plant", "rod"),
                "statistics": content["statistics"],
            }
            return made(cls, values)
        except OctoctrlError:
            raise
        except Exception:  # whatever becomes of values that no model has
            raise OctoctrlError(f"{path} is no reduced model, or is damaged; make one with: octoctrl identify -o {path}") from None


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


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
    return ReducedParameters(
        longitudinal_stress=1 / lumped.longitudinal_stress, oblique_stress=1 / lumped.oblique_stress,
        oblique_passive=1 / lumped.oblique_passive, torsion=1 / lumped.torsion, ring_torsion=0.1, oblique_bending=1.0, tone=RESTING_TONE,
    )  # fmt: skip


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
    return unidentified(model, plant)


def unidentified(model: ReducedModel, plant: str) -> IdentifiedModel:
    """A model as it is, with nothing identified on the `plant`: its region of validity covers nothing.

    Parameters
    ----------
    model : ReducedModel
    plant : {"rod", "assembly"}

    Returns
    -------
    IdentifiedModel
    """
    return IdentifiedModel(
        model=model,
        names=(),
        covariance=np.zeros((0, 0)),
        residual_rms=float("nan"),
        validity=ValidityRegion(levels=dict.fromkeys(MUSCLE_GROUPS, 0.0), level_rate=0.0, bend=0.0, stretch=(1.0, 1.0)),
        reach=model.reach_limits(),
        fingerprint=model.arm.fingerprint,
        plant=plant,
    )


def extent(arm: Arm, strains: ArrayLike) -> tuple[float, float, float]:
    """Largest bending strain, smallest and largest stretch of section strains (T, S, 4)."""
    strains = np.asarray(strains)
    bounds = section_bounds(arm, strains.shape[-2])
    offsets = arm.section((bounds[1:] + bounds[:-1]) / 2).muscle_offset
    bend = np.linalg.norm(strains[..., :2], axis=-1) * offsets
    return float(bend.max()), float(strains[..., 3].min()), float(strains[..., 3].max())
