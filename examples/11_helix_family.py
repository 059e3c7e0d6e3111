"""The constant-link family of helices (Tekinalp et al. 2024, Fig. 2b): link stays 2 as the helix flattens, twist turns into writhe."""

import matplotlib.pyplot as plt
import numpy as np

from octoctrl.sim.topology.measures import measure

LENGTH, TURNS, NODES = 0.2, 2, 301
COLOURS = {"link": "#009E73", "writhe": "#0072B2", "twist": "#D55E00"}


def helix(psi):
    """Nodes (n + 1, 3) and frames (n + 2, 3, 3) of a helix about +z whose tangent stands psi (rad) above the plane; d1 points outwards."""
    s = np.linspace(0.0, LENGTH, NODES)
    angle = 2 * np.pi * TURNS * s / LENGTH
    radius = LENGTH * np.cos(psi) / (2 * np.pi * TURNS)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), s * np.sin(psi)], axis=1)
    middle = np.concatenate([[angle[0]], (angle[1:] + angle[:-1]) / 2, [angle[-1]]])
    outward = np.stack([np.cos(middle), np.sin(middle), 0 * middle], axis=1)
    along = np.stack([-np.cos(psi) * np.sin(middle), np.cos(psi) * np.cos(middle), np.full(len(middle), np.sin(psi))], axis=1)
    return points, np.stack([outward, np.cross(along, outward), along], axis=1)


# From nearly straight to nearly flat: a flat circle run through twice would touch itself.
steepness = np.radians(np.linspace(89.0, 3.0, 40))
shapes = [helix(psi) for psi in steepness]
points, frames = (np.array(part) for part in zip(*shapes, strict=True))
trace = measure(np.arange(len(steepness), dtype=float), points, frames)

print(" psi, deg    link   writhe    twist   2 (1 - sin psi)   2 sin psi")
for k in range(0, len(steepness), 6):
    measured = trace.lifted_link[k], trace.lifted_writhe[k], trace.twist[k]
    expected = TURNS * (1 - np.sin(steepness[k])), TURNS * np.sin(steepness[k])
    print(f"{np.degrees(steepness[k]):9.1f}", *(f"{value:+8.3f}" for value in measured), *(f"{value:+13.3f}" for value in expected))

figure = plt.figure(figsize=(8.6, 4.6), layout="constrained")
grid = figure.add_gridspec(2, 5, height_ratios=(1.25, 1))
for column, psi in enumerate(np.radians([89.0, 70.0, 45.0, 20.0, 3.0])):
    line, arm = helix(psi)
    axes = figure.add_subplot(grid[0, column], projection="3d")
    axes.plot(*line.T, color="0.35", lw=2.0)
    axes.plot(*(line[:-1] + 6e-3 * arm[1:-1, 0]).T, color="#D55E00", lw=0.8)  # the other edge of the ribbon
    axes.set(xlim=(-0.03, 0.03), ylim=(-0.03, 0.03), zlim=(-0.02, 0.2))
    axes.set_title(f"ψ = {np.degrees(psi):.0f}°", fontsize=9)
    axes.set_box_aspect((0.6, 0.6, 2.0), zoom=1.4)
    axes.set_axis_off()
panel = figure.add_subplot(grid[1, :])
for name, values in (("link", trace.lifted_link), ("writhe", trace.lifted_writhe), ("twist", trace.twist)):
    panel.plot(np.degrees(steepness), values, color=COLOURS[name], lw=2, label=name)
panel.plot(np.degrees(steepness), TURNS * np.sin(steepness), "k--", lw=0.9, label="2 sin ψ, 2 (1 - sin ψ)")
panel.plot(np.degrees(steepness), TURNS * (1 - np.sin(steepness)), "k--", lw=0.9)
panel.set(xlabel="steepness ψ of the helix [deg]", ylabel="[turns]", xlim=(90, 0))
panel.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=8)
figure.savefig("11_helix_family.png", dpi=150)
