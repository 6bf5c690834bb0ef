"""How a plan is carried out, and what is shown of it while it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from decmcts.errors import InputError
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.print.machine import Point
from sim.controllers.motion import QUEUE
from sim.controllers.timing import Timing

MOST_SPEED = 10_000.0


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of a simulated run.

    Parameters
    ----------
    speed : float
        Seconds of the print in one of the world. While heads are planned for anew it is 1.
    timing, error, seed, queue
        Errors of time, as `simulate` has them.
    loss, delay_s : float
        Share of messages between agents that is lost, and by how many seconds of the print the
        others are late at most.
    replan_s : float
        Time limit of the heads' search for what is left.
    left_beads : LeftBeads
        What becomes of a bead that was broken off.
    print_with : tuple[tuple[int, int], ...]
        Tools, and those that print for them once no living head has them.
    """

    speed: float = 1.0
    timing: Timing = Timing.NONE
    error: float = 0.2
    seed: int = 0
    queue: int = QUEUE
    loss: float = 0.0
    delay_s: float = 0.0
    replan_s: float = 5.0
    left_beads: LeftBeads = LeftBeads.FINISH
    print_with: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("speed", self.speed, 0.01, MOST_SPEED), ("loss", self.loss, 0.0, 0.9),
            ("delay", self.delay_s, 0.0, 60.0), ("replan time", self.replan_s, 0.0, 86_400.0),
        ):  # fmt: skip
            if not least <= value <= most:
                raise InputError(f"{name} is {value:g}, must be from {least:g} to {most:g}")


RUN_OPTIONS = RunOptions()


@dataclass(slots=True)
class Failure:
    """A head that failed, and when what followed; seconds of the print."""

    head: str
    why: str
    at_s: float  # its last word
    noticed_s: float
    fenced_s: float = float("nan")  # it is sure that it does nothing any more
    at: Point | None = None  # where it stands then
    planned_s: float = float("nan")  # the rest is planned
    on_s: float = float("nan")  # a head begins an action of it
    stood_s: float = float("nan")  # no head did anything, from when all that needs no plan was done


@dataclass(frozen=True, slots=True)
class HeadView:
    """What is shown of one head while it prints."""

    name: str
    does: str
    share: float  # of its actions in the plan it carries out
    waits_for: str = ""


@dataclass(frozen=True, slots=True)
class RunView:
    """What is shown of a run."""

    time_s: float
    planned_s: float  # of the plan that is carried out, its begin counted in
    heads: tuple[HeadView, ...]


Show = Callable[[RunView], None]


def unseen(view: RunView) -> None:
    """Show nothing."""
