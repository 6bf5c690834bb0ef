"""What each part of the search for bare sequences is worth: without it, at equal time.

    python benchmarks/sop_ablation.py [--time-limit 10] [--seeds 0,1,2]

Problems: print-like ones, the hard ones of TSPLIB, and sparse ones (random costs, few precedences),
from 44 to 2402 nodes. A twin is the whole search with another seed: what it differs by is
noise. Seconds are processor time of both threads together, halved.
Writes docs/results/sop_ablation.csv (a row a run, resumable) and sop_ablation.md.
"""

from __future__ import annotations

import argparse
import time
from contextlib import ExitStack
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
from common import Rows, arguments, corpus, grouped, markdown, names, run_missing, setting
from effects import Effect, against_twins, told
from numpy.typing import NDArray
from sop_prints import print_like

from decmcts.formats.bare.sop import read_sop
from decmcts.planning.bare import compile_sop
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sop import annealing, joint, solver, threads, windows
from decmcts.search.sop.annealing import ALL, SHARES, LubyAnnealer
from decmcts.search.sop.annealing_kernels import Shares
from decmcts.search.sop.solver import search_sop
from decmcts.search.sop.threads import BeamThread, SopThread, TwoThreads

PRINTS = ("3 5 20 5 1", "4 5 50 10 2", "8 2 60 8 24", "10 6 30 5 27", "3 40 20 6 28")
TSPLIB = ("ft53.2", "ry48p.2", "p43.1", "kro124p.2", "rbg050c")
FEW = ("100 0.5 4", "100 1 5", "100 3 6", "300 1 7")  # nodes, per cent of pairs, seed
KINDS = {"print-like": PRINTS, "TSPLIB": TSPLIB, "sparse": FEW}
TWIN = 1000  # added to its seed


class NoBeams(TwoThreads):
    """Annealing in the place of beams."""

    def _beams(self) -> SopThread:  # type: ignore[override]
        return self._annealer(1)


class NoHandOver(TwoThreads):
    """Beams keep their thread."""

    def _handed_over(
        self, threads: list[SopThread], lead: float, *, cost_above: float
    ) -> list[SopThread]:
        after = super()._handed_over(threads, lead, cost_above=cost_above)
        return [threads[0] if isinstance(threads[0], BeamThread) else after[0], after[1]]


class NoTree(TwoThreads):
    """Annealing in the place of branch and bound."""

    def _tree(self) -> SopThread:  # type: ignore[override]
        return self._annealer(0)


class NoElites(TwoThreads):
    """Luby's lengths alone, as where costs are distances."""

    @property
    def steps(self) -> annealing.NearSteps:
        """Say that costs are distances."""
        return replace(super().steps, are_distances=True)


class ElitesAlone(TwoThreads):
    """Elites alone, where costs are no distances."""

    def _annealer(self, number: int) -> SopThread:  # type: ignore[override]
        made = super()._annealer(number)
        return made.annealers[1] if isinstance(made, threads.TurnsThread) else made


class NoWindows(TwoThreads):
    """The last annealing is as long as the time allows."""

    def _annealer(self, number: int) -> SopThread:  # type: ignore[override]
        made = super()._annealer(number)
        if isinstance(made, LubyAnnealer):
            made.last_share = ALL
        return made

    def _in_windows(self, thread: SopThread) -> SopThread:
        return thread


VARIANTS: dict[str, tuple[str, type[TwoThreads], Shares]] = {
    "all": ("all parts", TwoThreads, SHARES),
    "twin": ("its twin", TwoThreads, SHARES),
    "no-beams": ("without beam search", NoBeams, SHARES),
    "no-hand-over": ("beams keep their thread", NoHandOver, SHARES),
    "no-tree": ("without branch and bound", NoTree, SHARES),
    "no-elites": ("without elites", NoElites, SHARES),
    "no-luby": ("elites alone", ElitesAlone, SHARES),
    "no-windows": ("without windows", NoWindows, SHARES),
    "no-near": ("no moves to near nodes", TwoThreads, Shares(0.0, 0.12)),
    "no-reversals": ("no reversals", TwoThreads, Shares(0.7, 0.0)),
}
KEY = ("kind", "problem", "variant", "time_limit_s", "seed")


def few_precedences(
    n: int, percent: float, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return random costs 0..1000 (n, n) and random pairs (m, 2); node 0 first, n - 1 last."""
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 1001, (n, n)).astype(np.float64)
    inner = np.argwhere(np.triu(rng.random((n, n)) < percent / 100.0, 1))
    ends = [(0, k) for k in range(1, n)] + [(k, n - 1) for k in range(n - 1)]
    return costs, np.concatenate([inner, ends]).astype(np.int32)


def problem(kind: str, name: str) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return costs and precedence."""
    if kind == "print-like":
        return print_like(*(int(word) for word in name.split()))
    if kind == "sparse":
        n, percent, seed = name.split()
        return few_precedences(int(n), float(percent), int(seed))
    instance = read_sop(corpus() / "sop" / f"{name}.sop.gz")
    return instance.costs.astype(np.float64), instance.precedence


def run(key: dict[str, Any]) -> dict[str, Any]:
    costs, pairs = problem(key["kind"], key["problem"])
    _, chosen, shares = VARIANTS[key["variant"]]
    places = [(place, "SHARES", shares) for place in (annealing, joint, windows)]
    with ExitStack() as changed:
        for place, name, value in [(solver, "TwoThreads", chosen), *places]:
            changed.enter_context(patch.object(place, name, value))  # no library option
        result = search_sop(
            costs,
            pairs,
            stopping=Stopping(2.0 * float(key["time_limit_s"])),
            seed=int(key["seed"]) + (TWIN if key["variant"] == "twin" else 0),
            clock=time.process_time,
        )
    return key | {
        "nodes": len(costs), "cost": result.cost, "bound": result.bound,
        "found_by": result.found_by, "error": "",
    }  # fmt: skip


def effects(rows: list[dict[str, str]]) -> dict[tuple[str, str], list[Effect]]:
    """Return the effects of each variant on each kind of problem."""
    found: dict[tuple[str, str], list[Effect]] = {}
    for (kind, *_), mine in grouped(rows, "kind", "problem", "seed").items():
        costs = {row["variant"]: float(row["cost"]) for row in mine}
        for variant, effect in against_twins(costs, "all").items():
            found.setdefault((variant, kind), []).append(effect)
    return found


def told_of(them: list[Effect]) -> str:
    return f"{told(them)} ({len(them)})" if them else ""


def write_results(rows: list[dict[str, str]], options: argparse.Namespace) -> None:
    mine = [r for r in rows if float(r["time_limit_s"]) == options.time_limit and not r["error"]]
    found, seeds = effects(mine), ",".join(sorted({row["seed"] for row in mine}, key=int))
    lines = [
        [says, *(told_of(found.get((name, kind), [])) for kind in KINDS)]
        for name, (says, *_) in VARIANTS.items()
        if name not in ("all", "twin")
    ]
    said = setting(
        note=options.note, time_limit=f"{options.time_limit:g} s", seeds=seeds,
        seconds="processor time of both threads, halved",
    )  # fmt: skip
    text = f"# What each part of the search for bare sequences is worth\n\n{said}\n\n"
    text += f"Repeat: `python benchmarks/sop_ablation.py --time-limit {options.time_limit:g} "
    text += f"--seeds {seeds}`.\n\nFigures are per cent of cost that a variant makes more than the "
    text += "whole search (the mean of two runs that differ by seed): above 0, what is left out "
    text += "pays. After ± stands within what a variant that changes nothing would mostly stay, in "
    text += (
        "brackets how many runs. Bold is what lies beyond. Where costs are distances, as in the "
    )
    text += "print-like problems, there are no elites: the two variants of them are the whole "
    text += "search once more there, and what they show is noise.\n\n"
    named = "; ".join(
        f"{kind}: {', '.join(f'`{n}`' for n in them)}" for kind, them in KINDS.items()
    )
    text += f"{markdown(lines, ['variant', *KINDS])}\nProblems: {named}.\n"
    (options.results / "sop_ablation.md").write_text(text)


def main() -> None:
    parser = arguments(__doc__, time_limit=10.0, models="")
    parser.add_argument("--kinds", type=names, default=list(KINDS))
    parser.add_argument("--variants", type=names, default=list(VARIANTS))
    options = parser.parse_args()
    rows = Rows(options.results / "sop_ablation.csv", KEY)
    keys = [
        dict(zip(KEY, (kind, name, variant, options.time_limit, seed), strict=True))
        for seed in options.seeds
        for kind in options.kinds
        for name in KINDS[kind]
        for variant in options.variants
    ]
    if not options.table_only:
        compile_sop()
        run_missing(rows, keys, run)
    rows.read()
    write_results(rows.rows, options)


if __name__ == "__main__":
    main()
