"""Events of a run kept while they happen: whatever ends it, the rest can be planned from them.

As they come the events of each head stand in their order. Once the run has ended all stand in the
order of their times, with the waits that are known then.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path
from typing import BinaryIO

from agents.messages.event_stream import header, pack_event, stream_of
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import write_plan
from decmcts.planning.events import Note, Report
from decmcts.planning.running.recorded import Carried
from decmcts.planning.writing.places import put
from decmcts.print.print_events import EventLog

SYNC_S = 1.0  # after which what was kept is on the disk, whatever becomes of the computer


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

        Raises
        ------
        InputError
            When one cannot be written; what was kept of it stays.
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
