"""Prints carried out by real processes while heads fail at random moments, and over lossy networks.

    python benchmarks/runs.py [--prints plate,part:2,…] [--failures 200] [--two 60] [--lossy 50]
        [--time-limit 3] [--speed 100]

Prints: `towers:N` are four small towers for each of N heads on one rail, `slab` is one block that
two heads share, `part:N` a plate with holes for N heads, `plate` ships with the project; other
names are plates of the corpus. Every failure has a kind, a head and a moment drawn from its
number. In runs of two failures the second comes once the first is there, while the rest is
planned, while heads park, or while they print the new plan; it is another head's in three of
four, and one in seven is a person who pauses a head for 60 s.

60 s of the print after a controller was lost, or after the rest could not be planned, a person
says that a head is off and where it stopped. The person has put it to its park where no other
head stood in the way. Clairvoyant: when the print had ended had the rest been planned at once at
the moment of the failure, with no time for noticing and planning. A run that does not end within
10 min is ended. Writes docs/results/runs.csv (resumable) and runs.md.
"""

from __future__ import annotations

import argparse
import math
import os
import queue
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import Rows, arguments, grouped, markdown, median, names, run_missing, setting
from shared_by_many import source_for
from team_prints import plate_path

from decmcts.errors import InputError, VerificationError
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.planning.events import Event, Note
from decmcts.planning.launch import launch
from decmcts.planning.options import Limits, TeamSearch
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.problem.source import Source, read
from decmcts.planning.replanning.replan import replan, rest_of
from decmcts.planning.running.launcher import Launcher
from decmcts.planning.running.recorded import Carried
from decmcts.planning.running.run import RunResult
from decmcts.planning.running.run import run as carry_out
from decmcts.planning.running.team import RunOptions
from decmcts.print.machine import Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventKind
from decmcts.print.print_state import state_of_heads
from tests.makers.plate import plate
from tests.makers.printed import printed_mm, printed_twice

KEY = ("print", "kind", "number", "limit_s", "speed")
FIGURES = (
    "heads", "head", "share", "planned_s", "makespan_s", "complete", "unprinted", "contacts",
    "twice", "lost_mm", "clairvoyant", "waiting", "noticed_s", "fenced_s", "on_s", "stood_s",
    "reason", "second", "where", "wall_s", "error",
)  # fmt: skip
KINDS = ("clog", "agent killed", "controller killed", "controller hangs", "agent hangs", "bus lost")
SIGNALS = {  # of which process
    "clog": ("controller", signal.SIGUSR1), "agent killed": ("agent", signal.SIGKILL),
    "controller killed": ("controller", signal.SIGKILL),
    "controller hangs": ("controller", signal.SIGSTOP), "agent hangs": ("agent", signal.SIGSTOP),
    "bus lost": ("agent", signal.SIGUSR2),
}  # fmt: skip
LOSSY, TWO = "lossy", "two failures"
PAUSED = "paused"  # by a person, in the place of a second failure
PHASES = {  # when the second failure comes: seconds of the print behind what at the most
    "noticing": 100.0, "planning": 6.0, "parking": 40.0, "going on": 60.0,
}  # fmt: skip
PAUSED_S = 60.0
PERSON_S = 60.0  # after which somebody is there
BESIDE_MM = 80.0  # from another head, where a head is not moved past
MOST_ASKED = 3  # times that person says where a head stands, for each failure
MOST_WALL_S = 600.0  # that a run may take
REPAIR_S = 1800.0  # after which a person who repairs has done so
LOSS, DELAY_S = 0.2, 0.5
ROWS_MM = (100.0, 145.0)
SLAB_MM = (200.0, 60.0, 0.8)
PRINTS = "towers:2,slab,towers:3,part:3,towers:4,plate"


@cache
def planned(name: str, limit_s: float) -> tuple[PlanDocument, Source]:
    """Return a plan and its source."""
    word, _, count = name.partition(":")
    folder = Path(tempfile.mkdtemp(prefix="decmcts-runs-"))
    if word == "part":
        source = source_for(int(count))
    elif word == "slab":
        source = plate(SLAB_MM, (150.0, 150.0), "dual-gantry")
    elif word == "towers":
        pair, heads = load_machine("dual-gantry"), int(count)
        machine = pair if heads == 2 else rail_machine(pair, heads)
        low, high = machine.bed_min[0] + 60.0, machine.bed_max[0] - 60.0
        centres = [(x, y) for x in np.linspace(low, high, 2 * heads) for y in ROWS_MM]
        path = folder / "towers.gcode"
        path.write_text(_without_skirt(made_gcode(centres)))
        source = read(path, machine, limits=Limits.MACHINE)
    else:
        source = read(plate_path(name), "dual-gantry", limits=Limits.MACHINE)
    result = launch(source, TeamSearch(limit_s), writes=False)
    return result.document, replace(source, machine=result.document.machine)


def _without_skirt(text: str) -> str:
    """Return G-code without its skirt, which no head of several reaches all of."""
    begin = text.index(";TYPE:Skirt/Brim")
    return text[:begin] + text[text.index(";LAYER_CHANGE", begin) :]


@dataclass(frozen=True)
class Second:
    """What goes wrong behind a first failure."""

    kind: str
    head: str
    phase: str
    behind_s: float


class Fault:
    """What goes wrong in a run, and the person who comes then."""

    def __init__(self, kind: str, head: str, at_s: float, second: Second | None = None) -> None:
        self.kind, self.head, self.at_s, self.second = kind, head, at_s, second
        self.asked: queue.Queue[str | None] = queue.Queue()
        self.calls: queue.Queue[str] = queue.Queue()  # heads a person is to look at; "": all
        self.dead_s: dict[str, float] = {}  # when a controller died
        self.over, self.struck, self.is_late = threading.Event(), False, False
        self.launcher: Launcher | None = None

    def report(self, event: Event) -> None:
        """Take a note of the run."""
        if isinstance(event, Note) and "is not planned" in event.text:
            self.calls.put("")
        if isinstance(event, Note) and "say `fenced" in event.text:
            self.calls.put(event.text.partition(":")[0])

    def start(self, _pids: Mapping[str, tuple[int, int]]) -> None:
        """Begin to wait for the moment."""
        for work in self._work, self._strike_again, self._watch:
            threading.Thread(target=work, daemon=True).start()

    @property
    def now_s(self) -> float:
        """Time of the print."""
        assert self.launcher is not None
        return self.launcher.team.clock.now()

    def until(self, time_s: float) -> bool:
        """Wait for a time of the print; False if the run ended before."""
        return self.until_it(lambda: self.now_s >= time_s)

    def until_it(self, holds: Callable[[], bool]) -> bool:
        """Wait until something is so; False if the run ended before."""
        while not holds():
            if self.over.wait(0.005):
                return False
        return True

    def _work(self) -> None:
        if self.kind == LOSSY or not self.until(self.at_s):
            self.asked.put(None)
            return
        self.strike(self.kind, self.head)
        for _ in range(MOST_ASKED * (1 + (self.second is not None))):  # what is left then is left
            if not self.until_it(lambda: not self.calls.empty()):
                break
            whom = self.calls.get()
            self.until(self.now_s + PERSON_S)
            self.asked.put(self.words(whom))
        self.asked.put(None)

    def strike(self, kind: str, head: str) -> None:
        """Have a head fail."""
        assert self.launcher is not None
        team = self.launcher.team
        process, number = SIGNALS[kind]
        processes = team.processes[[each.name for each in team.heads].index(head)]
        with suppress(ProcessLookupError):
            os.kill(processes.agent.pid if process == "agent" else processes.controller_pid, number)
        if process == "controller" and kind != "clog":  # not before: it may have gone on since
            self.dead_s.setdefault(head, self.now_s)

    def _strike_again(self) -> None:
        """Have the second failure come when it is its time."""
        second = self.second
        if second is None or not self.until(self.at_s):
            return
        assert self.launcher is not None
        team, renewal = self.launcher.team, self.launcher.renewal
        ready = {
            "noticing": lambda: True,
            "planning": lambda: bool(team.failures) and renewal.is_busy,
            "parking": lambda: any(not each.is_print for each in list(team.plans)),
            "going on": lambda: any(each.is_print and each.events for each in list(team.plans)[1:]),
        }  # fmt: skip
        if not self.until_it(ready[second.phase]) or not self.until(self.now_s + second.behind_s):
            return
        self.struck = True
        if second.kind != PAUSED:
            self.strike(second.kind, second.head)
            return
        self.asked.put(f"pause {second.head}")
        self.until(self.now_s + PAUSED_S)
        self.asked.put(f"resume {second.head}")

    def _watch(self) -> None:
        """End a run that does not end."""
        if self.over.wait(MOST_WALL_S):
            return
        assert self.launcher is not None
        self.is_late = True
        for processes in self.launcher.team.processes:
            with suppress(ProcessLookupError):
                os.kill(processes.controller_pid, signal.SIGKILL)

    def words(self, whom: str) -> str:
        """Return what the person says: where a head stopped, and whether it was put to its park.

        It stopped where it was when its controller died, or where that said, or where it is.
        """
        launcher = self.launcher
        assert launcher is not None
        machine, team = launcher.document.machine, launcher.team
        names = [head.name for head in team.heads]
        failed = [names.index(failure.head) for failure in team.failures]
        away = [h for h in failed if not team.is_parked(h)] or failed
        h = names.index(whom) if whom else away[0]
        whom, failure = names[h], team.heads[h].failure
        places = {name: place_at(launcher, k, math.inf) for k, name in enumerate(names)}
        stopped = place_at(launcher, h, self.dead_s.get(whom, self.now_s))
        if team.heads[h].fenced and failure is not None and failure.at is not None:
            stopped = failure.at
        park = machine.head(whom).park
        low, high = sorted((stopped[0], park[0]))
        is_free = all(
            not low - BESIDE_MM < x < high + BESIDE_MM
            for name, (x, _, _) in places.items() if name != whom
        )  # fmt: skip
        where = ",".join(f"{v:.3f}" for v in stopped)
        return f"fenced {whom} {'park ' * is_free}{where}"


def place_at(launcher: Launcher, h: int, time_s: float) -> Point:
    """Return where a head is at a time by its plan and its controller's last word before it."""
    heard = [(p, e) for p in launcher.team.plans if h in p.heads
             for e in p.events if e.head == p.heads.index(h) and e.time_s <= time_s]  # fmt: skip
    if not heard:
        return launcher.document.machine.head(launcher.team.heads[h].name).park
    carried, last = heard[-1]
    began = [e for p, e in heard if p is carried and e.kind is EventKind.BEGAN]
    if last.kind not in (EventKind.BEGAN, EventKind.PASSED) or time_s == math.inf or not began:
        return last.at
    work, path = carried.work(last.head), carried.document.plan.heads[last.head]
    points, ends = path.action_path(last.action), work.ends(last.action)
    times = np.concatenate([[0.0], ends])[: len(points)]
    axes = [float(np.interp(time_s - began[-1].time_s, times, points[: len(times), axis]))
            for axis in range(3)]  # fmt: skip
    return axes[0], axes[1], axes[2]


def fault_of(key: dict[str, Any], document: PlanDocument) -> Fault:
    """Return what goes wrong in a run, by its number."""
    kind, n = key["kind"], int(key["number"])
    rng = np.random.default_rng([n, (*KINDS, LOSSY, TWO).index(kind)])
    heads = [head.head for head in document.plan.heads]
    head, share = heads[int(rng.integers(len(heads)))], float(rng.uniform(0.02, 0.95))
    at_s = share * document.plan.makespan_s
    if kind != TWO:
        return Fault(kind, head, at_s)
    kind = str(rng.choice(KINDS))
    again, phase = str(rng.choice([*KINDS, PAUSED])), str(rng.choice(list(PHASES)))
    others = [each for each in heads if each != head]
    whom = head if rng.uniform() < 0.25 else str(rng.choice(others))
    behind_s = float(rng.uniform(0.0, PHASES[phase]))
    return Fault(kind, head, at_s, Second(again, whom, phase, behind_s))


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Carry a plan out, with its fault."""
    document, source = planned(key["print"], key["limit_s"])
    fault = fault_of(key, document)
    lossy = key["kind"] == LOSSY
    options = RunOptions(
        key["speed"], seed=key["number"], loss=LOSS if lossy else 0.0,
        delay_s=DELAY_S if lossy else 0.0, replan_s=key["limit_s"],
    )  # fmt: skip
    began = time.perf_counter()
    try:
        result = carry_out(
            document, source, options, asked=fault.asked, report=fault.report,
            on_start=fault.start, on_launcher=lambda launcher: setattr(fault, "launcher", launcher),
        )  # fmt: skip
    except (InputError, VerificationError) as error:
        return {**key, **dict.fromkeys(FIGURES, ""), "error": str(error)}
    finally:
        fault.over.set()
    wall = time.perf_counter() - began
    return {
        **key, **_figures(document, source, result, key, fault), "wall_s": round(wall, 1),
        "error": f"did not end within {MOST_WALL_S:g} s" if fault.is_late else "",
    }  # fmt: skip


def _figures(
    document: PlanDocument, source: Source, result: RunResult, key: dict[str, Any], fault: Fault
) -> dict[str, Any]:
    due, second = _length(document), fault.second
    found: dict[str, Any] = {
        **dict.fromkeys(FIGURES, ""),
        "heads": len(document.plan.heads), "head": fault.head,
        "share": round(fault.at_s / document.plan.makespan_s, 3),
        "planned_s": round(result.planned_s, 1), "makespan_s": round(result.makespan_s, 1),
        "complete": int(result.unprinted == 0 and not result.left), "unprinted": result.unprinted,
        "contacts": result.contacts, "twice": printed_twice(result.plans),
        "lost_mm": round(due - printed_mm(result.plans), 1), "reason": result.reason,
    }  # fmt: skip
    touched = [contact for near in result.near for contact in near.contacts]
    if touched:
        found["where"] = " ".join(str(touched[0]).split())
    if second is not None:
        words = [fault.kind, "then", second.kind, "of", second.head, second.phase]
        found["second"] = " ".join([*words, *["(did not come)"] * (not fault.struck)])
    if key["kind"] == LOSSY:
        return {**found, "clairvoyant": round(result.makespan_s / result.planned_s, 4)}
    if not result.failures:
        return found
    failure = result.failures[0]
    for name in ("noticed_s", "fenced_s", "on_s"):
        found[name] = round(getattr(failure, name) - failure.at_s, 2)
    found["stood_s"] = round(failure.stood_s, 2)
    ended = None if second is not None else clairvoyant_s(document, source, result, key)
    if ended is not None and not result.unprinted:
        found["clairvoyant"] = round(result.makespan_s / ended, 4)
    if not result.unprinted and second is None:
        found["waiting"] = round(result.makespan_s / (result.planned_s + REPAIR_S), 4)
    return found


def _length(document: PlanDocument) -> float:
    contours, length = document.contours, 0.0
    for c in range(len(contours)):
        rows = slice(int(contours.offsets[c]), int(contours.offsets[c + 1]))
        steps = np.linalg.norm(np.diff(contours.points[rows], axis=0), axis=1)
        length += float(steps[contours.extrusion[rows][1:] > 0.0].sum())
    return length


def clairvoyant_s(
    document: PlanDocument, source: Source, result: RunResult, key: dict[str, Any]
) -> float | None:
    """Return when the print had ended, had the rest been planned at once; None: it cannot be."""
    failure, first = result.failures[0], result.plans[0]
    then = Carried(0, document, first.heads, True)
    for event in first.events:
        if event.time_s <= failure.at_s:
            then.take(first.heads[event.head], event)
    gone = result.names.index(failure.head)
    states = []
    for h in then.heads:
        state = then.state(h)
        if h != gone:  # what it is at it ends
            state = replace(state, ended=state.ended + state.begun, begun=False, point=0)
        states.append(state)
    parks = {head.name: head.park for head in document.machine.heads}
    place = parks[failure.head] if failure.at is None else failure.at
    try:
        rest = rest_of(document, source, state_of_heads(document, states), {failure.head: place})
        again = replan(rest, TeamSearch(key["limit_s"], key["number"]), rules_of(document),
                       writes=False)  # fmt: skip
    except (InputError, VerificationError):
        return None
    return float(failure.at_s + again.document.plan.makespan_s)


def table(rows: list[dict[str, str]]) -> str:
    """Return a line for each print, and one for each kind."""
    head = ["", "runs", "complete", "contacts", "printed twice", "lost mm of complete ones",
            "÷ clairvoyant", "÷ waiting 30 min", "until heads go on s",
            "no head did anything s"]  # fmt: skip
    lines = []
    for field in ("print", "kind"):
        for (name,), mine in grouped(rows, field).items():
            lines.append([name, *_line(mine)])
    return markdown([*lines, ["all", *_line([row for row in rows if not row["error"]])]], head)


def _line(mine: list[dict[str, str]]) -> list[str]:
    whole = [row for row in mine if row["complete"] == "1"]

    def middle(field: str, digits: int) -> str:
        there = [row for row in mine if row[field] not in ("", "nan")]
        return f"{median(there, field):.{digits}f}" if there else ""

    lost = max((abs(float(row["lost_mm"])) for row in whole), default=0.0)
    return [
        str(len(mine)), str(len(whole)), str(sum(int(row["contacts"]) for row in mine)),
        str(sum(int(row["twice"]) for row in mine)), f"{lost:.1f}", middle("clairvoyant", 3),
        middle("waiting", 2), middle("on_s", 1), middle("stood_s", 1),
    ]  # fmt: skip


PAGE = """# Prints carried out while heads fail

{said}

Repeat: `python benchmarks/runs.py`. Real processes: an agent and a simulated controller a head,
zenoh between agents. While the rest is planned the print's clock runs as the world's. Medians;
÷ clairvoyant and ÷ waiting are of complete prints. Until heads go on: from the failure's last word
to the first action of the new plan; meanwhile living heads carry out what every plan contains.
Prints that are not complete end with a line for what is missing: a bead of which nobody knows how
far it came, or what no living head can print. Where a person said at which point of a bead a head
had stopped, some mm are missing or twice: this benchmark's person reads it off the plan's times.

{failures}
## Two failures in one run

The second comes once the first is there, while the rest is planned, while heads park, or while they
print the new plan; of {same} runs it is the same head's.

{two}
## Over lossy networks

{loss:.0%} of all messages lost, the others up to {delay} s of the print late, a tenth doubled.
÷ clairvoyant is here the makespan ÷ the plan's.

{lossy}
{failed}"""


def report(rows: Rows, said: str) -> str:
    """Return the page."""
    lossy = [row for row in rows.rows if row["kind"] == LOSSY]
    two = [row for row in rows.rows if row["kind"] == TWO]
    failures = [row for row in rows.rows if row["kind"] not in (LOSSY, TWO)]
    return PAGE.format(
        said=said, failures=table(failures) if failures else "", loss=LOSS, delay=DELAY_S,
        two=table(two) if two else "",
        same=sum(f" of {row['head']} " in (row["second"] or "") for row in two),
        lossy=table(lossy) if lossy else "", failed=rows.failures(),
    )  # fmt: skip


def main() -> None:
    parser = arguments(__doc__, time_limit=3.0, models="")
    parser.add_argument("--prints", type=names, default=names(PRINTS))
    parser.add_argument("--failures", type=int, default=200)
    parser.add_argument("--two", type=int, default=60, help="runs of two failures")
    parser.add_argument("--lossy", type=int, default=50)
    parser.add_argument("--speed", type=float, default=100.0)
    options: argparse.Namespace = parser.parse_args()
    rows = Rows(options.results / "runs.csv", KEY)
    prints, kinds = options.prints, len(KINDS)
    todo = [(prints[n % len(prints)], KINDS[n // len(prints) % kinds], n)
            for n in range(options.failures)]  # fmt: skip
    todo += [(prints[n % len(prints)], TWO, n) for n in range(options.two)]
    todo += [(prints[n % len(prints)], LOSSY, n) for n in range(options.lossy)]
    limits = options.time_limit, options.speed
    if not options.table_only:
        run_missing(rows, [dict(zip(KEY, (*each, *limits), strict=True)) for each in todo], run)
    said = setting(note=options.note, time_limit=f"{options.time_limit:g} s",
                   speed=f"{options.speed:g}")  # fmt: skip
    (options.results / "runs.md").write_text(report(rows, said))


if __name__ == "__main__":
    main()
