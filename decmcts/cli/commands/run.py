"""`decmcts run`: a plan carried out by an agent and a controller a head."""

from __future__ import annotations

import math
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from queue import Queue
from typing import Annotated, Any

import typer
from rich.live import Live
from rich.table import Table

from decmcts.cli import options as opt
from decmcts.cli.commands.replan import LeftOption, PrintWithOption
from decmcts.cli.commands.simulate import ErrorOption, QueueOption, TimingOption
from decmcts.cli.console import err, out, print_json, steps
from decmcts.errors import InputError
from decmcts.formats.mesh import is_mesh
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.events import Event, Note, Report, Step
from decmcts.planning.options import Limits
from decmcts.planning.problem.source import Source, read
from decmcts.planning.replanning.fenced import other_tools, refuse_other_diameters
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.planning.running.recorded import unkept
from decmcts.planning.running.run import Keeping, RunResult, refuse_earlier
from decmcts.planning.running.run import run as carry_out
from decmcts.planning.running.team import Failure, RunOptions, RunView, Show, unseen
from decmcts.planning.writing.places import refuse_other_suffixes, refuse_stdout, refuse_unwritable
from decmcts.print.figures import clock_time
from decmcts.print.plan import PlanDocument
from sim.controllers.motion import QUEUE
from sim.controllers.timing import Timing


@opt.app.command()
def run(
    plan: Annotated[Path, typer.Argument(help="PLAN.json of `launch`")],
    source: Annotated[
        Path | None,
        opt.basics(
            "--source FILE",
            "The G-code it was made from; without it nothing is planned anew when a head fails",
        ),
    ] = None,
    simulated: Annotated[bool, opt.basics("--simulated", "With simulated controllers")] = False,
    speed: Annotated[
        float, opt.basics("--speed TIMES", "How many times as fast as the world")
    ] = 1.0,
    timing: TimingOption = Timing.NONE,
    error: ErrorOption = 0.2,
    seed: Annotated[
        int, opt.search("--seed N", "Equal seeds give equal errors, losses and searches", min=0)
    ] = 0,
    queue: QueueOption = QUEUE,
    loss: Annotated[float, opt.search("--loss SHARE", "Of the agents' messages, lost: 0.2")] = 0.0,
    delay: Annotated[
        float, opt.search("--delay S", "Seconds of the print by which messages are late, at most")
    ] = 0.0,
    replan_time: Annotated[
        float, opt.search("--replan-time S", "Time of a search for what is left")
    ] = 5.0,
    print_with: PrintWithOption = None,
    left_beads: LeftOption = LeftBeads.FINISH,
    events: Annotated[
        Path | None,
        opt.output(
            "--events FILE",
            "Keep what happens (docs/events.md); of plans made anew beside it, with the plans",
        ),
    ] = None,
    report: opt.ReportOption = None,
    watch: Annotated[bool, opt.output("--watch", "Show heads while they print")] = False,
    as_json: opt.JsonOption = False,
) -> None:
    """Carry a plan out, an agent and a controller a head; exit code 1 if not all is printed.

    While it runs, lines on standard input are obeyed: pause, resume, abort (with a head, or for
    all), and fenced HEAD park or fenced HEAD X,Y,Z for a head that is off.
    """
    if not simulated:
        raise InputError(
            "there are no other controllers than simulated ones yet", advice="add --simulated"
        )
    if timing is Timing.ADVERSARIAL:
        raise InputError(
            "adversarial delays are those of a whole print, looked up before it begins",
            advice="use `decmcts simulate --timing adversarial`",
        )
    refuse_unwritable([events, report], plan, *([] if source is None else [source]))
    refuse_stdout(events, "--events")
    refuse_other_suffixes(None, report, None)
    if events is not None:
        refuse_earlier(events)
    document = read_plan(plan)
    other = other_tools(print_with or [], document.machine, document.contours)
    if other and source is None:
        raise InputError(
            "without the source nothing is printed with another tool", advice="add --source FILE"
        )
    options = RunOptions(
        speed, timing, error, seed, queue, loss, delay, replan_time, left_beads,
        tuple(other.items()),
    )  # fmt: skip
    if source is not None and is_mesh(source):
        raise InputError("a mesh has no start code", path=source, advice="name the planned G-code")
    with steps() as progress:
        found = None if source is None else read(
            source, document.machine, limits=Limits.MACHINE, report=progress
        )  # fmt: skip
        if found is not None:
            refuse_other_diameters(found, other)  # refused now, not when a head has failed
        with _shown(watch=watch) as window:

            def passed_on(event: Event) -> None:
                if isinstance(event, Note) or not watch:
                    progress(event)

            kept = None if events is None else Keeping(events, passed_on)
            result = _carried_out(document, found, options, kept, passed_on, window)
    if as_json:
        print_json("decmcts-run/1", figures(result))
    else:
        show(result)
    with steps() as progress:
        if kept is not None:
            progress(Step("writing events"))
            kept.write(result.prints, result.logs())
        if report is not None:
            progress(Step("writing the report"))
            _write_report(result, document, plan, report)
    if not result.complete:
        raise typer.Exit(1)


def _carried_out(
    document: PlanDocument, found: Source | None, options: RunOptions, kept: Keeping | None,
    report: Report, window: Show,
) -> RunResult:  # fmt: skip
    """Carry a plan out; whatever ends that, events are kept up to then, and it is said."""
    keep = unkept if kept is None else kept.keep
    try:
        return carry_out(
            document, found, options, asked=_lines(), report=report, show=window, keep=keep
        )
    except KeyboardInterrupt:
        if kept is not None and kept.is_begun:
            report(Note(f"what happened until then is in {kept.path}"))
        raise
    finally:
        if kept is not None:
            kept.close()


@contextmanager
def _shown(*, watch: bool) -> Iterator[Show]:
    """Yield what shows how heads stand: a table that changes, or a line a minute of the print."""
    if not watch:
        yield unseen
    elif err.is_terminal:
        with Live(console=err, transient=True, auto_refresh=False) as live:
            yield lambda view: live.update(table_of(view), refresh=True)
    else:
        next_s = -math.inf

        def show_line(view: RunView) -> None:
            nonlocal next_s
            if view.time_s >= next_s:
                next_s = view.time_s + 60.0
                heads = (
                    f"{h.name} {h.does} {h.share:.0%}{h.waits_for and f' for {h.waits_for}'}"
                    for h in view.heads
                )
                err.show(f"{clock_time(view.time_s)}: {'; '.join(heads)}")

        yield show_line


def table_of(view: RunView) -> Table:
    """Return how heads stand."""
    title = f"{clock_time(view.time_s)} of {clock_time(view.planned_s)}"
    table = Table(title=title, show_edge=False, pad_edge=False)
    for name in ("head", "does", "done", "waits for"):
        table.add_column(name)
    for head in view.heads:
        table.add_row(head.name, head.does, f"{head.share:.1%}", head.waits_for)
    return table


def _lines() -> Queue[str | None]:
    """Return where lines of standard input arrive; a thread reads them.

    Not by `sys.stdin`: a thread within a buffered read aborts the interpreter's end.
    """
    found: Queue[str | None] = Queue()

    def work() -> None:
        rest = b""
        try:
            while chunk := os.read(sys.stdin.fileno(), 4096):
                *lines, rest = (rest + chunk).split(b"\n")
                for line in lines:
                    found.put(line.decode(errors="replace"))
        except (OSError, ValueError, AttributeError):
            pass  # there is none
        found.put(rest.decode(errors="replace"))
        found.put(None)

    threading.Thread(target=work, name="control", daemon=True).start()
    return found


def _write_report(result: RunResult, document: PlanDocument, plan: Path, out: Path) -> None:
    """Write the page of a run, with what was planned anew in it."""
    from sim.pictures.report import Anew, write_run_report  # it loads for those who ask

    first, *later = map(Anew, (carried.document for carried in result.prints), result.logs())
    write_run_report(
        out, document, first.log, file=plan.name, contacts=result.contacts, anew=later,
        in_the_end=result.contours - result.unprinted if later else None,
        missing=(*result.others, *result.left),
    )  # fmt: skip


def figures(result: RunResult) -> dict[str, Any]:
    """Return what `--json` prints."""
    names = result.names
    return {
        "complete": result.complete,
        "makespan_s": result.makespan_s,
        "planned_s": result.planned_s,
        "contours": result.contours,
        "unprinted": result.unprinted,
        "plans": len(result.prints),
        "failures": [asdict(failure) for failure in result.failures],
        "waits": [
            {"head": names[w.head], "by": names[w.by], "begin_s": w.event.time_s,
             "seconds": w.seconds, "action": w.event.action, "plan": w.number}
            for w in result.waits
        ],
        "nearest": [
            {"heads": [names[h] for h in near.heads], "gap_mm": near.gap_mm,
             "rail_mm": near.rail_mm, "time_s": near.time_s}
            for near in result.near
        ],
        "contacts": result.contacts,
        "not_finished": list(result.left),
        "other_tools": list(result.others),
        "reason": result.reason,
    }  # fmt: skip


def show(result: RunResult) -> None:
    """Print what came of it."""
    off = result.makespan_s / result.planned_s - 1.0 if result.planned_s else 0.0
    out.show(
        f"print time {clock_time(result.makespan_s)}, {abs(off):.1%} "
        f"{'more' if off >= 0.0 else 'less'} than planned"
    )
    done = result.contours - result.unprinted
    out.print(f"{done:,} of {result.contours:,} contours printed")
    for failure in result.failures:
        out.show(_failed(failure))
    for line in (*result.others, *result.left, *([result.reason] if result.reason else [])):
        out.show(line)
    for head, name in enumerate(result.names):
        mine = [wait for wait in result.waits if wait.head == head]
        if mine:
            longest = max(mine, key=lambda wait: wait.seconds)
            out.show(
                f"{name} waited {sum(w.seconds for w in mine):.0f} s, longest for "
                f"{result.names[longest.by]}: {longest.seconds:.1f} s"
            )
    for near in result.near:
        if math.isfinite(near.gap_mm):
            which = " and ".join(result.names[h] for h in near.heads)
            out.show(f"{which}: {near.gap_mm:.2f} mm apart at least")
    if len(result.names) > 1:
        out.print(f"{result.contacts} contact{'s' * (result.contacts != 1)} of heads")


def _failed(failure: Failure) -> str:
    text = f"head {failure.head} failed at {clock_time(failure.at_s)}: {failure.why}"
    if math.isnan(failure.fenced_s):
        return f"{text}; it is not fenced"
    text += f"; fenced {failure.fenced_s - failure.at_s:.1f} s later"
    if math.isnan(failure.on_s):
        return text
    return (
        f"{text}, the rest began {failure.on_s - failure.at_s:.1f} s after it failed; "
        f"no head did anything for {failure.stood_s:.1f} s of these"
    )
