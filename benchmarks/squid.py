"""The strike of a squid's tentacle in both numerics, against the recorded run of the published code and against films of squids.

Run with ``python benchmarks/squid.py`` (about a minute); prints a table, then how much the rings shorten within 0.4 ms by numerics and
step, and writes ``docs/squid.png``. In the films (seven strikes, Kier & van Leeuwen 1997, J. Exp. Biol. 200:41-53; forward model: van
Leeuwen & Kier 1997, Phil. Trans. R. Soc. B 352:551-571) the stalk extends by 43 to 80 % within 20 to 40 ms, faster than 2 m/s, with about
250 m/s^2.
"""

import time
from pathlib import Path

import numpy as np

from octoctrl.sim.body.squid import SquidTentacle
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.sources import Strike

RECORDED = np.array([
    (28, 93.037, 0.0186), (30, 93.125, 0.0918), (32, 93.483, 0.3018), (34, 94.479, 0.7366), (36, 96.543, 1.3461),
    (38, 99.829, 1.9163), (40, 104.020, 2.2284), (42, 108.572, 2.2914), (44, 113.077, 2.1883), (46, 117.272, 1.9876),
    (48, 120.996, 1.7249), (50, 124.148, 1.4231), (52, 126.675, 1.1072), (54, 128.574, 0.7921), (56, 129.861, 0.4971),
    (58, 130.571, 0.2165), (60, 130.735, -0.0512), (62, 130.383, -0.2956), (64, 129.568, -0.5146), (66, 128.357, -0.6888),
    (68, 126.843, -0.8144), (70, 125.139, -0.8829), (72, 123.345, -0.9031), (74, 121.567, -0.8619), (76, 119.969, -0.7437),
    (78, 118.632, -0.5818), (80, 117.573, -0.4668),
])  # fmt: skip
"""Time (ms), length with the club (mm) and speed (m/s) of the published code at its own step, 1.25 µs."""
TENTACLE, AIR, SAMPLE = SquidTentacle(), Scene(water=None), 1e-4
RUNS = {
    "default, 5 µs": {},
    "default, 2.5 µs": {"dt": 2.5e-6},
    "published, 1.25 µs": {"paper_compatible": True},
    "published, 2.5 µs": {"paper_compatible": True, "dt": 2.5e-6},
}


def strike(**settings):
    """Length with the club (m), speed (m/s), acceleration over a millisecond (m/s^2) every 0.1 ms; processor time (s); volumes off."""
    plant = make_plant("assembly", TENTACLE, AIR, sample_interval=SAMPLE, record_every=1, **settings)
    plant.advance(Strike(), SAMPLE)
    plant.reset()
    begin = time.process_time()
    recording = plant.advance(Strike(), 0.08)
    spent, place = time.process_time() - begin, recording.points[:, -1, 1]
    speed = np.gradient(place, SAMPLE)
    kept = [np.abs(recording.series[name] - 1).max() for name in ("volume", "slab_volume")]
    return place + TENTACLE.club_length, speed, (speed[10:] - speed[:-10]) / 1e-3, spent, kept


def measures(length, speed, acceleration):
    """Extension over the stalk's length, its duration from 1 to 99 % (ms), peak speed and peak acceleration."""
    extension = (length - length[0]) / TENTACLE.length
    begin, end = (np.argmax(extension > share * extension.max()) for share in (0.01, 0.99))
    return extension.max(), (end - begin) * SAMPLE * 1e3, speed.max(), acceleration.max()


def glance():
    """Shortening of the rings (%) from 34.0 to 34.4 ms, after a common beginning, by numerics and step."""
    start = make_plant("assembly", TENTACLE, AIR, sample_interval=SAMPLE, resting_tone=0.0)
    start.advance(Strike(), 0.034)
    for published, step in ((False, 5e-6), (False, 2.5e-6), (True, 1.25e-6), (True, 3e-7), (True, 1e-7), (True, 2e-8), (True, 1e-8)):
        plant = make_plant("assembly", TENTACLE, AIR, sample_interval=SAMPLE, resting_tone=0.0, paper_compatible=published, dt=step)
        plant.restore(start.state())
        before = plant.core.muscle_lengths()[2].mean()
        plant.advance(Strike(), 4e-4)
        yield published, step, 100 * (1 - plant.core.muscle_lengths()[2].mean() / before)


def draw(strikes, path):
    """Length and speed over time, with the range of the films."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    styles = {"default, 5 µs": ("tab:blue", "-"), "published, 1.25 µs": ("tab:orange", "-")}
    rest = (TENTACLE.length + TENTACLE.club_length) * 1e3
    left.axhspan(
        rest + 430 * TENTACLE.length,
        rest + 800 * TENTACLE.length,
        facecolor="0.92",
        edgecolor="0.6",
        linewidth=0.5,
        label="furthest, filmed",
    )
    right.axhspan(2.0, 2.6, facecolor="0.92", edgecolor="0.6", linewidth=0.5, label="fastest, filmed: over 2 m/s")
    for name, (color, line) in styles.items():
        length, speed, *_ = strikes[name]
        instants = np.arange(length.size) * SAMPLE * 1e3
        left.plot(instants, length * 1e3, line, color=color, label=name)
        right.plot(instants, speed, line, color=color, label=name)
    left.plot(RECORDED[:, 0], RECORDED[:, 1], ".", color="0.3", label="published code, recorded")
    right.plot(RECORDED[:, 0], RECORDED[:, 2], ".", color="0.3", label="published code, recorded")
    left.set(xlabel="time (ms)", ylabel="length of tentacle with club (mm)", xlim=(20, 80))
    right.set(xlabel="time (ms)", ylabel="speed of the tip (m/s)", xlim=(20, 80), ylim=(-1.2, 2.6))
    left.legend(loc="lower right", frameon=False)
    right.legend(loc="upper right", frameon=False, fontsize="small")
    figure.savefig(path, dpi=130)


def main():
    strikes = {}
    print("numerics, step          extension %   in ms   peak m/s   m/s^2  volume, slab off by %   processor s")
    for name, settings in RUNS.items():
        length, speed, acceleration, cost, kept = strikes[name] = strike(**settings)
        extension, duration, fastest, strongest = measures(length, speed, acceleration)
        off = f"{100 * kept[0]:12.3f}{100 * kept[1]:9.3f}"
        print(f"  {name:22s}{100 * extension:10.1f}{duration:9.1f}{fastest:10.3f}{strongest:9.0f}{off}{cost:14.1f}", flush=True)
        at = np.round(RECORDED[:, 0] * 1e-3 / SAMPLE).astype(int)
        apart, slower = np.abs(length[at] * 1e3 - RECORDED[:, 1]).max(), np.abs(speed[at] - RECORDED[:, 2]).max()
        print(f"    from the recorded run: {apart:.2f} mm, {slower:.3f} m/s ({100 * slower / RECORDED[:, 2].max():.1f} % of its peak)")
    coarse, fine = strikes["default, 5 µs"][0], strikes["default, 2.5 µs"][0]
    print(f"  halving the default's step changes the length by at most {np.abs(coarse - fine).max() * 1e6:.1f} µm")
    print("\nshortening of the rings from 34.0 to 34.4 ms, %")
    for published, step, shortening in glance():
        print(f"  {'published' if published else 'default':10s} {step:8.2g} s {shortening:8.4f}", flush=True)
    path = Path(__file__).parent.parent / "docs" / "squid.png"
    draw(strikes, path)
    print(path)


if __name__ == "__main__":
    main()
