"""A plan carried out to its end, and what came of it."""

from __future__ import annotations

import queue
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.files.atomic import draft_folder
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.problem.made_from import source_of
from decmcts.planning.problem.source import Source
from decmcts.planning.running.launcher import Launcher
from decmcts.planning.running.options import RUN_OPTIONS, Failure, RunOptions, Show, unseen
from decmcts.planning.running.recorded import (
    Carried,
    Keep,
    RecordedWait,
    nearest,
    prints_of,
    unkept,
    waits_of,
)
from decmcts.print.brief import brief
from decmcts.print.machine import Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventLog
from sim.controllers.nearness import Near


@dataclass(frozen=True, slots=True)
class RunResult:
    """What was carried out."""

    names: tuple[str, ...]
    plans: tuple[Carried, ...]  # the plan, and those that took its place; with all events
    makespan_s: float  # when the last action ended
    planned_s: float  # when it should have by the first plan
    contours: int
    unprinted: int  # contours that are not printed whole
    failures: tuple[Failure, ...]
    moved: Mapping[int, tuple[float, Point]]
    near: tuple[Near, ...]  # how near heads came to each other, by their controllers' words
    waits: tuple[RecordedWait, ...]
    left: tuple[str, ...]  # what is not finished, in words
    reason: str  # why the rest was not planned, if it was not
    others: tuple[str, ...] = ()  # what was planned to be printed with another tool, in words

    __repr__ = brief(
        "names", "plans", "makespan_s", "planned_s", "contours", "unprinted", "left", "reason"
    )

    @property
    def contacts(self) -> int:
        """How often heads touched."""
        return sum(len(near.contacts) for near in self.near)

    @property
    def complete(self) -> bool:
        """Whether all is printed, and no heads touched."""
        return self.unprinted == 0 and self.contacts == 0 and not self.left

    @property
    def prints(self) -> list[Carried]:
        """The plans that print and that heads began."""
        return prints_of(self.plans)

    def logs(self) -> list[EventLog]:
        """Return the events of each of `prints`."""
        return [carried.log(self.waits) for carried in self.prints]


def run(
    document: PlanDocument,
    source: Source | None = None,
    options: RunOptions = RUN_OPTIONS,
    *,
    asked: queue.Queue[str | None] | None = None,
    report: Report = unheard,
    show: Show = unseen,
    on_start: Callable[[Mapping[str, tuple[int, int]]], None] = lambda _pids: None,
    on_launcher: Callable[[Launcher], None] = lambda _launcher: None,
    keep: Keep = unkept,
) -> RunResult:
    """Carry a plan out with simulated controllers, two processes a head.

    Parameters
    ----------
    source : Source | None
        The print the plan was made from; without it nothing is planned anew when a head fails.
    asked : queue.Queue[str | None] | None
        Where a person's lines arrive while it runs (docs/run.md); None behind the last.
    on_start : Callable
        Told the process ids of each head's agent and controller, by its name.
    on_launcher : Callable
        Told the launcher before it begins, for trials that look at its clock.
    keep : Callable
        Told all plans that print and that heads began, again and again, and last when all
        processes have ended.

    Raises
    ------
    InputError
        When the source is another's, or processes cannot be started.
    """
    if not document.plan.heads:
        raise InputError("the plan has no head")
    if source is not None:
        source = source_of(document, source)
    if asked is None:
        asked = queue.Queue()
        asked.put(None)
    report(Step("starting agents and controllers"))
    with draft_folder() as folder:
        launcher = Launcher(
            document, source, options, Path(folder), asked, report, show, on_start, keep
        )  # fmt: skip
        on_launcher(launcher)
        launcher.run()
    report(Step("judging where heads were"))
    team, renewal = launcher.team, launcher.renewal
    plans, names = tuple(team.plans), tuple(head.name for head in team.heads)
    end_s = max((e.time_s for p in plans for e in p.events), default=0.0)
    unprinted, reason = team.unprinted + renewal.left_out, renewal.reason
    if unprinted and not team.living():
        reason = "the rest is not planned: no head works any more"
    elif unprinted and (paused := team.paused()):
        reason = reason or f"{', '.join(paused)} stood until somebody says resume, and nobody could"
    return RunResult(
        names, plans, team.makespan_s, document.plan.makespan_s, len(document.contours),
        unprinted, tuple(team.failures), dict(team.moved),
        nearest(document.machine, names, plans, team.moved, end_s),
        tuple(wait for carried in plans for wait in waits_of(carried)), tuple(renewal.left),
        reason, tuple(renewal.others),
    )  # fmt: skip
