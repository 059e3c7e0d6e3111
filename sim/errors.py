"""What goes wrong, said in one sentence: what is wrong, the value found, what is allowed, what to do."""

import difflib
import math
import numbers
from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .findings import Stop


class OctoctrlError(ValueError):
    """Bad input from the user; the message is one complete sentence. The command line turns it into exit code 2."""


class PlantUnstableError(RuntimeError):
    """The simulation diverged or a guard stopped it; carries time, rod, element, mechanism and the last good state.

    Attributes
    ----------
    time : float, s
        When the guard noticed.
    rod : str
        Which rod, ``"arm"`` if there is only one.
    element : int
        Element with the worst value.
    mechanism : str
        What is wrong with it, as a predicate: "is stretched beyond ...".
    recording : Recording or None
        What was recorded up to the last good state.
    stop : octoctrl.sim.findings.Stop or None
        All that as one object, with the finding and whether the step was unstable.
    """

    def __init__(
        self,
        message: str,
        *,
        time: float,
        element: int,
        mechanism: str,
        rod: str = "arm",
        recording: Any = None,
        stop: "Stop | None" = None,
    ) -> None:
        super().__init__(message)
        self.time = time
        self.rod = rod
        self.element = element
        self.mechanism = mechanism
        self.recording = recording
        self.stop = stop

    @classmethod
    def of(cls, stop: "Stop", message: str, recording: Any = None) -> "PlantUnstableError":
        """The error that says `message` of a `stop`."""
        return cls(message, time=stop.time, element=stop.element, mechanism=stop.mechanism, rod=stop.rod, recording=recording, stop=stop)

    def __reduce__(self) -> tuple[Any, ...]:
        # An exception is made anew from its message alone; a pool of processes sends it to the caller whole.
        return _unstable, (str(self), vars(self))


def _unstable(message: str, content: dict[str, Any]) -> PlantUnstableError:
    return PlantUnstableError(message, **content)


class OctoctrlWarning(UserWarning):
    """Something the user should know that does not stop the work."""


def check_number(
    name: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    unit: str = "",
    advice: str = "",
) -> None:
    """Check a finite number against its allowed range.

    Raises
    ------
    OctoctrlError
        If `value` is not a finite real number inside the range; the message names the value, the range and `advice`.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise OctoctrlError(f"{name}: expected a number{f' in {unit}' if unit else ''}, found {_describe(value)}")
    try:
        found = float(value)
    except OverflowError:  # a whole number may be of any size
        found = math.inf
    if not math.isfinite(found):
        raise OctoctrlError(f"{name} is {brief(value)}; a finite number is needed")
    low_open, high_open = above is not None, below is not None
    low, high = (above if low_open else at_least), (below if high_open else at_most)
    too_low = low is not None and (found <= low if low_open else found < low)
    too_high = high is not None and (found >= high if high_open else found > high)
    if too_low or too_high:
        space = f" {unit}" if unit else ""
        if low is not None and high is not None:
            allowed = f"{low:g}…{high:g}{space}"
        else:
            allowed = (f"{'>' if low_open else '>='} {low:g}" if low is not None else f"{'<' if high_open else '<='} {high:g}") + space
        raise OctoctrlError(f"{name}={found:g}{space} is outside {allowed}{f'; {advice}' if advice else ''}")


def check_numbers(name: str, values: object, count: int, example: str) -> None:
    """Check that `values` are `count` finite numbers; an `example` shows what they may be.

    Raises
    ------
    OctoctrlError
        If they are anything else.
    """
    listed = values if isinstance(values, tuple | list) else ()
    fit = len(listed) == count and all(isinstance(item, int | float) and not isinstance(item, bool) for item in listed)
    if not fit or not all(abs(item) < math.inf for item in listed):
        word = {2: "two", 3: "three"}.get(count, str(count))
        raise OctoctrlError(f"{name} is {brief(values)}; {word} finite numbers are needed, such as {example}")


def check_window(owner: str, window: Any) -> None:
    """Check a window of the arm: two arclengths, m, of which the second may be infinite.

    Raises
    ------
    OctoctrlError
        If it is something else, or the begin does not lie before the end; the message names the `owner`.
    """
    if not isinstance(window, tuple | list) or len(window) != 2:
        raise OctoctrlError(f"{owner}: window is {brief(repr(window))}; two arclengths in metres are needed")
    for edge in window:
        if edge != math.inf:
            check_number(f"{owner}: window", edge, unit="m")
    if window[0] >= window[1]:
        raise OctoctrlError(f"{owner}: window {tuple(window)} m: the begin must lie before the end")


def check_kind(name: str, value: object, kinds: type | tuple[type, ...], advice: str = "") -> None:
    """Check that `value` is an object of one of some classes (`kinds`); `advice` says how to come by one.

    Raises
    ------
    OctoctrlError
        If it is something else.
    """
    if not isinstance(value, kinds):
        wanted = " or ".join(a(kind.__name__) for kind in (kinds if isinstance(kinds, tuple) else (kinds,)))
        text = repr(value)
        found = text if len(text) <= 40 else a(type(value).__name__)
        raise OctoctrlError(f"{name} is {brief(found)}; {wanted} is needed{f': {advice}' if advice else ''}")


def check_count(name: str, value: object, *, at_least: int = 1, at_most: int | None = None, advice: str = "") -> int:
    """Check a whole number against its allowed range.

    Raises
    ------
    OctoctrlError
        If `value` is not a whole number inside the range.

    Returns
    -------
    int
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise OctoctrlError(f"{name}: expected a whole number, found {_describe(value)}")
    check_number(name, value, at_least=at_least, at_most=at_most, advice=advice)
    return int(value)


def suggest(word: object, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the nearest known word, or an empty string."""
    lowered = {name.lower(): name for name in known}
    near = difflib.get_close_matches(str(word).lower(), list(lowered), n=1, cutoff=0.6)
    return f"; did you mean '{lowered[near[0]]}'?" if near else ""


def check_choice(name: str, value: object, choices: Collection[str]) -> None:
    """Check that `value` is one of `choices`; the error suggests the nearest."""
    if not isinstance(value, str) or value not in choices:
        listed = ", ".join(str(choice) for choice in choices)
        raise OctoctrlError(f"unknown {name} '{brief(value)}'{suggest(value, choices)} ({listed})")


def brief(value: object, longest: int = 80) -> str:
    """Quote a `value` in a message: as it is printed, on one line, and of what is longer than `longest` characters both ends."""
    text = " ".join(str(value).split())
    return text if len(text) <= longest else f"{text[: longest - 20]} … {text[-17:]}"


def a(word: str) -> str:
    """A `word` with its article, by how it is written."""
    return f"{'an' if word[:1] in 'AEIOUaeiou' else 'a'} {word}"


def _describe(value: object) -> str:
    return f"the string {brief(repr(value))}" if isinstance(value, str) else f"{type(value).__name__} {brief(repr(value))}"
