"""One rod in place of 197: how far the rod plant is from the full arm, and what other lumped constants would make of it.

Run with ``python benchmarks/rod_against_assembly.py`` (about four minutes of processor time). Both plants move through the experiments of
identification. The constants of `Arm.lumped`, and then the gains of the muscles besides, are fitted so that tangents, twist and length of
the rod follow those of the full arm, by the loss that also identifies the reduced model. Errors are rod minus full arm, root mean square
over each experiment: lifted writhe (modulo 2) and twist in turns, tip and length in per cent of the arm's length. With ``reduced`` behind
the command, the reduced model is fitted to the full arm as well, without and with the factors that only the full arm has.
"""

import sys
from dataclasses import replace
from time import process_time

import numpy as np
from scipy.optimize import least_squares

import octoctrl as oc
from octoctrl.planners.fitting.experiments import experiments
from octoctrl.planners.fitting.fit import GENERIC_FREE, INTERVAL, KNOWN_FREE, TOLERANCE, ComparedRun, identify
from octoctrl.planners.fitting.identified import first_guess
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.sim.body.arm import LumpedSection
from octoctrl.sim.plants import warmup
from octoctrl.sim.topology.measures import measure

ARM = oc.Arm.octopus()
LUMPED = {"hoop_ratio": (0.0, 0.5), "oblique_passive": (0.05, 10.0), "torsion": (0.05, 30.0)}
GAINS = {"oblique": (0.1, 3.0), "longitudinal": (0.1, 3.0)}
"""Constants that are fitted, and their ranges."""


def with_gain(law, factor):
    """The law with another active stress and the same passive one."""
    return replace(law, maximum_stress=factor * law.maximum_stress, passive_scale=law.passive_scale / factor)


def other_arm(numbers):
    lumped = LumpedSection(**{name: numbers.get(name, getattr(ARM.lumped, name)) for name in LUMPED})
    return replace(ARM, lumped=lumped, **{name: with_gain(getattr(ARM, name), numbers[name]) for name in GAINS if name in numbers})


def features(activation, recording):
    return ComparedRun(ReducedModel(arm=ARM), activation, recording).measured


def rod_runs(arm, runs):
    return [oc.make_plant("rod", arm).advance(activation, float(recording.time[-1])) for _, activation, recording in runs]


def errors(recording, reference):
    """Root mean square errors of one run: writhe, twist, tip and length."""
    times = np.arange(INTERVAL, reference.time[-1], INTERVAL)
    found, wanted = ({"trace": measure(run.time, run.points, run.frames).at(times), "run": run} for run in (recording, reference))
    writhe = found["trace"].lifted_writhe - wanted["trace"].lifted_writhe
    twist = found["trace"].twist - wanted["trace"].twist
    tips, lengths = [], []
    for item in (found, wanted):
        run = item["run"]
        tips.append(np.stack([np.interp(times, run.time, column) for column in run.tip.T], axis=1))
        lengths.append(np.interp(times, run.time, run.length))
    tip = np.linalg.norm(tips[0] - tips[1], axis=1) / ARM.length
    parts = (writhe - 2 * np.round(writhe / 2), twist, 100 * tip, 100 * (lengths[0] - lengths[1]) / ARM.length)
    return np.array([np.sqrt(np.mean(part**2)) for part in parts])


def table(label, arm, runs, wanted):
    recordings = rod_runs(arm, runs)
    residual = np.concatenate([(features(run[1], mine) - other).ravel() for run, mine, other in zip(runs, recordings, wanted, strict=True)])
    print(f"\n{label}: residual rms {np.sqrt(np.mean(residual**2)):.4f}")
    print(f"  {'experiment':26} {'writhe':>7} {'twist':>7} {'tip %':>7} {'length %':>9}")
    rows = np.array([errors(mine, run[2]) for run, mine in zip(runs, recordings, strict=True)])
    for (name, _, _), row in [*zip(runs, rows, strict=True), (("mean", None, None), rows.mean(axis=0))]:
        print(f"  {name:26} {row[0]:7.3f} {row[1]:7.3f} {row[2]:7.1f} {row[3]:9.1f}")


def fit(ranges, runs, wanted):
    start = {name: getattr(ARM.lumped, name, 1.0) for name in ranges}
    scale = np.array(list(start.values()))

    def residual(factors):
        recordings = rod_runs(other_arm(dict(zip(ranges, factors * scale, strict=True))), runs)
        return np.concatenate([(features(run[1], mine) - other).ravel() for run, mine, other in zip(runs, recordings, wanted, strict=True)])

    bounds = np.array(list(ranges.values())).T / scale
    found = least_squares(
        residual, np.ones(len(scale)), bounds=bounds, diff_step=1e-2, loss="soft_l1", f_scale=TOLERANCE, ftol=1e-3, xtol=1e-3, max_nfev=15
    )
    return dict(zip(ranges, (found.x * scale).tolist(), strict=True))


def reduced(runs):
    print(f"\nreduced model of the full arm: residual rms; rms error of twist (turns) and length (%) in '{runs[0][0]}'")
    recordings = [(activation, recording) for _, activation, recording in runs]
    for laws, free in (("known", KNOWN_FREE), ("generic", GENERIC_FREE)):
        for label, guess, names in (
            ("without squeeze and ring torsion", replace(first_guess(ARM), tone=first_guess(ARM, "assembly").tone), free),
            ("with them", None, None),
        ):
            found = identify(recordings, ARM, laws=laws, plant="assembly", start=guess, free=names, max_evaluations=25)
            run = ComparedRun(found.model, *recordings[0])
            difference = run.residual(found.model).reshape(len(run.steps), -1)
            twist, length = difference[:, 31] * np.sqrt(8) / 2, difference[:, 32] * 200
            told = f"twist at the tip {np.sqrt(np.mean(twist**2)):.3f}, length {np.sqrt(np.mean(length**2)):.1f}"
            print(f"  {laws:8} {label:34} {found.residual_rms:.4f}   {told}")


def main():
    warmup("assembly")
    begin, runs = process_time(), []
    for name, activation, duration in experiments(ARM):
        runs.append((name, activation, oc.make_plant("assembly", ARM).advance(activation, duration)))
    print(f"the full arm, {len(runs)} experiments: {process_time() - begin:.0f} s of processor time")
    wanted = [features(activation, recording) for _, activation, recording in runs]
    table("rod as it is", ARM, runs, wanted)
    for ranges in (LUMPED, LUMPED | GAINS):
        numbers = fit(ranges, runs, wanted)
        told = ", ".join(f"{name} {number:.3f}" for name, number in numbers.items())
        table(f"fitted: {told}", other_arm(numbers), runs, wanted)
    if "reduced" in sys.argv[1:]:
        reduced(runs)


if __name__ == "__main__":
    main()
