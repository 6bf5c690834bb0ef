"""`decentral-or-central`: a search a head, or one host that plans for all.

*Equal time*: all planners get equal processor time in one process, and know all. *Network*: agents
agree by the same protocol over a network in memory that loses and delays messages. Decentral, each
head searches and they exchange distributions and best plans. Central, one head has the rounds of
all, and the others wait for its plan.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.planners.team_planner import DecMctsPlanner
from decmcts.experiments.in_memory import agreed
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
)
from decmcts.experiments.teams import PlanFunction, figures, given, in_one_process, planned
from decmcts.planning.compiling import PRINT, TEAM
from decmcts.planning.options import Cut
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.exchange import exchange_jointly
from decmcts.team.dec_mcts.planner import DecMcts
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADS = 3
BED_MM = 500.0
MADE = ("row-6-20-20", "row-3-60-10")
NETWORKS = ((0.0, 0.0), (0.2, 0.5), (0.5, 1.0))  # loss, delay at most in s
DECENTRAL, CENTRAL = "decentral", "central"


class OneTree(DecMcts):
    """One Monte Carlo tree over joint plans in place of a tree and a distribution a head."""

    def _sample(self, team: tuple[int, ...]) -> None:
        """Grow the tree by one joint plan."""
        if self._joint is None:
            self._joint = [self._values.starts[team].plans]
            self._tree = self._new_tree(np.zeros(1, np.int32))
        node = self._tree.descend()
        plans = exchange_jointly(self.problem, self._joint[int(node.plan[0])], self._rng)
        while self._rng.random() < 0.3:
            plans = exchange_jointly(self.problem, plans, self._rng)
        child = self._tree.expand(node, np.array([len(self._joint)], np.int32))
        self._joint.append(plans)
        makespan = self._values.makespan(plans, team)
        self._utilities.append(-makespan)
        low, high = float(np.median(self._utilities)), max(self._utilities)
        reward = max(0.0, -makespan - low) / (high - low) if high > low else 0.5
        self._tree.backup(child, reward)

    _joint: list[Any] | None = None  # of each node; its plan is the place here

    def _combine(self, team: tuple[int, ...]) -> None:
        """Leave all to the tree."""

    def _update(self, team: tuple[int, ...]) -> None:
        """Have no distribution."""


def by_one_tree(problem: TeamProblem, stopping: Stopping, *, seed: int) -> tuple[Toolpath, ...]:
    """Return what one host finds that knows all and plans for all; iterations are rounds."""
    live = range(len(problem.machine.heads))
    began, rounds = time.process_time(), 0
    tree = OneTree(problem, 0, seed=seed)
    while not rounds or not stopping.ends(time.process_time() - began, rounds):
        tree.iterate(live, stopping.spent(time.process_time() - began, rounds))
        rounds += 1
    return resolve(problem, tree.best(live).plans, live).toolpaths


PLANNERS: Mapping[str, PlanFunction] = {"dec-mcts": in_one_process, "one tree": by_one_tree}


class Central(DecMctsPlanner):
    """Plans for all heads, in the processor time of all."""

    def __init__(self, problem: TeamProblem, head: int, *, seed: int) -> None:
        super().__init__(problem, head, seed=seed)
        self._search = OneTree(problem, head, seed=seed)

    def iterate(self, live: Sequence[int], spent: float = 1.0) -> None:
        """Do as many rounds as there are heads."""
        for _ in live:
            super().iterate(live, spent)


class Follower(DecMctsPlanner):
    """Plans nothing: it takes what it is offered."""

    def iterate(self, live: Sequence[int], spent: float = 1.0) -> None:
        """Do nothing."""


def _runs(asked: Asked) -> Iterator[tuple[Any, ...]]:
    for name in asked.prints or MADE:
        for planner in PLANNERS:
            yield name, "equal time", planner, 0.0, 0.0
        for loss, delay_s in NETWORKS:
            for planner in (DECENTRAL, CENTRAL):
                yield name, "network", planner, loss, delay_s


def _run(key: Key) -> Row:
    what = given(key, HEADS, BED_MM, Cut.INSIDE)
    compile_rounds()
    if key["setting"] == "equal time":
        return figures(what, planned(what, key, PLANNERS[key["planner"]]))
    result = agreed(what, _planners(what.team, key), key)
    return figures(what, result.document) | {
        "agreeing_s": round(result.agreeing_s, 2), "messages": result.messages,
    }  # fmt: skip


def _planners(problem: TeamProblem, key: Key) -> Callable[[int], DecMctsPlanner]:
    """Return what makes the planner of each head."""
    seed = int(key["seed"])
    if key["planner"] == DECENTRAL:
        return partial(DecMctsPlanner, problem, seed=seed)
    return lambda head: (Follower if head else Central)(problem, head, seed=seed)


def _equal(rows: Sequence[Line]) -> list[Line]:
    """Return the rows of equal time, over dec-mcts."""
    mine = [row for row in rows if row["setting"] == "equal time"]
    return against(mine, lambda row: row["planner"] == "dec-mcts", "print", "seed")


def _network(rows: Sequence[Line]) -> list[Line]:
    """Return the rows of networks, over decentral planning in calm weather."""
    mine = [row for row in rows if row["setting"] == "network"]
    calm = DECENTRAL, "0.0", "0.0"
    return against(
        mine, lambda row: (row["planner"], row["loss"], row["delay_s"]) == calm, "print", "seed"
    )


def _tables(rows: Sequence[Line]) -> str:
    text = "Equal processor time, equal facts: makespan over that of dec-mcts, and over the bound."
    lines = [
        [planner, str(len(mine)), spread(column(mine, "ratio"), 3),
         f"{min(column(mine, 'ratio')):.3f} to {max(column(mine, 'ratio')):.3f}",
         spread(column(mine, "over_bound"), 3)]
        for (planner,), mine in grouped(_equal(rows), "planner").items()
    ]  # fmt: skip
    head = ["planner", "runs", "÷ dec-mcts", "least and most", "÷ bound"]
    text += f"\n\n{markdown(lines, head)}\n"
    text += "Over a network: makespan over that of decentral planning without loss and delay.\n\n"
    lines = [
        [f"{100.0 * float(loss):g} %", delay, planner, str(len(mine)),
         spread(column(mine, "ratio"), 3), spread(column(mine, "agreeing_s"), 2),
         f"{median(mine, 'messages'):.0f}"]
        for (loss, delay, planner), mine
        in grouped(_network(rows), "loss", "delay_s", "planner").items()
    ]  # fmt: skip
    head = ["lost", "delay up to s", "planning", "runs", "makespan", "agreed after s", "messages"]
    return text + markdown(lines, head)


def _draw(rows: Sequence[Line]) -> Figure:
    made, axes = figure(3, width=4.6)
    equal = grouped(_equal(rows), "planner")
    boxes(axes[0], [column(mine, "ratio") for mine in equal.values()], [k[0] for k in equal])
    axes[0].set(ylabel="makespan ÷ dec-mcts", title="equal time, equal facts")
    network = grouped(_network(rows), "loss", "delay_s", "planner")
    labels = [f"{who}, {100 * float(loss):g} %, {delay} s" for loss, delay, who in network]
    boxes(axes[1], [column(mine, "ratio") for mine in network.values()], labels)
    axes[1].set(ylabel="makespan ÷ decentral, no loss", title="network")
    boxes(axes[2], [column(mine, "agreeing_s") for mine in network.values()], labels)
    axes[2].set(ylabel="simulated s until all agreed", title="network")
    return made


DECENTRAL_OR_CENTRAL = Experiment(
    "decentral-or-central",
    "A search a head, or one for all: at equal processor time, and where messages are lost?",
    ("print", "setting", "planner", "loss", "delay_s"), _runs, _run, _tables, _draw,
    Sizes(2.0, 30.0), Sizes(1, 5), (PRINT, TEAM),
)  # fmt: skip
