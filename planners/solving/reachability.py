"""What a task asks against what the arm can do at rest: the test that comes before any solving.

Bending by one side alone gives at most so many turns, a hand stores at most so much twist; a goal beyond that would cost a solver all its
iterations to be told the same. The limits belong to the identified model and are known in advance.
"""

WRITHE_MARGIN = 0.1
"""Lifted writhe of a planar coil is its turns to the nearest whole number: the geodesic that closes the tangents takes or gives the rest.
A coil that is not quite planar may have this much more."""


def unreachable(task, reach):
    """Why a task cannot be done, in one sentence, or an empty string.

    Parameters
    ----------
    task : Task
    reach : ReachLimits
        Of `octoctrl.planners.model.reach`, at the level bound of the primitives.

    Returns
    -------
    str
    """
    for phase in task.phases:
        goals = {goal.quantity: goal for goal in phase.goals}
        least = {name: abs(goal.value) - goal.tolerance for name, goal in goals.items()}
        if "twist" in goals:
            hand = "L-OM" if goals["twist"].value > 0 else "R-OM"
            if least["twist"] > abs(reach.twist[hand]):
                return _sentence(phase, goals["twist"], f"{hand} stores at most {abs(reach.twist[hand]):.2f} turns of twist", reach)
        if "lifted_writhe" in goals:
            planar = "twist" in goals and abs(goals["twist"].value) <= goals["twist"].tolerance
            limit = round(reach.turns) + WRITHE_MARGIN if planar else reach.writhe
            what = (
                f"a planar coil of the {reach.turns:.2f} turns that the arm can bend has at most"
                if planar
                else "bend and twist give at most"
            )
            if least["lifted_writhe"] > limit:
                return _sentence(phase, goals["lifted_writhe"], f"{what} {limit:.2f} turns of writhe", reach)
        if "length" in goals and not reach.length[0] <= goals["length"].value <= reach.length[1]:
            low, high = reach.length
            return _sentence(phase, goals["length"], f"the arm is between {low * 1e3:.0f} and {high * 1e3:.0f} mm long", reach)
    return ""


def _sentence(phase, goal, limit, reach):
    return (
        f"phase '{phase.name}' asks for {goal.quantity.replace('_', ' ')} {goal.value:g}, but {limit} at activation {reach.level:g}; "
        "ask for less"
    )
