"""All that an arm may touch, as the arrays that compiled loops take along."""

from collections.abc import Sequence
from math import ceil, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.objects import RigidObject
from .bodies import notes_of, rows_of
from .columns import Anchor
from .markers import Pairs

Floats = NDArray[np.float64]

ROUGHNESS = 0.01
"""Share of the radius by which balls in a row may be hollower than the arm between them."""


class Points(NamedTuple):
    """Material points of a rod, P of them.

    Attributes
    ----------
    element : (P,) uint64
        Counted from 1, as in the rod's buffer.
    share : (P,) float64
        Place within the element.
    radius : (P,) float64, m
        At rest.
    length : (P,) float64, m
        Of the rod that a point stands for.
    """

    element: NDArray[np.uint64]
    share: Floats
    radius: Floats
    length: Floats


class Nodes(NamedTuple):
    """Nodes of the outermost rods of an assembly, P of them, each a ball.

    Attributes
    ----------
    place : (P,) uint64
        In a row of the open rods.
    radius : (P,) float64, m
    length : (P,) float64, m
        Of the arm that a node stands for.
    """

    place: NDArray[np.uint64]
    radius: Floats
    length: Floats


class World(NamedTuple):
    """Bodies and what the arm's points have to do with them; M bodies, P points, room for T samples of notes.

    Attributes
    ----------
    points : Points or Nodes
    bodies : (M, Body.WIDTH) float64
        And their grids, if any is a mesh.
    anchors : (M, P, Anchor.WIDTH) float64
    places : (4, P) float64, m
        Points and radii when it was last looked which of them are near.
    near : (M, P) int64
        Points that may meet each body until one looks again, and how many they are: `counts` (M,) int64.
    slack : (M, P) float64, m
        What is left of the gaps of these at least, if they close at the speeds `paces` (M,), m/s.
    seen : (4,) bool
        What the last look found, see `octoctrl.sim.contact.near_kernels`.
    lease : (1,) float64, s
        For how long nothing can come near, so that one need not look.
    meetings : (M, P, 7) float64
        Normal, place and lever of these in the present step.
    pairs : Pairs
        Bodies that may touch each other.
    bearable : float, m
        By how much a point may sink in deeper than its spring explains; into what is softer than `FIRM` as much more.
    notes : (T + 1, M, Note.WIDTH) float64
        The bodies at the begin, and at the end of each sample from number `noted` on, (M,) int64: until then they stand still, untouched.
    """

    points: Points | Nodes
    bodies: Floats
    anchors: Floats
    places: Floats
    near: NDArray[np.int64]
    counts: NDArray[np.int64]
    slack: Floats
    paces: Floats
    seen: NDArray[np.bool_]
    lease: Floats
    meetings: Floats
    pairs: Pairs
    bearable: float
    notes: Floats
    noted: NDArray[np.int64]

    @classmethod
    def of(
        cls, points: Points | Nodes, objects: Sequence[RigidObject], *, water_density: float = 0.0, bearable: float = inf, step: float = 0.0
    ) -> "World":
        """The world at the begin."""
        count, bodies = len(points.radius), rows_of(objects, water_density=water_density, step=step)
        return cls(
            points=points,
            bodies=bodies,
            anchors=np.zeros((len(bodies), count, Anchor.WIDTH)),
            places=np.zeros((4, count)),
            near=np.zeros((len(bodies), count), dtype=np.int64),
            counts=np.zeros(len(bodies), dtype=np.int64),
            slack=np.zeros((len(bodies), count)),
            paces=np.zeros(len(bodies)),
            seen=np.zeros(4, dtype=bool),
            lease=np.zeros(1),
            meetings=np.zeros((len(bodies), count, 7)),
            pairs=Pairs.of(objects),
            bearable=bearable,
            notes=notes_of(bodies)[None],
            noted=np.zeros(len(bodies), dtype=np.int64),
        )

    def with_room(self, samples: int, *, strict: bool = True) -> "World":
        """The same bodies and anchors, with room for notes of so many samples; unless `strict`, points may sink in however deep."""
        now = notes_of(self.bodies)
        notes = np.empty((samples + 1, *now.shape))
        notes[0] = now
        noted = np.full(len(now), samples)
        return self._replace(lease=np.zeros(1), notes=notes, noted=noted, bearable=self.bearable if strict else inf)

    def kept(self) -> list[Floats]:
        """Notes (T, Note.WIDTH) of each body at the end of each sample, to be read only."""
        begin, notes = self.notes[:1], self.notes[1:]
        still, found = np.broadcast_to(begin, notes.shape), []
        for number, since in enumerate(self.noted.tolist()):
            if since < len(notes):
                notes[:since, number] = begin[:, number]
            found.append((notes if since < len(notes) else still)[:, number])
        return found


def points_of(edges: Floats, radius: Floats, thinnest: float = np.inf) -> Points:
    """Points along a rod, close enough that the row of balls is as smooth as `ROUGHNESS` asks.

    A ball of radius R that touches two balls of radius r at the distance d sinks d^2 / (8 (r + R)) deeper between them than on one.

    Parameters
    ----------
    edges : (n + 1,) float64, m
        Rest arclength of the nodes.
    radius : (n,) float64, m
        Of the elements.
    thinnest : float, m
        Radius of the thinnest body.

    Returns
    -------
    Points
    """
    length = np.diff(edges)
    parts = [max(1, ceil(d / sqrt(8 * ROUGHNESS * r * (r + thinnest)))) for d, r in zip(length, radius, strict=True)]
    shares = [(2 * np.arange(count) + 1) / (2 * count) for count in parts]
    element = np.repeat(np.arange(1, len(length) + 1), parts)
    share = np.concatenate(shares)
    # Between the middles of two elements the radius changes with the place.
    middle = (edges[1:] + edges[:-1]) / 2
    place = edges[element - 1] + share * length[element - 1]
    return Points(
        element=element.astype(np.uint64),
        share=share,
        radius=np.interp(place, middle, radius),
        length=np.repeat(length / parts, parts),
    )
