"""`loss-and-failure`: messages are lost and heads fail, while they plan and while they print.

*Planning*: agents agree over a network in memory; one of them is killed at a share of the planning
time, and is either fenced, so that the others print its work, or started again. *Printing*: a
joint plan is run in simulated controllers up to a moment; there one head stops for good, within a
bead if it prints one, and is taken to its park. What is left is planned anew for the others.

*Clairvoyant* is a bound: nobody, who knows of the failure from the beginning, can be done before
all beads are printed by heads of which one works no longer than until it fails. *Waiting*: nobody
plans anew; a person needs so many minutes to set the head going again, and meanwhile the others do
what does not wait for it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.planners.team_planner import DecMctsPlanner
from decmcts.experiments.in_memory import STEP_S, MemoryTeam, agreed, rounds_of
from decmcts.experiments.kinds import (
    Asked,
    Experiment,
    Key,
    Line,
    Row,
    Sizes,
    against,
    boxes,
    column,
    figure,
    grouped,
    markdown,
    median,
    spread,
    stopping_of,
)
from decmcts.experiments.prints import print_file
from decmcts.experiments.teams import Given, bound_s, given, machine_for, planned, printing_s
from decmcts.planning.compiling import PRINT, TEAM
from decmcts.planning.launch import planned_by
from decmcts.planning.options import Cut, Limits, Rules, TeamSearch
from decmcts.planning.problem.source import Source, read
from decmcts.planning.replanning.replan import replan, rest_of
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from decmcts.print.print_state import state_of_events
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.resolve import resolve
from decmcts.team.incumbent import TeamIncumbent
from sim.controllers.carry_out import carry_out
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.simulate import Simulation, events_of, simulate
from sim.controllers.timing import no_error

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BED_MM = 400.0
MADE = ("row-4-20-20", "row-6-15-25")
LOSSES = ((0.0, 0.0), (0.2, 0.5), (0.5, 1.0))  # share of messages lost, delay at most in s
KILLED = ("", "fenced", "restarted")
MOMENTS = (0.2, 0.5, 0.8)  # shares of the planning time, or of the print
HEADS = Sizes(2, 3)
PERSON_S = {"wait_5": 300.0, "wait_30": 1800.0}
VICTIM = 0  # the head that fails


def _runs(asked: Asked) -> Iterator[tuple[Any, ...]]:
    for name in asked.prints or MADE:
        for heads in range(2, int(HEADS[asked.full]) + 1):
            for loss, delay_s in LOSSES:
                for killed in KILLED:
                    yield name, heads, "planning", loss, delay_s, killed, 0.5 if killed else 0.0
            for moment in MOMENTS:
                yield name, heads, "printing", 0.0, 0.0, "stopped", moment


def _run(key: Key) -> Row:
    what = given(key, int(key["heads"]), BED_MM, Cut.NONE)
    return _planning(what, key) if key["phase"] == "planning" else _printing(what, key)


def _planning(what: Given, key: Key) -> Row:
    """Let agents agree while messages are lost and one of them dies."""
    compile_rounds()
    planner_of = partial(DecMctsPlanner, what.team, seed=int(key["seed"]))
    at_s = float(key["moment"]) * rounds_of(key) * STEP_S

    def disturb(team: MemoryTeam) -> None:
        is_first = VICTIM in team.agents and team.epochs[VICTIM] == 1
        if key["fails"] and is_first and team.network.now >= at_s:
            team.fence(VICTIM)
            if key["fails"] == "restarted":
                team.add(VICTIM, epoch=2)

    result = agreed(what, planner_of, key, disturb)
    return {
        "contours": len(what.problem.job.contours),
        "makespan_s": round(result.document.plan.makespan_s, 2),
        "live": result.live,
        "agreeing_s": round(result.agreeing_s, 2),
        "messages": result.messages,
    }


def _printing(what: Given, key: Key) -> Row:
    """Print until a head stops, and plan the rest anew."""
    document = planned(what, key)
    simulation = simulate(programs_of_plan(document), document.machine)
    at_s = float(key["moment"]) * simulation.makespan_s
    state = state_of_events(document, log_until(simulation, document, VICTIM, at_s))
    victim = document.machine.heads[VICTIM]
    began = time.perf_counter()
    rest = rest_of(
        document, _source(key, what), state, {victim.name: victim.park}, LeftBeads.FINISH
    )
    result = replan(
        rest, TeamSearch(0.0, int(key["seed"]), cut=Cut.NONE), Rules(), writes=False,
        agents=partial(planned_by, InTurn(stopping_of(key))),
    )  # fmt: skip
    thought_s = time.perf_counter() - began
    total = at_s + result.document.plan.makespan_s
    least = max(bound_s(what), clairvoyant_s(document, at_s))
    return {
        "contours": len(document.contours),
        "makespan_s": round(total, 2),
        "planned_s": round(simulation.makespan_s, 2),
        "failed_at_s": round(at_s, 2),
        "printed": rest.done,
        "left_out": int(rest.left.rows.sum()),
        "clairvoyant_s": round(least, 2),
        **{name: round(waiting_s(simulation, document, at_s, person_s), 2)
           for name, person_s in PERSON_S.items()},
        "thought_s": round(thought_s, 2),
    }  # fmt: skip


def log_until(simulation: Simulation, document: PlanDocument, head: int, time_s: float) -> EventLog:
    """Return what has happened up to a time at which a head stops for good."""
    log = events_of(simulation, document.problem)
    before = [event for event in log.events if event.time_s < time_s]
    program, run = simulation.programs[head], simulation.run.heads[head]
    at = simulation.positions(np.array([time_s]))[head][0]
    begun = [e.action for e in before if e.head == head and e.kind is EventKind.BEGAN]
    ended = [e.action for e in before if e.head == head and e.kind is EventKind.ENDED]
    action, point = (begun[-1], 0) if begun else (-1, 0)
    if begun and action not in ended:
        mine = program.action == action
        point = int(np.count_nonzero(run.end[mine] - simulation.begin_s <= time_s))
    x, y, z = at.tolist()
    failed = PrintEvent(
        EventKind.FAILED, head, time_s, action, point, (x, y, z), what="clogged"
    )  # fmt: skip
    return EventLog(log.problem, log.heads, (*before, failed))


def _source(key: Key, what: Given) -> Source:
    """Return the print as it is replanned: under the limits that the plan was made with."""
    _, middle = machine_for(key, int(key["heads"]), BED_MM)
    with print_file(key, middle) as path:
        return read(path, what.problem.machine, limits=Limits.MACHINE)


def clairvoyant_s(document: PlanDocument, fails_s: float) -> float:
    """Return before when nobody can be done of whose heads one works until it fails only.

    The others work all the time at most, and what beads take no plan changes.
    """
    others = len(document.machine.heads) - 1
    return max(fails_s, (printing_s(document) - fails_s) / others)


def waiting_s(
    simulation: Simulation, document: PlanDocument, fails_s: float, person_s: float
) -> float:
    """Return when all are done if a head stands for so long where it fails, and then goes on."""
    errors = [no_error(program) for program in simulation.programs]
    run = simulation.run.heads[VICTIM]
    later = np.flatnonzero(run.end - simulation.begin_s > fails_s)
    if len(later):
        errors[VICTIM].stall_s[later[0]] = person_s
    seconds = [profile.seconds for profile in simulation.profiles]
    late = carry_out(simulation.programs, seconds, errors, document.machine.rest_s)
    return max(head.end_s for head in late.heads) - simulation.begin_s


class InTurn:
    """Heads that plan in turn in this process, in place of processes of their own."""

    def __init__(self, stopping: Stopping) -> None:
        self._stopping = stopping

    def plan(self, incumbent: TeamIncumbent, *, seed: int) -> None:
        """Offer the best joint order of all heads."""
        best = plan_in_turn(
            incumbent.problem, stopping=self._stopping, seed=seed, clock=time.process_time
        )
        found = resolve(incumbent.problem, best.plans, range(len(incumbent.problem.machine.heads)))
        incumbent.offer_toolpaths(found.toolpaths, found.makespan_s)


def _planned_rows(rows: Sequence[Line]) -> list[Line]:
    """Return the rows of planning, over the calm run."""
    mine = [row for row in rows if row["phase"] == "planning"]
    return against(
        mine, lambda row: (row["loss"], row["fails"]) == ("0.0", ""), "print", "heads", "seed"
    )


def _printed_rows(rows: Sequence[Line]) -> list[Line]:
    """Return the rows of printing with their makespan over other ways to go on."""
    return [
        {**r, **{f"over_{name}": str(float(r["makespan_s"]) / float(r[name]))
                 for name in ("clairvoyant_s", *PERSON_S)}}
        for r in rows if r["phase"] == "printing" and not r["error"]
    ]  # fmt: skip


def _tables(rows: Sequence[Line]) -> str:
    text = "While planning. Makespan over that of the same team with no loss and no failure.\n\n"
    lines = [
        [heads, f"{100.0 * float(loss):g} %", delay, fails or "nobody", str(len(mine)),
         f"{median(mine, 'live'):.0f}", spread(column(mine, "ratio"), 3),
         spread(column(mine, "agreeing_s"), 2), f"{median(mine, 'messages'):.0f}"]
        for (heads, loss, delay, fails), mine
        in grouped(_planned_rows(rows), "heads", "loss", "delay_s", "fails").items()
    ]  # fmt: skip
    text += markdown(
        lines,
        ["heads", "lost", "delay up to s", "killed", "runs", "heads that print", "makespan",
         "agreed after s", "messages"],
    )  # fmt: skip
    text += "\nWhile printing. Print time with what is left planned anew, over other ways.\n\n"
    lines = [
        [heads, f"{100.0 * float(moment):g} %", str(len(mine)),
         f"{sum(column(mine, 'left_out')):.0f}", spread(column(mine, "makespan_s"), 0),
         spread(column(mine, "over_clairvoyant_s"), 3), spread(column(mine, "over_wait_5"), 3),
         spread(column(mine, "over_wait_30"), 3), spread(column(mine, "thought_s"))]
        for (heads, moment), mine in grouped(_printed_rows(rows), "heads", "moment").items()
    ]  # fmt: skip
    return text + markdown(
        lines,
        ["heads", "fails at", "runs", "contours left out", "print time s", "÷ clairvoyant",
         "÷ waiting 5 min", "÷ waiting 30 min", "planned anew in s"],
    )  # fmt: skip


def _draw(rows: Sequence[Line]) -> Figure:
    made, axes = figure(3, width=4.8)
    planning = grouped(_planned_rows(rows), "loss", "fails")
    labels = [f"{100 * float(loss):g} %, {fails or 'nobody'}" for loss, fails in planning]
    boxes(axes[0], [column(mine, "ratio") for mine in planning.values()], labels)
    axes[0].set(ylabel="makespan ÷ no loss, nobody killed", title="while planning")
    boxes(axes[1], [column(mine, "agreeing_s") for mine in planning.values()], labels)
    axes[1].set(ylabel="simulated s until all agreed", title="while planning")
    printing = _printed_rows(rows)
    ways = {"clairvoyant": "over_clairvoyant_s", "waiting 5 min": "over_wait_5",
            "waiting 30 min": "over_wait_30"}  # fmt: skip
    for label, name in ways.items():
        axes[2].plot(
            [100.0 * v for v in column(printing, "moment")], column(printing, name), "o",
            label=f"÷ {label}", alpha=0.7,
        )  # fmt: skip
    axes[2].axhline(1.0, color="grey", linewidth=0.8)
    axes[2].set(xlabel="share of the print when a head fails, %", ylabel="print time, planned anew",
                title="while printing")  # fmt: skip
    axes[2].legend(fontsize=8)
    return made


LOSS_AND_FAILURE = Experiment(
    "loss-and-failure",
    "Messages are lost and heads fail, while planning and while printing: what does it cost?",
    ("print", "heads", "phase", "loss", "delay_s", "fails", "moment"), _runs, _run, _tables, _draw,
    Sizes(2.0, 20.0), Sizes(1, 5), (PRINT, TEAM),
)  # fmt: skip
