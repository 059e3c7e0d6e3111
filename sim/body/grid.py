"""Counts of an assembly of rods: rings, their nodes, longitudinal muscles and helices."""

from dataclasses import dataclass, replace
from numbers import Integral

from ..errors import OctoctrlError

LEAST_RINGS, LARGEST_COUNT = 8, 400
LANES = 16
"""Lanes come in so many: a cache line in single precision, and what the processor goes through at once in either."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AssemblyGrid:
    """Counts of an assembly, from which all slots, strides and tables of indices follow.

    Attributes
    ----------
    rings : int
        N, number of rings and of elements of a straight rod.
    ring_nodes : int
        Nodes, and elements, of a ring.
    spokes : int
        Longitudinal muscles, evenly spaced; each meets a node of every ring.
    helices : int
        Oblique helices; the first half is left-handed.
    helix_nodes : int
        Nodes of a helix from one ring to the next.
    bundle : float
        Touching rings of the arm that one ring here stands for: 1, or less in a finer build.
    between : bool
        Whether helices cross the rings between their nodes, which are then too few to meet.
    single : bool
        Whether numbers are of single precision, and positions sums of two of them.

    Raises
    ------
    OctoctrlError
        If opposite and quarter-turn places of a ring would not be nodes, or the counts do not divide.
    """

    rings: int
    ring_nodes: int = 40
    spokes: int = 8
    helices: int = 8
    helix_nodes: int = 2
    bundle: float = 1.0
    between: bool = False
    single: bool = False

    def __post_init__(self) -> None:
        for name, step in (("rings", 1), ("spokes", 4), ("helices", 2), ("helix_nodes", 2), ("ring_nodes", self.spokes)):
            value = getattr(self, name)
            least, most = (LEAST_RINGS, LARGEST_COUNT) if name == "rings" else (step, 96)
            if not isinstance(value, Integral) or value % step or not least <= int(value) <= most:
                raise OctoctrlError(f"{name}={value}: a grid needs a multiple of {step} from {least} to {most}")
        if self.ring_nodes % (self.helices // 2):
            raise OctoctrlError(f"ring_nodes={self.ring_nodes}: a grid needs a multiple of the {self.helices // 2} helices of either hand")

    @property
    def lanes(self) -> int:
        """Numbers per slot: all rings, and room for ghosts."""
        return -(-(self.rings + 4) // LANES) * LANES

    @property
    def middle(self) -> int:
        """Lane where the second half of the arm begins."""
        return self.rings // 2 + 1

    @property
    def half(self) -> "AssemblyGrid":
        """Room for the larger half of the arm."""
        return replace(self, rings=max(self.rings - self.rings // 2, LEAST_RINGS))

    @property
    def straight_rods(self) -> int:
        """Nerve cord and longitudinal muscles."""
        return 1 + self.spokes

    @property
    def spoke_pitch(self) -> int:
        """Ring nodes from one longitudinal muscle to the next."""
        return self.ring_nodes // self.spokes

    @property
    def helix_elements(self) -> int:
        """Elements of a helix, which reaches from the first ring to half a spacing behind the last."""
        return self.helix_nodes * self.rings - self.helix_nodes // 2

    @property
    def open_slots(self) -> int:
        """Slots of the straight rods and helices."""
        return self.straight_rods + self.helices * self.helix_nodes

    @property
    def ring_slots(self) -> int:
        """Slots of the rings."""
        return self.ring_nodes + 2

    @property
    def first_spoke(self) -> int:
        """Slot of the first longitudinal muscle among the spokes."""
        return self.spokes // 4

    @property
    def spoke_slots(self) -> int:
        """Slots of the spokes."""
        return self.first_spoke + self.spokes + self.spokes // 2
