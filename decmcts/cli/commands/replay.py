"""What the agents of a launch do over time: the live table, its recording, `decmcts replay`.

A recording is a text file of JSON lines: what it is and the bound, then the cells of the table
whenever it was shown.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, TextIO

import typer
from rich.box import SIMPLE
from rich.live import Live
from rich.table import Table

from agents.launching.status import AgentStatus
from decmcts.cli.console import err, out
from decmcts.cli.options import app
from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_SECONDS
from decmcts.formats.files.fields import Fields, shown
from decmcts.formats.files.reading import read_bytes
from decmcts.planning.events import Heads
from decmcts.print.figures import clock_time

FORMAT = "decmcts-record/2"
BEGINS = json.dumps({"format": FORMAT})[:-1]
LONGEST_S = 31 * 86400.0  # a launch searches 30 days at the most
PAUSE_S = 10.0  # the longest that is waited for the next state: a launch shows one each second
MOST_LETTERS = 200
COLUMNS = ("head", "phase", "s", "rounds", "best", "÷ bound", "entropy", "sent", "KiB", "heard",
           "KiB")  # fmt: skip
Cells = list[str]  # one for each of these
Keep = Callable[[Heads], None]
State = tuple[float, list[Cells]]  # seconds since the first, and all agents


def cells_of(agent: AgentStatus, bound_s: float) -> Cells:
    """Return what is shown of an agent, over a bound above 0."""
    a, best_s = agent, agent.best_makespan_s
    has_best = math.isfinite(best_s)  # else it knows no joint plan yet
    return [
        a.name, a.phase, f"{a.elapsed_s:.0f}", str(a.rounds),
        clock_time(best_s) if has_best else "",
        f"{best_s / bound_s:.3f}" if bound_s > 0.0 and has_best else "",
        f"{a.entropy:.2f}",
        str(sum(a.sent.values())), f"{sum(a.sent_bytes.values()) / 1024:,.0f}",
        str(sum(a.received.values())), f"{sum(a.received_bytes.values()) / 1024:,.0f}",
    ]  # fmt: skip


def table_of(rows: Sequence[Cells], bound_s: float) -> Table:
    """Return the table of what each head does."""
    bound = clock_time(bound_s) if bound_s > 0.0 else "not known yet"
    title = f"heads; best: print time of the joint plan; bound {bound}"
    table = Table(title=title, title_justify="left", box=SIMPLE, show_edge=False, padding=0)
    for name in COLUMNS:
        table.add_column(name, justify="left" if name in ("head", "phase") else "right")
    for row in rows:
        table.add_row(*row)
    return table


def heads_table(heads: Heads) -> Table:
    """Return the table of an event."""
    return table_of([cells_of(agent, heads.bound_s) for agent in heads.agents], heads.bound_s)


@contextmanager
def recording(path: Path | None) -> Iterator[Keep]:
    """Keep every state that is told in a file; nothing without one.

    A file that cannot be written on costs the recording, not the launch: it is told of once.
    """
    if path is None:
        yield lambda heads: None
        return
    file: TextIO | None = None
    started, lost = time.monotonic(), False

    def keep(heads: Heads) -> None:
        nonlocal file, started, lost
        if lost:
            return
        try:
            if file is None:  # what was there stays until heads begin
                file, started = path.open("w", encoding="utf-8", buffering=1), time.monotonic()
                file.write(json.dumps({"format": FORMAT, "bound_s": heads.bound_s}) + "\n")
            if heads.agents:
                rows = [cells_of(agent, heads.bound_s) for agent in heads.agents]
                state = {"at_s": round(time.monotonic() - started, 3), "heads": rows}
                file.write(json.dumps(state) + "\n")
        except OSError as error:
            lost = True
            err.show(
                f"{path}: the recording cannot be written ({error.strerror}); the launch goes on "
                "without it"
            )

    try:
        yield keep
    finally:
        if file is not None:
            with suppress(OSError):  # told above, when the line was written
                file.close()


def read_record(path: Path) -> tuple[float, list[State]]:
    """Return the bound and the states of a recording; InputError where it is none, or damaged."""
    text = read_bytes(path)
    first, *rest = text.split(b"\n")
    if not first.startswith(BEGINS.encode()):
        raise InputError(
            "is no recording of a launch",
            path=path,
            advice="`decmcts launch --record FILE` makes one",
        )
    with _refused_at(path, 1):
        head = Fields.of(json.loads(first), "", path)
        if head.text("format") != FORMAT:
            raise InputError(f"format {shown(head.need('format'))}, expected {FORMAT}", path=path)
        bound_s = head.number("bound_s", least=0.0, most=LARGEST_SECONDS)
    states = list[State]()
    for number, line in enumerate(rest, 2):
        if not line and number == len(rest) + 1:
            break  # behind the last line end
        with _refused_at(path, number):
            states.append(_state(Fields.of(json.loads(line), "", path), states))
    return bound_s, states


@contextmanager
def _refused_at(path: Path, line: int) -> Iterator[None]:
    """Turn whatever is wrong with a line of a recording into one line that names it."""
    try:
        yield
    except (InputError, ValueError, RecursionError) as error:
        what = f": {error.what}" if isinstance(error, InputError) else " (cut off?)"
        raise InputError(f"this recording is damaged{what}", path=path, line=line) from error


def _state(given: Fields, before: list[State]) -> State:
    """Return one state: times do not fall, and none is beyond the longest search."""
    least = before[-1][0] if before else 0.0
    at_s, rows = given.number("at_s", least=least, most=LONGEST_S), given.items("heads")
    for row in rows:
        if not isinstance(row, list) or list(map(type, row)) != [str] * len(COLUMNS):
            given.fail("heads", f"expected rows of {len(COLUMNS)} texts, found {shown(row)}")
        if any(len(text) > MOST_LETTERS for text in row):
            given.fail("heads", f"more than {MOST_LETTERS} letters are in one text")
    return at_s, rows


@app.command()
def replay(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="What `launch --record` wrote")],
    speed: Annotated[float, typer.Option(help="So many times as fast", min=0.1)] = 5.0,
) -> None:
    """Show again what the heads of a launch did as they planned."""
    bound_s, states = read_record(source)
    if not states:
        raise InputError("holds no state: the launch ended before its agents began", path=source)
    due_s, before_s, begun = 0.0, 0.0, time.monotonic()
    with Live(console=err, transient=True, refresh_per_second=8) as live:
        for at_s, rows in states:
            due_s, before_s = due_s + min((at_s - before_s) / speed, PAUSE_S), at_s
            time.sleep(max(0.0, due_s - (time.monotonic() - begun)))
            live.update(table_of(rows, bound_s))
    out.print(table_of(states[-1][1], bound_s))
