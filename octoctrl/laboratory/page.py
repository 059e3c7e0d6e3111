"""The stability laboratory on a page: the matrix as text, table and picture, what the kinds are, and what stopped."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ..files.writing import write_figure, write_text
from ..progress import Progress
from ..tables import machine, table
from .endings import COMPARED, PERTURBATION, SENSITIVE, TOLERANCE, Ending, Outcome
from .studies import matrix, read, summary
from .trials import ASSEMBLY_KINDS, KINDS

MEANING = {
    Ending.ACCURATE: f"a run at half the step, made for one run in {COMPARED}, has its tip within {TOLERANCE:.0%} of the length (rms)",
    Ending.FINISHED: "to the end; not compared",
    Ending.SENSITIVE: "half the step moves the tip by more, and so does everything: a displacement of "
    f"{PERTURBATION:g} of the length grows more than {SENSITIVE:.0f} times, by buckling or whipping",
    Ending.INACCURATE: "half the step moves the tip by more, though the motion is not sensitive: `dt` should be smaller",
    Ending.REFUSED: "before the first step, with one sentence",
    Ending.LIMIT: "by a guard, at a motion that the model or its elements cannot follow: time, rod, element and mechanism are named",
    Ending.UNSTABLE: "by a guard, while the motion alternated from step to step, and not so at a quarter of the step",
    Ending.UNDETECTED: "numbers that no guard caught and no sensible motion has",
}
CHECKS = (
    "numbers are finite",
    "frames orthonormal to 1e-10",
    "base held, tip within reach",
    "Lk = Wr + Tw up to 0.25 turns",
    "kinetic energy below the work that the muscles can do",
    "energy of a passive arm does not grow by 1 % more than at a quarter of the step",
    "an arm with constant activation comes to rest",
    "restart and batches give the same bits",
    "the full arm keeps its volume to 3 %, each slab to 5 %",
)
FOUND = (
    "a flutter of slender tapered tips at slight activation: the brake on the zigzag of curvature had weights by joint, not symmetric, "
    "and fed what it should brake; the fibres of the last element saw more curvature than their moment worked on",
    "trembling at the step's scale of arms let go from a stretch, whose passive fibres are pulled over their slack within few steps",
    "sections that folded over and stayed so, turned inside out, without a guard that noticed",
    "frames that lost their orthonormality in an element that turns by a radian within one step",
    "arms with absurd densities, moduli or layers, and steps beyond counting, that ended in a traceback instead of a sentence",
    "a flutter of rings at the tip of the full arm under thick muscles (`tests/test_assembly_joints.py`): the viscosity and the selective "
    "mass of a hoop, solved for one after the other, made of forces that have a potential some that have none",
)
COLOURS = ("#009E73", "#56B4E9", "#F0E442", "#E69F00", "0.75", "#0072B2", "#D55E00", "#000000")


def text(outcomes: Sequence[Outcome]) -> str:
    """The matrix of the `outcomes` and the numbers that matter, for people."""
    used, rows = _rows(outcomes)
    return "\n".join([*table(("runs", *(ending.value for ending in used), "all"), rows), "", *(f" {line}" for line in _numbers(outcomes))])


def _rows(outcomes: Sequence[Outcome]) -> tuple[list[Ending], list[tuple[str, ...]]]:
    counts = matrix(outcomes)
    used = [ending for ending in Ending if any(row[ending] for row in counts.values()) or ending is Ending.UNDETECTED]
    rows = [(kind, *(str(row[ending] or "·") for ending in used), str(sum(row.values()))) for kind, row in counts.items()]
    return used, [*rows, ("all", *(str(sum(row[ending] for row in counts.values())) for ending in used), str(len(outcomes)))]


def _numbers(outcomes: Sequence[Outcome]) -> list[str]:
    numbers = summary(outcomes)
    lines = [
        f"undetected failures: {numbers['undetected']}",
        f'steps chosen by dt="auto": {numbers["automatic_steps"]} runs, {numbers["automatic_unstable"]} of them unstable',
        f"stopped: {numbers['stopped']}, {numbers['stopped_at_quarter_step_too']} of them at the same time at a quarter of the step; "
        f"{numbers['stops_without_a_place']} without time, rod, element or mechanism",
    ]
    if numbers["median_error"] is not None:
        median, most = numbers["median_error"], numbers["error_of_95_percent"]
        lines.append(
            f"tip against half the step, {numbers['compared_with_half_the_step']} runs that are not sensitive: median {median:.2%} of the "
            f"length, 95 % below {most:.2%}"
        )
    if numbers["volume"] is not None:
        lines.append(
            f"volume furthest from that at rest, of all runs: whole arm {numbers['volume']:.2%}, worst slab {numbers['slab_volume']:.2%}; "
            f"{numbers['retried']} samples done at a part of the step"
        )
    return [*lines, f"{numbers['simulated']:.0f} s of arm motion, {numbers['processor_time']:.0f} s of processor time with all checks"]


def page(studies: dict[str, list[Outcome]], endurance: tuple[dict[str, float], dict[str, float]], commands: list[str], picture: str) -> str:
    """One page of documentation.

    Parameters
    ----------
    studies : dict of str to list of Outcome
        By plant.
    endurance : tuple of dict
        Of `octoctrl.laboratory.endurance`: long run and settled arm.
    commands : list of str
        What makes the page.
    picture : str
        Name of the matrix drawn.
    """
    described = ", ".join(f"{key} {value}" if key not in ("processor", "system") else value for key, value in machine().items())
    parts = [
        "# The stability laboratory",
        "Random arms, activations and steps; each run must end as accurate, refused beforehand, or stopped with the reason. Made by "
        + ", then ".join(f"`{command}`" for command in commands)
        + f" on: {described}. Any run can be repeated: `octoctrl stability --repeat 'all groups:7'`.",
        "Checked in every run that no guard stops: " + "; ".join(CHECKS) + ".",
        f"![Endings by kind of run]({picture})",
    ]
    for plant, outcomes in studies.items():
        used, rows = _rows(outcomes)
        header = ["| runs | " + " | ".join(ending.value for ending in used) + " | all |", "|---" * (len(used) + 2) + "|"]
        kinds = KINDS if plant == "rod" else ASSEMBLY_KINDS
        parts += [
            f"## {'The rod' if plant == 'rod' else f'The full arm, plant {plant}'}",
            "\n".join(header + ["| " + " | ".join(row) + " |" for row in rows]),
            "\n".join(f"* {line}" for line in _numbers(outcomes)),
            "Kinds of runs: " + "; ".join(f"*{name}*: {kind.description}" for name, kind in kinds.items()) + ".",
        ]
        if stops := _stops(outcomes):
            parts.append("\n".join(["What stopped the runs:", "", *stops]))
        if plant != "rod":
            parts.append("\n".join(f"* {item.kind} {item.number}, {_motion(item)}: {item.reason or 'finished'}" for item in outcomes))
    parts += ["## What the columns mean", "\n".join(f"* **{ending.value}**: {said}" for ending, said in MEANING.items())]
    parts += ["## Long runs", _endurance(*endurance), "## What it found", "Mended since, and kept so by `tests/test_laboratory.py`:"]
    return "\n\n".join([*parts, "\n".join(f"* {item};" for item in FOUND[:-1]) + f"\n* {FOUND[-1]}."]) + "\n"


def _motion(outcome: Outcome) -> str:
    if outcome.volume is None or outcome.slab_volume is None:
        return f"{outcome.simulated:.2f} s"
    return f"{outcome.simulated:.2f} s, volume {outcome.volume:.2%}, slab {outcome.slab_volume:.2%}"


def _stops(outcomes: Sequence[Outcome]) -> list[str]:
    mechanisms = Counter(outcome.stop["mechanism"] for outcome in outcomes if outcome.stop)
    return [f"* {count} times an element {mechanism}" for mechanism, count in mechanisms.most_common()]


def _endurance(long: dict[str, float], settled: dict[str, float]) -> str:
    energy = f"energy within {long['energy']:.1%} of its first value, with a trend of {long['energy_trend']:+.1%} over the run"
    frames = f"frames orthonormal to {long['orthonormality']:.0e}"
    momenta = f"momentum kept to {long['momentum']:.0e}, angular momentum to {long['angular_momentum']:.0e} (relative)"
    moving, rest, never = (1e6 * settled[name] for name in ("moving", "rest", "never"))
    return "\n".join(
        [
            f"* {long['steps']:,} steps of a tumbling, bending, twisting elastic rod (constant section): {energy}; {frames}; {momenta}.",
            f"* An arm that rests for a minute does not slow down through subnormal numbers: {moving:.2f} µs a step while it moves, "
            f"{rest:.2f} µs after 60 s of rest, {never:.2f} µs if it never moved. Smallest speed left: {settled['smallest']:.0e} m/s.",
        ]
    )


def write(path: Path, outcomes: Path, progress: Progress | None = None) -> None:
    """Write the page with its picture, of a file of outcomes and of all others beside it that are of other plants.

    Parameters
    ----------
    path : Path
        Of the page; its picture has the ending ``.png``.
    outcomes : Path
        File of outcomes.
    progress : Progress, optional
    """
    from .endurance import long_run, settled_speed

    studies: dict[str, list[Outcome]] = {}
    commands: list[str] = []
    for file in (Path(outcomes), *sorted(Path(outcomes).parent.glob("stability-*.jsonl"))):
        header, found = read(file)
        if header["plant"] not in studies:
            order = [*KINDS, *ASSEMBLY_KINDS]
            studies[header["plant"]] = sorted(found, key=lambda outcome: (order.index(outcome.kind), outcome.number))
            commands.append(f"octoctrl stability --plant {header['plant']} --seed {header['seed']} -n {len(found)}")
    commands[0] += f" --page {path}"
    endurance = long_run(progress=progress), settled_speed(progress)
    if progress is not None:
        progress.stop()
    picture = Path(path).with_suffix(".png")
    draw([outcome for found in studies.values() for outcome in found], picture)
    write_text(Path(path), page(studies, endurance, commands[1:] + commands[:1], picture.name))


def draw(outcomes: Sequence[Outcome], path: Path) -> None:
    """Draw the shares of endings of the `outcomes` by kind, into the picture at `path`."""
    from matplotlib.figure import Figure

    counts = matrix(outcomes)
    figure = Figure(figsize=(8.6, 0.34 * len(counts) + 1.4), layout="constrained")
    axes, names = figure.subplots(), list(counts)[::-1]
    left = [0.0] * len(names)
    for ending, colour in zip(Ending, COLOURS, strict=True):
        shares = [counts[name][ending] / sum(counts[name].values()) for name in names]
        if any(shares):
            axes.barh(names, shares, left=left, color=colour, label=ending.value)
        left = [before + share for before, share in zip(left, shares, strict=True)]
    axes.set(xlim=(0, 1), xlabel=f"share of runs ({len(outcomes):,} in all)")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8)
    write_figure(path, figure, dpi=150)
