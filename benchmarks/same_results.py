"""Ten prints and five plates planned with counted work: what must not change with the code.

    python benchmarks/same_results.py [--prints NAMES] [--plates NAMES] [--iterations N]

Prints one line each: contours, cost, and a digest of what was found. The work is counted, not
timed, so equal code gives equal lines on any machine. Run it before and behind a change that is
to change no result, and compare the lines.
"""

from __future__ import annotations

import argparse
import hashlib

import numpy as np
from common import print_path
from team_prints import swept_problem, team_problem
from team_run import one_turn

from decmcts.planning.options import Freedom, Objective, Rules
from decmcts.planning.problem.print_problem import load
from decmcts.search.planners import plan_order
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.parameters import Parameters
from decmcts.team.dec_mcts.planner import BestJointPlan, DecMcts
from decmcts.team.engine.resolve import resolve

PRINTS = (
    "mozc_caps_top", "odri_spacers_6", "mozc_arms_6", "teaset_chess_7", "moveo_covers_4",
    "koch_base", "xyz_cube_20", "crumpet", "gf_chess_tile", "torus_5cm",
)  # fmt: skip
PLATES = ("mix_2", "mix_5", "same_9", "slab@all", "gf_baseplate@all")
TURNS = 24  # of both heads together


def digest(*arrays: np.ndarray) -> str:
    """Return a short text that differs where arrays differ."""
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest()[:12]


def one_head(name: str, iterations: int) -> str:
    """Plan a print for one head; return what was found in words."""
    given = load(print_path(name), "mk4s", Rules(freedom=Freedom.SEAM))
    problem = given.for_one_head(Objective.TRAVEL)
    stopping = Stopping(iterations=iterations)
    found = plan_order(problem, planner="hybrid", seed=0, stopping=stopping)
    path = found.toolpath
    same = digest(path.order, path.reversed, path.entry)
    return f"{name}: {len(path.order)} contours, {found.cost:.6f} mm, {same}"


def two_heads(name: str, turns: int) -> str:
    """Plan a plate for two heads in turn in this process; return what was found in words."""
    problem = swept_problem(name)[1] if "@" in name else team_problem(name, 2)
    heads = [0, 1]
    parameters = Parameters.for_contours(len(problem.macro))
    team = [DecMcts(problem, head, seed=0, parameters=parameters) for head in heads]
    best: BestJointPlan | None = None
    for turn in range(turns):
        best = one_turn(team[turn % 2], team, heads, turn / turns, best, messages=True)
    assert best is not None
    paths = resolve(problem, best.plans, heads).toolpaths
    same = digest(*(path.order for path in paths))
    return f"{name}: {len(problem.macro)} contours, {best.makespan_s:.6f} s, {same}"


def main() -> None:
    """Print a line for each print and each plate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--prints", default=",".join(PRINTS))
    parser.add_argument("--plates", default=",".join(PLATES))
    parser.add_argument("--iterations", type=int, default=3_000_000)
    parser.add_argument("--turns", type=int, default=TURNS)
    given = parser.parse_args()
    for name in filter(None, given.prints.split(",")):
        print(one_head(name, given.iterations), flush=True)
    for name in filter(None, given.plates.split(",")):
        print(two_heads(name, given.turns), flush=True)


if __name__ == "__main__":
    main()
