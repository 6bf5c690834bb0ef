"""A plan carried out to its end, and what came of it; its events are kept while they happen.

Whatever ends a run, the rest can be planned from these. As they come the events of each head stand
in their order. Once the run has ended all stand in the order of their times, with the waits that
are known then.
"""

from __future__ import annotations

import os
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path
from typing import BinaryIO

from agents.messages.event_stream import header, pack_event, stream_of
from decmcts.errors import InputError
from decmcts.formats.files.atomic import draft_folder
from decmcts.formats.plans.plan_json import write_plan
from decmcts.planning.events import Note, Report, Step, unheard
from decmcts.planning.problem.made_from import source_of
from decmcts.planning.problem.source import Source
from decmcts.planning.running.launcher import Launcher
from decmcts.planning.running.recorded import (
    Carried,
    Keep,
    RecordedWait,
    nearest,
    prints_of,
    unkept,
    waits_of,
)
from decmcts.planning.running.team import RUN_OPTIONS, Failure, RunOptions, Show, unseen
from decmcts.planning.writing.places import put
from decmcts.print.brief import brief
from decmcts.print.machine import Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventLog
from sim.controllers.nearness import Near

SYNC_S = 1.0  # after which what was kept is on the disk, whatever becomes of the computer


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

    `source` is the print the plan was made from; without it nothing is planned anew when a head
    fails. `asked` is where a person's lines arrive while it runs (docs/run.md), None behind the
    last. `on_start` is told the process ids of each head's agent and controller, by its name.
    `on_launcher` is told the launcher before it begins, for trials that look at its clock. `keep`
    is told all plans that print and that heads began, again and again, and last when all processes
    have ended. Raises InputError when the source is another's, or processes cannot be started.
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


def refuse_earlier(path: Path) -> None:
    """Raise InputError where streams of an earlier run would stand beside those of this one."""
    if earlier := sorted(path.parent.glob(f"{escape(path.stem)}-rest[0-9]*")):
        raise InputError(
            "is of a rest of an earlier run", path=earlier[0],
            advice="remove it, or name another file for --events",
        )  # fmt: skip


@dataclass(slots=True)
class Keeping:
    """The streams of one run, a file for each plan that prints and that heads began."""

    path: Path
    report: Report
    _files: list[BinaryIO] = field(default_factory=list)
    _counts: list[int] = field(default_factory=list)  # events that each has
    _synced_at: float = 0.0
    _failed: bool = False

    @property
    def is_begun(self) -> bool:
        """Whether there is a stream."""
        return bool(self._files)

    def keep(self, prints: Sequence[Carried]) -> None:
        """Add what has happened since; a disk that is full does not end a print."""
        if self._failed:
            return
        try:
            for k, carried in enumerate(prints):
                self._add(k, carried)
            self._sync()
        except (OSError, InputError) as error:
            self._failed = True
            why = error.strerror if isinstance(error, OSError) else error.what
            self.report(Note(f"what happens from now on is not kept in {self.path} ({why})"))

    def _add(self, k: int, carried: Carried) -> None:
        if k == len(self._files):
            self._open(k, carried)
        events = carried.events[self._counts[k] :]
        self._files[k].write(b"".join(map(pack_event, events)))
        self._counts[k] += len(events)

    def _open(self, k: int, carried: Carried) -> None:
        if k:
            write_plan(carried.document, self._plan(k))
        self._files.append(self._place(k).open("wb", buffering=0))
        self._counts.append(0)
        log = carried.log()
        self._files[k].write(header(log.problem, log.heads))

    def _sync(self) -> None:
        if self._files and time.monotonic() - self._synced_at > SYNC_S:
            self._synced_at = time.monotonic()
            os.fsync(self._files[-1].fileno())

    def close(self) -> None:
        """End all streams as they are."""
        for file in self._files:
            file.close()

    def write(self, prints: Sequence[Carried], logs: Sequence[EventLog]) -> None:
        """Write all streams anew, in the order of their times.

        Raises InputError when one cannot be written; what was kept of it stays.
        """
        for k, (carried, log) in enumerate(zip(prints, logs, strict=True)):
            put(stream_of(log), self._place(k))
            if k:
                write_plan(carried.document, self._plan(k))

    def _place(self, k: int) -> Path:
        name = f"{self.path.stem}-rest{k}{self.path.suffix}" if k else self.path.name
        return self.path.with_name(name)

    def _plan(self, k: int) -> Path:
        return self._place(k).with_suffix(".plan.json")
