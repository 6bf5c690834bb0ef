"""What the agents of a launch do over time: the live table, its recording, `decmcts replay`.

A recording is a text file of JSON lines: what it is and the bound, then the state of all
agents whenever it was shown.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from rich.box import SIMPLE
from rich.live import Live
from rich.table import Table

from agents.launching.supervisor import AgentStatus
from decmcts.cli.app import app
from decmcts.cli.console import err, out
from decmcts.errors import InputError
from decmcts.planning.events import Heads

FORMAT = "decmcts-record/1"
BEGINS = json.dumps({"format": FORMAT})[:-1]
Keep = Callable[[Heads], None]


def agents_table(agents: tuple[AgentStatus, ...], bound_s: float) -> Table:
    """Return the table of what each head does, with its best makespan over a bound above 0."""
    bound = f"{bound_s:,.0f} s" if bound_s > 0.0 else "not known yet"
    title = f"agents; best: makespan in s; bound {bound}"
    table = Table(title=title, title_justify="left", box=SIMPLE, show_edge=False, padding=0)
    names = ("head", "phase", "s", "rounds", "best", "÷ bound", "entropy", "sent", "KiB",
             "heard", "KiB")  # fmt: skip
    for name in names:
        table.add_column(name, justify="left" if name in ("head", "phase") else "right")
    for a in agents:
        sent, received = sum(a.sent_bytes.values()), sum(a.received_bytes.values())
        table.add_row(
            a.name,
            a.phase,
            f"{a.elapsed_s:.0f}",
            str(a.rounds),
            f"{a.best_makespan_s:,.0f}",
            f"{a.best_makespan_s / bound_s:.3f}" if bound_s > 0.0 else "",
            f"{a.entropy:.2f}",
            str(sum(a.sent.values())),
            f"{sent / 1024:,.0f}",
            str(sum(a.received.values())),
            f"{received / 1024:,.0f}",
        )
    return table


def heads_table(heads: Heads) -> Table:
    """Return the table of an event."""
    return agents_table(heads.agents, heads.bound_s)


@contextmanager
def recording(path: Path | None) -> Iterator[Keep]:
    """Keep every state that is told in a file; nothing without one."""
    if path is None:
        yield lambda heads: None
        return
    with ExitStack() as stack:
        file: TextIO | None = None
        started = time.monotonic()

        def keep(heads: Heads) -> None:
            nonlocal file, started
            if file is None:  # what was there stays until heads begin
                file, started = (
                    stack.enter_context(path.open("w", encoding="utf-8")),
                    time.monotonic(),
                )
                file.write(json.dumps({"format": FORMAT, "bound_s": heads.bound_s}) + "\n")
            if not heads.agents:
                return
            states = [{**asdict(agent), "history": ()} for agent in heads.agents]
            state = {"at_s": round(time.monotonic() - started, 3), "agents": states}
            file.write(json.dumps(state) + "\n")

        yield keep


def read_record(path: Path) -> tuple[float, list[tuple[float, tuple[AgentStatus, ...]]]]:
    """Return the bound and the states of a recording; InputError where it is none, or damaged."""
    text = ""
    states: list[tuple[float, tuple[AgentStatus, ...]]] = []
    try:
        text = path.read_text(encoding="utf-8")
        first, *rest = text.splitlines()
        head = json.loads(first)
        if head["format"] != FORMAT:
            raise InputError(f"format {head['format']!r}, expected {FORMAT}", path=path, line=1)
        bound_s = float(head["bound_s"])
        states.extend(_state(json.loads(line)) for line in rest)  # keeps those above a bad one
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", path=path) from error
    except (
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        if not text.startswith(BEGINS):
            raise InputError(
                "is no recording of a launch",
                path=path,
                advice="`decmcts launch --record FILE` makes one",
            ) from error
        at = len(states) + 2 if "\n" in text else 1
        raise InputError("this recording is damaged (cut off?)", path=path, line=at) from error
    return bound_s, states


def _state(line: dict[str, Any]) -> tuple[float, tuple[AgentStatus, ...]]:
    """Return one state; what cannot be shown raises ValueError, TypeError or KeyError."""
    known = {field.name for field in fields(AgentStatus)}
    agents = tuple(
        AgentStatus(**{k: v for k, v in a.items() if k in known}) for a in line["agents"]
    )
    at_s = float(line["at_s"])
    if not math.isfinite(at_s):
        raise ValueError(f"at_s is {at_s}")
    agents_table(agents, 1.0)
    return at_s, agents


@app.command()
def replay(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="What `launch --record` wrote")],
    speed: Annotated[float, typer.Option(help="So many times as fast", min=0.1)] = 5.0,
) -> None:
    """Show again what the heads of a launch did as they planned."""
    bound_s, states = read_record(source)
    if not states:
        raise InputError("holds no state: the launch ended before its agents began", path=source)
    begun = time.monotonic()
    with Live(console=err, transient=True, refresh_per_second=8) as live:
        for at_s, agents in states:
            time.sleep(max(0.0, at_s / speed - (time.monotonic() - begun)))
            live.update(agents_table(agents, bound_s))
    out.print(agents_table(states[-1][1], bound_s))
