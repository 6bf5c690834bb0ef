"""Something changes while a print is carried out, and what is left is planned anew.

    python benchmarks/online.py --seeds 0,1,2,3,4,5,6,7,8,9

Writes `online.csv` and `online.png` and prints tables, of which docs/results/online.md is made.

A joint plan is carried out up to a moment. There a head fails and is fenced at its park, or it is
noticed that a head takes longer than planned, from the beginning on. The other heads end what they
are at and go to their parks. What is left is planned from this one state in several ways: without a
search, by a search a head (decentral), and by one search for all (central). All searches get equal
processor time. What planning takes is not in the print time.

*Retimed* is the old order with the old shares, and new times. *Going on* is the old
plan where nobody stops for planning.

What a head leaves that prints no more goes to others in four simple ways, of which the soonest
counts: to the one that parks nearest, or part by part to the one that has the least to do; at its
turn in the old order, or behind all that does not wait for it. The rest of a print may demand more
than the print did: then contours come as soon as they may.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from common import Rows, arguments, grouped, markdown, run_missing, spread
from matplotlib.figure import Figure
from numpy.typing import NDArray
from team_baselines import policies

from decmcts.errors import InputError, VerificationError
from decmcts.experiments.decentral_or_central import by_one_tree
from decmcts.experiments.kinds import (
    DPI,
    Key,
    Line,
    Row,
    boxes,
    column,
    figure,
    stopping_of,
)
from decmcts.experiments.loss_and_failure import log_until
from decmcts.experiments.prints import shown
from decmcts.experiments.teams import (
    Given,
    bound_s,
    exact,
    given,
    given_by,
    in_one_process,
)
from decmcts.planning.options import Cut, Rules
from decmcts.planning.replanning.replan import Rest, rest_of, rest_problem
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import HeadState, PrintState, state_of_events, state_of_heads
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.alone import nearest_first
from decmcts.team.engine.plans import TUNED, StatedOrder, encode_stated
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import Resolved, resolve
from decmcts.team.engine.sweep_kernels import not_before
from decmcts.team.incumbent import Budget
from decmcts.version import __version__
from sim.controllers.carry_out import Run, carry_out
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.motion import profile_of
from sim.controllers.program import HeadProgram
from sim.controllers.simulate import simulate
from sim.controllers.timing import no_error

KEY = ("print", "heads", "event", "moment", "seconds", "iterations", "seed", "version")
BED_MM = 500.0
MADE = (("row-4-20-20", 2), ("strewn-9-12-3", 2), ("row-6-20-20", 3))
FULL = (*MADE, ("row-3-60-10", 2), ("row-9-15-10", 3), ("grid-3-12-12", 3))
FENCED, SLOWER = "fenced", ("1.2", "1.5")  # what happens: times as long as planned
MOMENTS, ALL_MOMENTS = (0.2, 0.5), (0.2, 0.5, 0.8)  # shares of the planned time
VICTIM = 0  # the head it happens to
ROUNDS = 4  # of each head for the plan that is carried out
LONG = 4  # times as long: a search for the best that can be found
RETIMED = "retimed"
WAYS = {
    RETIMED: "retimed", "greedy": "greedy", "central": "central", "decentral": "decentral",
    "resumed": "decentral, from the old order", "long": f"the same, {LONG} times as long",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class StoppedPrint:
    """A print that is carried out no further by its plan."""

    document: PlanDocument
    old: StatedOrder  # of the plan
    state: PrintState
    rest: Rest
    at_s: float  # when the last head has ended what it was at
    going_on_s: float  # print time by the old plan; 0: a head is fenced


def keys_of(options: argparse.Namespace) -> Iterator[Key]:
    """Yield the runs of made prints, for two heads and more where they are named."""
    named = [(name, heads) for name in options.models for heads in (2, 3)]
    for name, heads in named or (FULL if options.full else MADE):
        for event in (FENCED, *SLOWER)[heads < 3 :]:  # one head alone needs no team
            for moment in ALL_MOMENTS if options.full else MOMENTS:
                for seed in options.seeds:
                    yield dict(zip(KEY, (name, heads, event, moment, options.time_limit, 0, seed,
                                         __version__), strict=True))  # fmt: skip


def run(key: Key) -> Row:
    """Carry a print out up to the moment, and plan the rest in all ways."""
    began = time.process_time()
    try:
        found, error = _planned_anew(key), ""
    except (InputError, VerificationError) as refused:
        found, error = {}, " ".join(str(refused).split())
    return {**key, **found, "cpu_s": round(time.process_time() - began, 2), "error": error}


def _planned_anew(key: Key) -> Row:
    compile_rounds()
    stopped = _stopped(key)
    what = given_by(rest_problem(stopped.rest, Rules()))
    found, spent = dict[str, float](), dict[str, float]()
    for name, plan in _ways(what, stopped, key).items():
        began = time.process_time()
        toolpaths = plan()
        spent[f"{name}_cpu_s"] = round(time.process_time() - began, 2)
        makespan_s = exact(what, toolpaths).plan.makespan_s
        found[f"{name}_s"] = round(stopped.at_s + makespan_s, 2)
    return {
        "contours": len(stopped.document.contours),
        "planned_s": round(stopped.document.plan.makespan_s, 2),
        "stopped_s": round(stopped.at_s, 2),
        "left": len(what.problem.job.contours),
        "left_out": int(stopped.rest.left.rows.sum()),
        "going_on_s": round(stopped.going_on_s, 2),
        "bound_s": round(stopped.at_s + bound_s(what), 2),
        "best_s": min(found.values()),
        **found, **spent,
    }  # fmt: skip


def _ways(
    what: Given, stopped: StoppedPrint, key: Key
) -> dict[str, Callable[[], tuple[Toolpath, ...]]]:
    """Return what plans the rest, by name, after each has run once: kernels are loaded then."""
    seed, stopping, once = int(key["seed"]), stopping_of(key), Stopping(iterations=1)
    long = stopping_of({**key, **{n: LONG * key[n] for n in ("seconds", "iterations")}})
    team = what.team
    old = _old(stopped, team)
    start, _ = retimed(team, old)
    resumed = build_team_problem(team.job, team.machine, team.graph, what.lags, start)
    for problem in (team, resumed):
        in_one_process(problem, once, seed=0)
    first = Budget(Stopping(iterations=TUNED))
    return {
        RETIMED: lambda: retimed(team, old)[1].toolpaths,
        "greedy": lambda: policies(team, first, seed=seed).toolpaths,
        "central": lambda: by_one_tree(team, stopping, seed=seed),
        "decentral": lambda: in_one_process(team, stopping, seed=seed),
        "resumed": lambda: in_one_process(resumed, stopping, seed=seed),
        "long": lambda: in_one_process(resumed, long, seed=seed),
    }


@lru_cache(maxsize=32)
def _begun(name: str, heads: int, seed: int) -> tuple[Given, PlanDocument, StatedOrder]:
    """Return a print, the plan it is begun by, and that plan's order.

    It depends on rounds, not on time, so that it is the same in every process.
    """
    key = {"print": name}
    what = given(key, heads, BED_MM, Cut.NONE)
    toolpaths = in_one_process(what.team, Stopping(iterations=ROUNDS), seed=seed)
    return what, exact(what, toolpaths), StatedOrder.of(toolpaths)


def _stopped(key: Key) -> StoppedPrint:
    """Carry a plan out up to the moment, and return what is left of it."""
    what, document, old = _begun(key["print"], int(key["heads"]), int(key["seed"]))
    programs, now = programs_of_plan(document), float(key["moment"]) * document.plan.makespan_s
    victim, is_fenced = document.machine.heads[VICTIM], key["event"] == FENCED
    slower = 1.0 if is_fenced else float(key["event"])
    run = with_late_head(document, programs, VICTIM, slower)
    heads, at_s = ended_by(document, programs, run, now, {VICTIM} if is_fenced else ())
    if is_fenced:
        log = log_until(simulate(programs, document.machine), document, VICTIM, now)
        heads[VICTIM] = state_of_events(document, log).heads[VICTIM]
    state = state_of_heads(document, heads)
    source = replace(what.problem.source, machine=what.problem.machine)
    rest = rest_of(
        document, source, state, {victim.name: victim.park} if is_fenced else {},
        LeftBeads.FINISH, slower={victim.name: slower},
    )  # fmt: skip
    end_s = max(head.end_s for head in run.heads)
    return StoppedPrint(document, old, state, rest, at_s, 0.0 if is_fenced else end_s)


def _old(stopped: StoppedPrint, team: TeamProblem) -> Old:
    """Return the old order for those that print the rest."""
    rest, names = stopped.rest, list(team.head_names)
    is_open = ~stopped.state.done
    is_open[[one.contour for one in rest.broken if one.rest]] = True
    heads = [head.name for head in stopped.document.machine.heads]
    number = [names.index(name) if name in names else -1 for name in heads]
    return Old(stopped.old, np.flatnonzero(is_open & ~rest.left.rows), np.array(number))


def _lines(rows: Sequence[Line]) -> list[Line]:
    """Return the rows of each way, with its print time over those of others."""
    return [
        {**row, "way": words, "over_best": _over(row, name, "best_s"),
         "over_retimed": _over(row, name, f"{RETIMED}_s"),
         "over_central": _over(row, name, "central_s"), "over_bound": _over(row, name, "bound_s"),
         "over_going_on": _over(row, name, "going_on_s"), "cpu": row[f"{name}_cpu_s"]}
        for row in rows if not row["error"] for name, words in WAYS.items()
    ]  # fmt: skip


def _over(row: Line, name: str, base: str) -> str:
    """Return a print time over another, empty where there is none."""
    least = float(row[base])
    return str(float(row[f"{name}_s"]) / least) if least else ""


def tables(rows: Sequence[Line]) -> str:
    lines = [
        [heads, event, way, str(len(mine)), spread(column(mine, "over_best"), 3),
         spread(column(mine, "over_retimed"), 3),
         spread(column(mine, "over_central"), 3),
         "" if event == FENCED else spread(column(mine, "over_going_on"), 3),
         spread(column(mine, "over_bound"), 3), spread(column(mine, "cpu"), 2)]
        for (heads, event, way), mine in grouped(_lines(rows), "heads", "event", "way").items()
    ]  # fmt: skip
    head = ["heads", "what happens", "planned anew", "runs", "÷ best", "÷ retimed",
            "÷ central", "÷ going on", "÷ bound", "planned in s"]  # fmt: skip
    text = "Print time of the whole print, over the best of all ways and over the old order.\n\n"
    text += f"{markdown(lines, head)}\nOf each print and moment, ÷ retimed.\n\n"
    ways = list(WAYS.values())[1:]
    lines = [
        [shown(name), heads, event, f"{100.0 * float(moment):g} %", str(len(mine) // len(WAYS)),
         *(spread(column(of, "over_retimed"), 3) for (way,), of in grouped(mine, "way").items()
           if way in ways)]
        for (name, heads, event, moment), mine
        in grouped(_lines(rows), "print", "heads", "event", "moment").items()
    ]  # fmt: skip
    return text + markdown(lines, ["print", "heads", "what happens", "at", "runs", *ways])


def draw(rows: Sequence[Line]) -> Figure:
    settings = grouped(_lines(rows), "heads", "event")
    made, axes = figure(max(1, len(settings)), width=3.6, height=4.8)
    for axis, ((heads, event), mine) in zip(axes, sorted(settings.items()), strict=False):
        ways = grouped(mine, "way")
        boxes(axis, [column(of, "over_retimed") for of in ways.values()], [way for (way,) in ways])
        axis.axhline(1.0, color="grey", linewidth=0.8)
        happens = "one is fenced" if event == FENCED else f"one late: × {event}"
        axis.set(ylabel="print time ÷ retimed", title=f"{heads} heads, {happens}")
    return made


Ints = NDArray[np.int64]


class Old(NamedTuple):
    """The order of the plan that was carried out, as far as it matters for the rest."""

    order: StatedOrder  # of all contours of the plan
    left: Ints  # (n,) which of these each contour of the rest is, rising
    head: Ints  # (heads,) which of the rest's heads each was; -1: it prints no more


def retimed(team: TeamProblem, old: Old) -> tuple[StatedOrder, Resolved]:
    """Return what is left of an old order, and when heads are done that carry it out.

    Raises
    ------
    InputError
        Where heads cannot carry it out.
    """
    found = []
    for balanced, behind in product((False, True), repeat=2):
        order = _taken_over(team, old, balanced=balanced, behind=behind)
        resolved = _stated(team, order)
        if _is_kept(order, resolved):
            found.append((order, resolved))
    if not found:
        raise InputError("what is left cannot be printed in the old order")
    return min(found, key=lambda one: one[1].makespan_s)


def _stated(team: TeamProblem, order: StatedOrder) -> Resolved:
    heads = len(team.machine.heads)
    return resolve(team, {0: encode_stated(order, heads, team.n_macros)}, range(heads))


def _is_kept(order: StatedOrder, resolved: Resolved) -> bool:
    """Tell whether each head does what the order says; else heads cannot carry it out."""
    return all(
        np.array_equal(found.order, order.order[order.head == r])
        for r, found in enumerate(resolved.toolpaths)
    )


def _taken_over(team: TeamProblem, old: Old, *, balanced: bool, behind: bool) -> StatedOrder:
    """Return what is left of an old order, with what nobody prints taken over."""
    kept = np.isin(old.order.order, old.left)
    was = np.searchsorted(old.left, old.order.order[kept])
    turn, head = np.empty(len(was), np.int64), np.empty(len(was), np.int64)
    turn[was], head[was] = np.arange(len(was)), old.head[old.order.head[kept]]
    due = turn + len(turn) * ((head < 0) & behind)
    not_before(due, team.graph.pred_offsets, team.graph.preds)
    order = np.argsort(due, kind="stable").astype(np.int32)
    _give(team, head, order, balanced=balanced)
    return StatedOrder(order, old.order.reversed[kept][turn[order]], head[order])


def _give(team: TeamProblem, head: Ints, order: NDArray[np.int32], *, balanced: bool) -> None:
    """Fill in who prints each contour that has no head, (n,) `head`."""
    eligible, seconds = team.space.eligible, team.visits.seconds
    heads = range(eligible.shape[1])
    nearest = nearest_first(team.space, heads)
    work = [float(seconds[r, head == r].sum()) for r in heads]
    rows = order[head[order] < 0]
    for part in dict.fromkeys(team.part[rows].tolist()):
        first = sorted(heads, key=work.__getitem__) if balanced else nearest
        for c in rows[team.part[rows] == part].tolist():
            head[c] = next(r for r in first if eligible[c, r])
            work[head[c]] += float(seconds[head[c], c])


def with_late_head(
    document: PlanDocument, programs: tuple[HeadProgram, ...], late: int, slower: float
) -> Run:
    """Carry a plan out while one head takes so many times as long."""
    errors = [no_error(program) for program in programs]
    errors[late] = replace(errors[late], factor=errors[late].factor * slower)
    seconds = [profile_of(program).seconds for program in programs]
    return carry_out(programs, seconds, errors, document.machine.rest_s)


def ended_by(
    document: PlanDocument, programs: tuple[HeadProgram, ...], run: Run, now: float,
    gone: Collection[int] = (),
) -> tuple[list[HeadState], float]:  # fmt: skip
    """Return how far heads are once each has ended what it began before now, and when that is.

    Nobody waits for those that are `gone`.
    """
    heads, until = list[HeadState](), now
    for h, (program, what) in enumerate(zip(programs, run.heads, strict=True)):
        begun = program.action[what.begin < now]
        count = int(begun[-1]) + 1 if len(begun) else 0
        if h not in gone:
            until = max(until, float(what.end[program.action < count].max(initial=0.0)))
        heads.append(HeadState(document.plan.heads[h].head, count))
    return heads, until


def main() -> None:
    parser = arguments(__doc__, time_limit=1.0, models="")
    parser.add_argument("--full", action="store_true", help="more prints, and a third moment")
    options = parser.parse_args()
    rows = Rows(options.results / "online.csv", KEY)
    if not options.table_only:
        run_missing(rows, keys_of(options), run)
    rows.read()
    print(tables(rows.rows) + rows.failures())
    draw(rows.rows).savefig(options.results / "online.png", dpi=DPI)


if __name__ == "__main__":
    main()
