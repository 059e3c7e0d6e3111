"""A primitive of one's own: three methods make it work in schedules, task files, the planner and on the plant.

Run with ``python examples/04_own_primitive.py [--quick]``; leaves ``04_own_primitive.png``.
"""

import sys
from dataclasses import dataclass
from math import inf

import octoctrl as oc


@oc.register_primitive  # so that task files can name it, and plans that use it can be saved
@dataclass(frozen=True, slots=True, kw_only=True)
class Corkscrew:
    """Bend towards one side and twist at the same time, the twist at a fixed share of the level."""

    level: float = 0.2
    share: float = 0.5
    onset: float = 0.0
    rise: float = 1.0
    offset: float = inf
    fall: float = 1.0

    def templates(self):
        """What the muscles do."""
        timing = {"onset": self.onset, "rise": self.rise, "offset": self.offset, "fall": self.fall}
        bend = oc.Plateau(groups=("LM1", "LM2", "LM8"), level=self.level, **timing)
        return bend, oc.Plateau(groups=("R-OM",), level=self.share * self.level, **timing)

    def bounds(self):
        """Numbers that the planner may choose, and between what."""
        return {"level": (0.02, 0.75), "share": (0.0, 1.0), "rise": (0.3, 3.0)}

    def effort(self, seconds):
        """What it costs to be on for so long."""
        return self.level**2 * seconds


def main(quick=False):
    goals = (oc.goal("twist", value=-0.5, tolerance=0.05), oc.goal("lifted_writhe", value=-0.6, tolerance=0.1))
    task = oc.Task(
        name="corkscrew",
        phases=(oc.Phase(name="wind", duration=2.0, goals=goals),),
        drives=(oc.Drive(name="screw", primitive=Corkscrew(), begins="wind", free=("level", "share", "rise")),),
    )
    plan = oc.plan(task)
    run = oc.execute(plan)
    print(plan, run, oc.verify(run), sep="\n\n")
    oc.plot(run, "04_own_primitive.png", overwrite=True, snapshots=1 if quick else 2)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
