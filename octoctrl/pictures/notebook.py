"""Runs and pages in notebooks: a run shows its verdict and its traces, a page itself in a frame."""

import html
from dataclasses import dataclass

from ..carrying.results import Execution
from ..judging.verification import verify
from .sections import checks_table, made
from .traces import traces_picture

_STYLE = (
    ".octoctrl{max-width:900px;font:13px system-ui,sans-serif}.octoctrl svg{width:100%;height:auto}.octoctrl td.meter{width:110px}"
    ".octoctrl td.meter i{display:block;height:6px;border-radius:3px;background:#00795a}.octoctrl tr.fail td{color:#b3261e;font-weight:600}"
    ".octoctrl tr.fail td.meter i{background:#b3261e}"
)


@dataclass(frozen=True, slots=True)
class Page:
    """The page of one or more runs as text, which a notebook shows in a frame of its own.

    Attributes
    ----------
    text : str
        HTML.
    height : int
        Of the frame, pixels.
    """

    text: str
    height: int = 800

    def __repr__(self) -> str:
        return f"Page(<{len(self.text)} characters>)"

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.text)}" style="width:100%;height:{self.height}px;border:0"></iframe>'


def summary(run: Execution) -> str:
    """Write the verdict on a run and its traces, planned against simulated.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    str
        HTML, without a script.
    """
    verdict = verify(run)
    good, judged = verdict.count
    ending, colour = ("passed", "#00795a") if verdict.passed else ("failed", "#b3261e")
    return (
        f'<div class="octoctrl"><style>{_STYLE}</style><p><b>{html.escape(run.plan.task.name)}</b> '
        f'<b style="color:{colour}">{ending}: {good} of {judged} checks are met</b> '
        f"{html.escape(made(run))}</p>{traces_picture(run)[0]}<details><summary>Verdict, check by check</summary>{checks_table(verdict)}"
        "</details></div>"
    )
