"""Print-like bare problems of many shapes: `solve_sop` against plain annealing, at equal time.

    python benchmarks/sop_prints.py [--time-limit 25] [--seeds 0,1]

A problem has towers of layers; contours are points. A layer is printed before the next
one of its tower, and no tower gets `clearance` layers ahead of another. Costs are
distances in 0.01 mm. Plain annealing draws exchanges of two adjacent segments of
log-uniform lengths, anywhere, and cools from a temperature to a twentieth of the mean cost of a
step to a near node. That temperature is this mean or four times as much, whichever ends lower:
plain annealing has all the time for each. Time is processor time, of both threads together. Half
of the problems were looked at while the search was made; the other half were not.
Writes docs/results/sop_prints.csv (a row a run, resumable) and sop_prints.md.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

import numpy as np
from common import Rows, arguments, grouped, markdown, median, run_missing, setting, spread
from numpy.typing import NDArray

from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.bare import compile_sop
from decmcts.random_kernels import seeded
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sop.annealing import NearSteps
from decmcts.search.sop.annealing_kernels import Shares, anneal_bare
from decmcts.search.sop.precedence import Precedence
from decmcts.search.sop.solver import search_sop

SEEN = ("3 5 20 5 1", "4 5 50 10 2", "3 10 20 4 7", "9 4 25 3 12", "2 20 25 10 3", "6 20 20 6 11",
        "4 15 30 8 7", "5 12 45 6 13")  # fmt: skip
UNSEEN = (
    "2 3 50 5 21", "5 8 15 3 22", "3 25 12 2 23", "8 2 60 8 24", "2 12 50 20 26", "10 6 30 5 27",
    "3 40 20 6 28", "6 8 25 5 31", "7 20 25 6 32", "8 25 25 7 33",
)  # fmt: skip
KEY = ("problem", "solver", "time_limit_s", "seed")
COLD = 0.05  # last temperature, in mean costs of steps to near nodes
HOT = (1.0, 4.0)  # first temperatures that are tried, likewise
PROPOSALS = 100_000  # between looks at the clock


def print_like(
    towers: int, contours: int, layers: int, clearance: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return costs (n, n) and precedence (m, 2); node 0 is first, the last one costs nothing."""
    rng = np.random.default_rng(seed)
    centres: list[NDArray[np.float64]] = []
    while len(centres) < towers:
        place = rng.uniform(20.0, 180.0, 2)
        if all(np.hypot(*(place - other)) > 40.0 for other in centres):
            centres.append(place)
    points, keys = [(0.0, 0.0, 0.0)], [(-1, -1)]
    for tower in range(towers):
        base = centres[tower] + rng.uniform(-14.0, 14.0, (contours, 2))
        for layer in range(layers):
            for k in range(contours):
                x, y = base[k] + rng.normal(0.0, 1.0, 2)
                points.append((x, y, 0.2 * layer))
                keys.append((tower, layer))
    n, where, key = len(points) + 1, np.array(points), np.array(keys)
    costs = np.zeros((n, n))
    apart = np.sqrt(((where[:, None] - where[None]) ** 2).sum(axis=-1))
    costs[: n - 1, : n - 1] = np.rint(100.0 * apart)
    tower, layer = key.T
    same = tower[:, None] == tower[None]
    before = same & (layer[:, None] + 1 == layer[None])
    before |= ~same & (layer[:, None] + clearance == layer[None])
    before[0], before[:, 0] = True, False
    before[0, 0] = False
    pairs = [np.argwhere(before), np.array([(k, n - 1) for k in range(n - 1)])]
    return costs, np.concatenate(pairs).astype(np.int32)


def with_decmcts(
    costs: NDArray[np.float64], pairs: NDArray[np.int32], *, limit_s: float, seed: int
) -> NDArray[np.int32]:
    stopping = Stopping(limit_s)
    return search_sop(costs, pairs, stopping=stopping, seed=seed, clock=time.process_time).order


def with_plain(
    costs: NDArray[np.float64], pairs: NDArray[np.int32], *, limit_s: float, seed: int
) -> NDArray[np.int32]:
    n = len(costs)
    numbered = Precedence.of(n, pairs)
    mine = np.ascontiguousarray(costs[np.ix_(numbered.original, numbered.original)])
    graph = DependencyGraph.from_pairs(n, numbered.pairs)
    near = NearSteps.of(mine, mine, numbered.possible)
    ends: list[tuple[float, NDArray[np.int32]]] = []
    for hot in HOT:
        bare, state, began = near.bare(mine, graph), seeded(seed), time.process_time()
        steps = np.take_along_axis(mine, np.maximum(bare.near, 0), axis=1)
        mean = float(steps[bare.near >= 0].mean())
        while (share := (time.process_time() - began) / limit_s) < 1.0:
            temperature = mean * hot * (COLD / hot) ** share
            anneal_bare(bare, Shares(0.0, 0.0), state, temperature, PROPOSALS, 0, n - 1)
        order = numbered.original[bare.order]
        ends.append((float(costs[order[:-1], order[1:]].sum()), order))
    return min(ends, key=lambda end: end[0])[1]


SOLVERS = {"decmcts": with_decmcts, "plain": with_plain}


def run(key: dict[str, Any]) -> dict[str, Any]:
    costs, pairs = print_like(*(int(word) for word in key["problem"].split()))
    order = SOLVERS[key["solver"]](
        costs, pairs, limit_s=float(key["time_limit_s"]), seed=int(key["seed"])
    )
    position = np.argsort(order)
    sound = len(order) == len(costs) and (position[pairs[:, 0]] < position[pairs[:, 1]]).all()
    return key | {
        "nodes": len(costs),
        "cost": float(costs[order[:-1], order[1:]].sum()),
        "error": "" if sound else "breaks the precedence",
    }


def write_results(rows: list[dict[str, str]], options: argparse.Namespace) -> None:
    lines: list[list[str]] = []
    gains: dict[str, list[float]] = {"seen": [], "unseen": []}
    mine = [row for row in rows if float(row["time_limit_s"]) == options.time_limit]
    found = grouped(mine, "problem", "solver")
    for problem in (*SEEN, *UNSEEN):
        ours, plain = found.get((problem, "decmcts")), found.get((problem, "plain"))
        if not ours or not plain:
            continue
        a, b = median(ours, "cost"), median(plain, "cost")
        half = "seen" if problem in SEEN else "unseen"
        gains[half].append(100.0 * (1.0 - a / b))
        costs = " ".join(f"{float(row['cost']):.0f}" for row in ours)
        theirs = " ".join(f"{float(row['cost']):.0f}" for row in plain)
        name, gain = f"`{problem}`", f"{gains[half][-1]:.2f}"
        lines.append([name, half, ours[0]["nodes"], costs, theirs, gain])
    said = setting(
        note=options.note, time_limit=f"{options.time_limit:g} s of processor time",
        seeds=",".join(map(str, options.seeds)),
    )  # fmt: skip
    text = f"# Print-like sequential ordering problems\n\n{said}\n\nRepeat: `python "
    text += f"benchmarks/sop_prints.py --time-limit {options.time_limit:g} --seeds "
    text += f"{','.join(map(str, options.seeds))}`. A problem: towers, contours a layer, layers, "
    text += "clearance in layers, seed. Costs seed by seed; gain in the median.\n\n"
    for half, each in gains.items():
        if each:
            text += f"- {half} while the search was made: {spread(each, 2)} % less than plain "
            text += f"annealing, mean {statistics.mean(each):.2f}, least {min(each):.2f}\n"
    head = ["problem", "half", "nodes", "decmcts", "plain annealing", "less, %"]
    (options.results / "sop_prints.md").write_text(f"{text}\n{markdown(lines, head)}")


def main() -> None:
    parser = arguments(__doc__, time_limit=25.0, models="")
    parser.add_argument("--problems", default=",".join((*SEEN, *UNSEEN)), help="'T C L H S',…")
    options = parser.parse_args()
    rows = Rows(options.results / "sop_prints.csv", KEY)
    keys = [
        dict(zip(KEY, (problem, solver, options.time_limit, seed), strict=True))
        for seed in options.seeds
        for problem in options.problems.split(",")
        for solver in SOLVERS
    ]
    if not options.table_only:
        compile_sop()
        run_missing(rows, keys, run)
    rows.read()
    write_results(rows.rows, options)


if __name__ == "__main__":
    main()
