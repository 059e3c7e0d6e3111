"""Energies of what connects the rods of an assembly, and of its slabs, in plain NumPy: what the compiled loads are the gradients of.

For books of the energy and for tests. Positions and frames may be complex, so that an imaginary step gives derivatives.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..body.arm import Arm
from .buffer import AssemblyBuffer
from .constants import ring_connections, slab_volumes, straight_connections
from .geometry import AssemblyGeometry
from .layout import AssemblyRow, CrossingRow, SpokeRow

Numbers = NDArray[Any]
Energy = complex
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(40)


def _unit(v: Numbers) -> Numbers:
    return v / _length(v)[..., None]


def _length(v: Numbers) -> Numbers:
    return np.sqrt(np.sum(v * v, axis=-1))


def contact_energy(stiffness: Numbers, overlap: Numbers, effective: Numbers) -> Numbers:
    """Energy (J) of contacts k p^1.5 / (1 + (c p)^2)^1/4 at the `overlap` p, m: Gauss's rule in the root of p."""
    top = np.sqrt(np.where(overlap.real > 0, overlap, 0))
    root = top[..., None] * (POINTS + 1) / 2
    inside = 2 * root**4 / (1 + (np.asarray(effective)[..., None] * root**2) ** 2) ** 0.25
    return stiffness * np.sum(inside * WEIGHTS, axis=-1) * top / 2


class Connections:
    """Connections of an arm at given places.

    Parameters
    ----------
    arm : Arm
    geometry : AssemblyGeometry
    rods : AssemblyBuffer
        Whose parameters are in use; its state is not looked at.
    straight : (straight rods, N + 1, 3), m
    oblique : (helices, nodes, 3), m
    rings : (N, ring nodes, 3), m
    frames : (straight rods, N, 3, 3)
        Of the elements of cord and muscles.
    """

    def __init__(
        self,
        arm: Arm,
        geometry: AssemblyGeometry,
        rods: AssemblyBuffer,
        straight: Numbers,
        oblique: Numbers,
        rings: Numbers,
        frames: Numbers,
    ) -> None:
        self.arm, self.geometry, self.grid, self.rods = arm, geometry, geometry.grid, rods
        self.straight, self.oblique, self.rings, self.frames = straight, oblique, rings, frames
        self.centre, self.edge = (straight[:, 1:] + straight[:, :-1]) / 2, np.diff(straight, axis=1)
        self.root = 1 / np.sqrt(_length(self.edge) / self.geometry.straight.length)
        self.radius = self.geometry.straight.radius * self.root
        self.thick, self.fibre = self.arm.ring_radius, self.geometry.oblique.radius
        self.muscles, self.pitch, nodes = self.grid.spokes, self.grid.spoke_pitch, self.grid.ring_nodes
        self.q = self.pitch * np.arange(self.muscles)
        across = rings[:, self.q] - rings[:, (self.q + nodes // 2) % nodes]
        along = rings[:, (self.q + nodes // 4) % nodes] - rings[:, self.q - nodes // 4]
        self.outward, self.hinge = np.swapaxes(_unit(across), 0, 1), np.swapaxes(_unit(along), 0, 1)
        self.spoke = np.swapaxes(rings[:, self.q], 0, 1)

    def sides(self) -> Energy:
        """Cord to muscles and muscles to neighbours, J."""
        sides = straight_connections(self.arm, self.geometry)
        first, second, half = sides.first, sides.second, sides.gap / 2
        reach = [self.radius[rods] + half * self.root[rods] for rods in (first, second)]
        arms = [
            length[..., None] * np.einsum("pnji,pnj->pni", self.frames[rods], direction)
            for length, rods, direction in zip(reach, (first, second), (sides.direction1, sides.direction2), strict=True)
        ]
        between = self.centre[second] - self.centre[first]
        overlap = reach[0] + reach[1] - _length(between)
        spring = np.sum(0.5 * sides.spring * np.sum((between + arms[1] - arms[0]) ** 2, axis=-1))
        touching = np.where(overlap.real > 0, overlap, 0)
        return spring + np.sum(0.4 * sides.contact * touching**2 * np.sqrt(touching))

    def ring_connections(self) -> Energy:
        """Rings to muscles with their locks and own contact, and rings to rings, J."""
        joints, effective = ring_connections(self.arm, self.geometry), self.rods.spoke(SpokeRow.R_EFFECTIVE)
        muscle, edge = self.centre[1:], self.edge[1:]
        reach = self.thick + self.radius[1:]
        gap = muscle - self.spoke + reach[..., None] * self.outward
        overlap = reach - _length(muscle - self.spoke)
        energy = np.sum(0.5 * joints.muscle_spring * np.sum(gap**2, axis=-1))
        energy += contact_energy(joints.muscle_contact, overlap, effective).sum()
        skew, tilt = np.sum(edge * self.hinge, axis=-1), np.sum(edge * self.outward, axis=-1)
        lean = self.geometry.spacing * np.tan(self.geometry.inclination)
        energy += np.sum(0.5 * joints.muscle_torque * (0.75 * skew**2 + 0.25 * (tilt + lean) ** 2))
        apart = np.diff(self.spoke, axis=1)
        slip = np.sum(apart * (self.hinge[:, 1:] + self.hinge[:, :-1]) / 2, axis=-1)
        return energy + np.sum(0.5 * joints.ring_spring * slip**2)

    def contacts(self) -> Energy:
        """Muscles with the ring nodes beside their spokes, J."""
        joints, effective, energy = ring_connections(self.arm, self.geometry), self.rods.spoke(SpokeRow.R_EFFECTIVE), 0.0
        for m in range(self.muscles):
            for away in (*range(1 - self.pitch, 0), *range(1, self.pitch)):
                node = self.rings[:, (self.q[m] + away) % self.grid.ring_nodes]
                overlap = self.thick + self.radius[m + 1] - _length(node - self.centre[m + 1])
                energy += contact_energy(joints.muscle_contact, overlap, effective[m]).sum()
        return energy

    def crossings(self) -> Energy:
        """Rings to helices, J."""
        joints, grid, energy = ring_connections(self.arm, self.geometry), self.grid, 0.0
        every, effective = np.arange(grid.rings), self.rods.crossing(CrossingRow.EFFECTIVE)
        fibre = np.concatenate([self.fibre, self.fibre[:, -1:]], axis=1)
        for j, nodes in enumerate(self.geometry.oblique_nodes):
            side, h = 1 if j < grid.helices // 2 else -1, grid.helix_nodes * every
            if grid.between:
                width = 2 * np.pi / grid.ring_nodes
                before = np.floor(nodes + 1e-9).astype(int)
                angle = (nodes - before) * width
                share = (np.sin(angle) / (np.sin(angle) + np.sin(width - angle)))[:, None]
                arc = (np.cos(angle - width / 2) / np.cos(width / 2))[:, None]
                near, far = (
                    (1 - share) * self.rings[every, (before + half) % grid.ring_nodes]
                    + share * self.rings[every, (before + half + 1) % grid.ring_nodes]
                    for half in (0, grid.ring_nodes // 2)
                )
                met, outward = (near + far) / 2 + arc * (near - far) / 2, _unit(near - far)
                pairs = []
            else:
                met = self.rings[every, nodes]
                outward = _unit(met - self.rings[every, (nodes + grid.ring_nodes // 2) % grid.ring_nodes])
                pairs = [(side, 1), (side, 2), (-side, -1), (-side, -2)]
            reach, helix = self.thick + fibre[j, h], self.oblique[j, h]
            gap = met + reach[:, None] * outward - helix
            energy += np.sum(0.5 * joints.oblique_spring * np.sum(gap**2, axis=-1))
            overlap = reach - _length(met - helix)
            energy += contact_energy(joints.oblique_contact, overlap, effective[j]).sum()
            for along, around in pairs:
                there = (h + along >= 0) & (h + along < fibre.shape[1] - 1)
                place = np.where(there, h + along, 0)
                apart = self.rings[every, (nodes + around) % grid.ring_nodes] - self.oblique[j, place]
                overlap = np.where(there, self.thick + fibre[j, place] - _length(apart), -1.0)
                energy += contact_energy(joints.oblique_contact, overlap, effective[j]).sum()
        return energy

    def volumes(self) -> Numbers:
        """Volumes (N,) of the slabs, m^3."""
        area = self.geometry.straight.area[1:]
        vector = np.cross(np.roll(self.rings, -1, axis=1), self.rings).sum(axis=1) / 2
        return np.sum(vector * np.einsum("rn,rnk->nk", area / area.sum(axis=0), self.edge[1:]), axis=1)

    def pressure(self) -> Energy:
        """Slabs, J."""
        rest = slab_volumes(self.geometry)
        return np.sum(0.5 * self.arm.anatomy.bulk_modulus * rest * (1 - self.volumes() / rest) ** 2)


def connections_of(arm: Arm, geometry: AssemblyGeometry, rods: AssemblyBuffer) -> Connections:
    """Connections at the places that the buffer holds."""
    straight, oblique, rings = rods.points(rods.straight, nodes=True), rods.points(rods.oblique, nodes=True), rods.points(rods.ring)
    frames = np.stack([rods.straight(AssemblyRow.Q11 + i) for i in range(9)], axis=-1).reshape(*straight[:, 1:].shape[:2], 3, 3)
    return Connections(arm, geometry, rods, straight, oblique, rings, frames)
