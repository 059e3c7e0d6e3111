"""Geometry and constants of the assembly: straight rods, rings and oblique helices, as functions of an `Arm` and an `AssemblyGrid`.

Number of rings N: as many as touch when stacked along the arm. Straight rods have N elements, ring i lies in the middle of element i, a
helix has two nodes (or a higher even number) per ring, of which the first lies in the ring's plane at one of its nodes. All lengths m,
masses kg, forces N.

    nerve cord    straight, rod 0
    longitudinal  straight rods 1.., the spokes, inclined towards the axis so that they touch the cord everywhere
    rings         closed
    oblique       helices, the first half left-handed, the others right-handed, evenly spaced

References
----------
Tekinalp et al. (2024), *Topology, dynamics, and control of a muscle-architected soft arm*, SI; radii, fractions and connection scales are
those of the authors' published model.
"""

from dataclasses import dataclass
from math import atan, cos, pi, sin, tau
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..body.arm import Arm, touching_radii
from ..body.grid import LARGEST_COUNT, AssemblyGrid
from ..errors import OctoctrlError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RodFamily:
    """Rods of one kind, R of them with n elements.

    Attributes
    ----------
    points : (R, n + 1, 3) float64, m
        Nodes at rest; (R, n, 3) for closed rods.
    frames : (R, n, 3, 3) float64
        Rows d1, d2, d3.
    radius : (R, n) float64, m
    density : (R,) float64, kg/m^3
    closed : bool
    fibres : float
        Fibres of that radius side by side in one rod: a part of one in a finer build.
    stiffening : float
        Factor on bending and twist stiffness.
    tip_mass : (R,) float64, kg
        Carried by the last nodes.
    """

    points: Floats
    frames: Floats
    radius: Floats
    density: Floats
    closed: bool = False
    fibres: float = 1.0
    stiffening: float = 1.0
    tip_mass: Floats | None = None

    @property
    def edges(self) -> Floats:
        """Vectors (R, n, 3) from node to node, m."""
        if self.closed:
            return np.roll(self.points, -1, axis=1) - self.points
        return np.diff(self.points, axis=1)

    @property
    def centres(self) -> Floats:
        """Centres (R, n, 3) of the elements, m."""
        return self.points[:, : self.radius.shape[1]] + self.edges / 2

    @property
    def length(self) -> Floats:
        """Rest lengths (R, n) of the elements, m."""
        return np.linalg.norm(self.edges, axis=2)

    @property
    def area(self) -> Floats:
        """Cross-sections (R, n) of all fibres, m^2."""
        return self.fibres * pi * self.radius**2

    @property
    def element_mass(self) -> Floats:
        """Masses (R, n) of the elements, kg."""
        return self.density[:, None] * self.area * self.length

    @property
    def node_mass(self) -> Floats:
        """Masses (R, nodes), kg: half of either element, and what the tip carries; in a closed rod one element each."""
        mass = self.element_mass
        if self.closed:
            return mass
        nodes = np.concatenate([mass[:, :1], mass[:, 1:] + mass[:, :-1], mass[:, -1:]], axis=1) / 2
        if self.tip_mass is not None:
            nodes[:, -1] += self.tip_mass
        return nodes

    @property
    def second_moment(self) -> Floats:
        """Second moment of area (R, n) in bending, m^4: the sum of the fibres', each about its own axis; twice that in twist."""
        return self.area**2 / (4 * pi) / self.fibres


@dataclass(frozen=True, slots=True, kw_only=True)
class AssemblyGeometry:
    """The rods of an arm and where they connect.

    Attributes
    ----------
    grid : AssemblyGrid
    spacing : float, m
        Distance of the rings.
    inclination : float, rad
        Of the longitudinal muscles towards the axis.
    straight, rings, oblique : RodFamily
    oblique_nodes : (helices, N) int or float64
        Ring node at which helix j meets ring i; between nodes, with the share of the angle to the next one.
    oblique_edges : (helix nodes,) float64, m
        Heights of the helices' nodes, which bound the cells of their activation.
    """

    grid: AssemblyGrid
    spacing: float
    inclination: float
    straight: RodFamily
    rings: RodFamily
    oblique: RodFamily
    oblique_nodes: Floats
    oblique_edges: Floats

    @property
    def elements(self) -> int:
        """Elements of all rods."""
        return sum(family.radius.size for family in (self.straight, self.rings, self.oblique))


PUBLISHED_NODES = 40


def octopus_grid(arm: Arm, rings: int | None = None, ring_nodes: int | None = None) -> AssemblyGrid:
    """The grid of an arm of eight muscles.

    Published are rings that touch each other, of 40 nodes. With more `rings`, each stands for a part of a published one and has more nodes
    in the same ratio, so that the helices still meet ring nodes. With fewer `ring_nodes` they cross the rings between nodes.

    Raises
    ------
    OctoctrlError
        If the arm's length is no whole number of published rings, or the longitudinal muscles would miss the ring nodes.
    """
    published = round(arm.length / (2 * arm.ring_radius))
    if published < 8 or abs(published * 2 * arm.ring_radius / arm.length - 1) > 1e-9:
        raise OctoctrlError(f"ring_radius={arm.ring_radius:g} m: the arm's length must be a whole number (at least 8) of ring thicknesses")
    rings = published if rings is None else rings
    fit = [count for count in range(published, LARGEST_COUNT + 1) if PUBLISHED_NODES * count % (8 * published) == 0]
    if rings not in fit:
        raise OctoctrlError(
            f"rings={rings!r}: {published} rings of {PUBLISHED_NODES} nodes can only be made finer so that all eight muscles meet a node; "
            f"choose {', '.join(str(count) for count in fit)}"
        )
    nodes = PUBLISHED_NODES * rings // published
    if ring_nodes not in (None, *range(8, nodes + 1, 8)):
        raise OctoctrlError(f"ring_nodes={ring_nodes!r}: eight muscles need a multiple of 8, at most {nodes} with {rings} rings")
    between = ring_nodes not in (None, nodes)
    return AssemblyGrid(rings=rings, ring_nodes=nodes if ring_nodes is None else ring_nodes, bundle=published / rings, between=between)


def assembly_grid(arm: Arm, rings: int | None = None, ring_nodes: int | None = None) -> AssemblyGrid:
    """The grid of the arm's anatomy, or else that of an octopus arm.

    Raises
    ------
    OctoctrlError
        As `octopus_grid`, or if the anatomy has other numbers of `rings` or `ring_nodes`.
    """
    fixed = arm.anatomy.grid
    if fixed is None:
        return octopus_grid(arm, rings, ring_nodes)
    for name, value in (("rings", rings), ("ring_nodes", ring_nodes)):
        if value not in (None, getattr(fixed, name)):
            raise OctoctrlError(
                f"{name}={value!r}: arm '{arm.name}' is built of {fixed.rings} rings of {fixed.ring_nodes} nodes only; leave {name} out"
            )
    return fixed


def assembly_geometry(arm: Arm, grid: AssemblyGrid | None = None, taut: bool = False) -> AssemblyGeometry:
    """Build the rods of `arm` on `grid`, by default on the published one; `taut` helices are straight from ring to ring.

    Raises
    ------
    OctoctrlError
        If ring thickness or pitch of the helices do not fit the grid of rings and ring nodes.
    """
    grid = assembly_grid(arm) if grid is None else grid
    spacing = arm.length / grid.rings
    turn = grid.ring_nodes * spacing / arm.oblique_pitch
    step = turn if grid.between else round(turn)
    if not grid.between and (step < 1 or abs(turn - step) > 1e-9):
        raise OctoctrlError(
            f"oblique_pitch={arm.oblique_pitch:g} m: an oblique fibre must advance by a whole number of ring nodes "
            f"(1/{grid.ring_nodes} turn) per ring; the nearest pitch is {grid.ring_nodes * spacing / max(step, 1):.6g} m"
        )
    outline = _outline(arm, grid)
    cord, muscle = touching_radii(arm, grid.spokes)
    straight, inclination = _straight_rods(arm, grid, cord, muscle, outline)
    layer = straight.radius[0] + 2 * straight.radius[1] + arm.ring_radius
    heights = straight.centres[0, :, 1]
    rings = _rings(arm, grid, heights, layer)
    fibre = arm.oblique_radius * outline
    oblique, nodes, edges = _helices(arm, grid, spacing, step, layer + arm.ring_radius + fibre, fibre, taut)
    return AssemblyGeometry(
        grid=grid,
        spacing=spacing,
        inclination=inclination,
        straight=straight,
        rings=rings,
        oblique=oblique,
        oblique_nodes=nodes,
        oblique_edges=edges,
    )


def _outline(arm: Arm, grid: AssemblyGrid) -> Floats:
    """Radii over those of the first published ring, which fall to 1 / taper at the last one, at the middles of the rings."""
    inside = (grid.bundle - 1) / 2 * (1 - 1 / arm.taper) / (grid.rings * grid.bundle - 1)
    return np.linspace(1.0 - inside, 1 / arm.taper + inside, grid.rings)


def _straight_rods(arm: Arm, grid: AssemblyGrid, cord: float, muscle: float, outline: Floats) -> tuple[RodFamily, float]:
    count, rods = grid.rings, grid.straight_rods
    offset = cord + muscle
    narrowing = offset * (1 - 1 / arm.taper)
    inclination = atan(narrowing / arm.length)
    share = np.linspace(0.0, 1.0, count + 1)
    points, frames = np.zeros((rods, count + 1, 3)), np.empty((rods, count, 3, 3))
    points[0, :, 1] = arm.length * share
    frames[0] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    for number in range(grid.spokes):
        angle = number * tau / grid.spokes
        outward, around = np.array([cos(angle), 0.0, sin(angle)]), np.array([-sin(angle), 0.0, cos(angle)])
        along = cos(inclination) * np.array([0.0, 1.0, 0.0]) - sin(inclination) * outward
        points[number + 1] = offset * outward + (arm.length / cos(inclination) * share)[:, None] * along
        frames[number + 1] = [around, np.cross(along, around), along]
    centres = (points[:, 1:] + points[:, :-1]) / 2
    radius = np.empty((rods, count))
    radius[0] = cord * outline
    radius[1:] = np.linalg.norm(centres[1:] - centres[0], axis=2) - radius[0]
    density = np.array([arm.densities[0]] + grid.spokes * [arm.densities[1]])
    anatomy = arm.anatomy
    family = RodFamily(
        points=points,
        frames=frames,
        radius=radius,
        density=density,
        stiffening=anatomy.straight_stiffening,
        tip_mass=anatomy.tip_mass * radius[:, -1] ** 2 / np.sum(radius[:, -1] ** 2),
    )
    return family, inclination


def _rings(arm: Arm, grid: AssemblyGrid, heights: Floats, layer: Floats) -> RodFamily:
    angle = tau * np.arange(grid.ring_nodes) / grid.ring_nodes
    points = np.empty((heights.size, grid.ring_nodes, 3))
    points[..., 0], points[..., 2] = layer[:, None] * np.cos(angle), layer[:, None] * np.sin(angle)
    points[..., 1] = heights[:, None]
    frames = _frames_of(np.roll(points, -1, axis=1) - points, np.array([0.0, -1.0, 0.0]))
    radius = np.full(points.shape[:2], arm.ring_radius)
    density = np.full(heights.size, arm.densities[2])
    return RodFamily(points=points, frames=frames, radius=radius, density=density, closed=True, fibres=grid.bundle)


def _helices(
    arm: Arm, grid: AssemblyGrid, spacing: float, step: float, path: Floats, fibre: Floats, taut: bool
) -> tuple[RodFamily, Any, Floats]:
    count, per_ring, helices, half = grid.rings, grid.helix_nodes, grid.helices, grid.helices // 2
    node = np.arange(grid.helix_elements + 1)
    heights: Floats = np.asarray(spacing / per_ring * (per_ring / 2 + node), dtype=np.float64)
    angle = tau * step / (per_ring * grid.ring_nodes) * node
    at_node = path[node // per_ring]
    # Helices that advance by two nodes per ring miss every other place between muscles an even number of nodes apart: every other helix,
    # one node on, fills the gaps, so that rings are loaded between their spokes as evenly as in the published grid.
    shift = np.arange(helices) % 2 * (1 - grid.spoke_pitch % 2) if grid.bundle != 1 else np.zeros(helices, dtype=int)
    points = np.empty((helices, node.size, 3))
    for number in range(helices):
        azimuth = (angle if number < half else -angle) + number * tau / half + shift[number] * tau / grid.ring_nodes
        points[number] = np.stack([at_node * np.cos(azimuth), heights, at_node * np.sin(azimuth)], axis=1)
    if taut:
        share = (np.arange(per_ring) / per_ring)[:, None]
        first, second = points[:, :-per_ring:per_ring, None], points[:, per_ring::per_ring, None]
        points[:, : per_ring * (count - 1)] = ((1 - share) * first + share * second).reshape(helices, -1, 3)
    edges = np.diff(points, axis=1)
    frames = _frames_of(edges, np.cross([0.0, 1.0, 0.0], edges))
    before, share = node[:-1] // per_ring, node[:-1] % per_ring / per_ring
    radius = (1 - share) * fibre[before] + share * fibre[np.minimum(before + 1, count - 1)]
    ring, rods = step * np.arange(count), np.arange(helices)[:, None]
    nodes = np.where(rods < half, ring, -ring) + grid.ring_nodes / half * rods + shift[:, None]
    if not grid.between:
        nodes = nodes.astype(int)
    family = RodFamily(points=points, frames=frames, radius=np.tile(radius, (helices, 1)), density=np.full(helices, arm.densities[3]))
    return family, nodes % grid.ring_nodes, heights


def _frames_of(edges: Floats, first: Floats) -> Floats:
    d3 = edges / np.linalg.norm(edges, axis=-1, keepdims=True)
    d1 = np.broadcast_to(first, d3.shape)
    d1 = d1 - np.sum(d1 * d3, axis=-1, keepdims=True) * d3
    d1 = d1 / np.linalg.norm(d1, axis=-1, keepdims=True)
    return np.stack([d1, np.cross(d3, d1), d3], axis=-2)
