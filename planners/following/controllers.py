"""The controllers by name, and how one is made from what `execute` is given.

A controller is an object with a `name`, ``levels(observation, reading)`` and ``report()``: `octoctrl.planners.contracts.Controller`. It may
carry `patience`, the share of its duration for which a phase waits for its goals.
"""

from collections.abc import Callable
from typing import Any

from octoctrl.sim.errors import OctoctrlError, suggest
from octoctrl.sim.registries import enter

from ..contracts import Controller
from ..solving.plan import Plan


def tvlqr(plan: Plan) -> Controller:
    """The built-in feedback along a `plan`: an object that can be wrapped."""
    from .tvlqr import TVLQR

    return TVLQR(plan)


def mpc(plan: Plan) -> Controller:
    """Predictive control along a `plan`, which knows the bounds of levels and keeps away from U-turns."""
    from .mpc import MPC

    return MPC(plan)


def open_loop(plan: Plan) -> Controller:
    """The activation of a `plan` and nothing else."""
    from .open_loop import OpenLoop

    return OpenLoop(plan)


def grip(plan: Plan) -> Controller:
    """The activation of a `plan` until it touches, then what holds the shape in which it grasps."""
    from .gripping import Gripping

    return Gripping(plan)


def custom(function: Callable[..., Any]) -> Controller:
    """A `function` of time and observation that takes the place of a plan's activation."""
    from .custom import Custom

    return Custom(function)


CONTROLLERS: dict[str, Callable[[Plan], Controller]] = {"tvlqr": tvlqr, "mpc": mpc, "grip": grip, "open-loop": open_loop}
"""What can be named as feedback, and how it is made for a plan."""


def register(name: str, make: Callable[[Plan], Controller]) -> None:
    """Let `execute`, task files and the command line know a controller by name.

    Parameters
    ----------
    name : str
    make : callable
        From a plan to a controller.

    Raises
    ------
    OctoctrlError
        If the name belongs to another.
    """
    enter(CONTROLLERS, "controller", name, make)


def check_feedback(name: str) -> None:
    """Check the `name` of a feedback.

    Raises
    ------
    OctoctrlError
        If it is unknown; the message suggests the nearest.
    """
    if name not in CONTROLLERS:
        raise OctoctrlError(f"unknown feedback '{name}'{suggest(name, CONTROLLERS)} ({', '.join(CONTROLLERS)})")


def controller(feedback: Any, plan: Plan) -> Controller:
    """The controller that is meant.

    Parameters
    ----------
    feedback : str, callable or Controller
    plan : Plan

    Returns
    -------
    Controller

    Raises
    ------
    OctoctrlError
        If it is none of these.
    """
    if isinstance(feedback, str):
        if feedback not in CONTROLLERS:
            known = ", ".join(CONTROLLERS)
            raise OctoctrlError(f"unknown feedback '{feedback}'{suggest(feedback, CONTROLLERS)} ({known}, a callable or a controller)")
        return CONTROLLERS[feedback](plan)
    if callable(getattr(feedback, "levels", None)) and callable(getattr(feedback, "report", None)) and hasattr(feedback, "name"):
        return feedback
    if callable(feedback):
        return custom(feedback)
    raise OctoctrlError(
        f"feedback is {type(feedback).__name__} {feedback!r}; give the name of a controller ({', '.join(CONTROLLERS)}), a callable, or an "
        "object like a Controller"
    )
