"""What a task asks against what the arm can do at rest: the test that comes before any solving.

A hand stores at most so much twist, the arm is at most so long; a goal beyond that would cost a solver all its iterations to be told the
same. The limits belong to the identified model and are known in advance; each kind of goal knows which of them concern it.
"""

from ..asking.task import Task
from ..contracts import Reach


def unreachable(task: Task, reach: Reach) -> str:
    """Why a task cannot be done, in one sentence, or an empty string.

    Parameters
    ----------
    task : Task
    reach : Reach
        At the level bound of the primitives.

    Returns
    -------
    str
    """
    for phase in task.phases:
        for goal in phase.goals:
            limit = goal.beyond(reach)
            if limit:
                return f"phase '{phase.name}' asks for {goal}, but {limit} at activation {reach.level:g}; ask for less"
    return ""
