"""One part 1000 mm wide, shared by two to eight heads on one rail: how speed grows with heads.

    python benchmarks/shared_by_many.py [--heads 2,3,4,6,8] [--cuts inside,all] [--time-limit 20]
        [--seeds 0,1,2]

The part is a plate with holes made by code, so no corpus is needed. Heads are those of
`dual-gantry` on a bed of 1200 mm. Real agent processes. The speed-up is against the order that
`launch` finds for one head alone that reaches everything. Every plan is judged as `launch` judges
it. Writes docs/results/shared_by_many.csv (resumable) and shared_by_many.md.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import Rows, arguments, grouped, markdown, median, names, seeds, setting, spread

from decmcts.errors import InputError, VerificationError
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.planning.events import unheard
from decmcts.planning.options import RULES, Cut, TeamSearch
from decmcts.planning.problem.print_problem import problem_of
from decmcts.planning.problem.source import Source
from decmcts.planning.team.pipeline import plan_team
from tests.makers.plate import plate

KEY = ("heads", "cut", "limit_s", "seed")
FIGURES = ("contours", "pieces", "one_head_s", "makespan_s", "speedup", "over_bound", "prints",
           "wall_s", "error")  # fmt: skip
PART_MM, HOLE_MM, APART_MM = (1000.0, 100.0, 2.0), 15.0, 100.0
BED_MM, DEEP_MM = 1200.0, 300.0


@cache
def source_for(heads: int) -> Source:
    """Return the part on a rail of so many heads."""
    x, y = BED_MM / 2.0, DEEP_MM / 2.0
    count = int(PART_MM[0] / APART_MM)
    holes = [(x + (k + 0.5) * APART_MM - PART_MM[0] / 2.0, y) for k in range(count)]
    machine = rail_machine(load_machine("dual-gantry"), heads, BED_MM)
    return plate(PART_MM, (x, y), machine, holes=holes, radius=HOLE_MM)


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Plan the part; a plan that the judge refuses is an error."""
    problem = problem_of(source_for(key["heads"]), RULES, unheard)
    search = TeamSearch(key["limit_s"], seed=key["seed"], cut=Cut(key["cut"]))
    began = time.perf_counter()
    try:
        after = plan_team(problem, search, writes=False).after
    except (InputError, VerificationError) as error:
        return {**key, **dict.fromkeys(FIGURES, ""), "error": str(error)}
    found, makespan = after.metrics, after.plan.makespan_s
    return {
        **key,
        "contours": len(problem.job.contours),
        "pieces": len(after.contours),
        "one_head_s": round(found["one_head_s"], 1),
        "makespan_s": round(makespan, 1),
        "speedup": round(found["one_head_s"] / makespan, 3),
        "over_bound": round(makespan / found["bound"]["bound_s"], 3),
        "prints": round(sum(found["printing_s_per_head"]) / (key["heads"] * makespan), 3),
        "wall_s": round(time.perf_counter() - began, 1),
        "error": "",
    }


def table(rows: list[dict[str, str]]) -> str:
    """Return a line for each number of heads and cut."""
    lines = []
    for (heads, cut), mine in grouped(rows, "heads", "cut").items():
        speedups = [float(row["speedup"]) for row in mine]
        lines.append([
            heads, cut, str(len(mine)), mine[0]["contours"], mine[0]["pieces"],
            f"{median(mine, 'one_head_s'):.0f}", f"{median(mine, 'makespan_s'):.0f}",
            spread(speedups, 2), f"{median(mine, 'over_bound'):.2f}",
            f"{100 * median(mine, 'prints'):.0f} %", f"{median(mine, 'wall_s'):.0f}",
        ])  # fmt: skip
    head = ["heads", "cut", "seeds", "contours", "pieces", "one head s", "all heads s", "speed-up",
            "÷ bound", "heads print", "wall s"]  # fmt: skip
    return markdown(lines, head)


PAGE = """# One part, two to eight heads

{said}

Repeat: `python benchmarks/shared_by_many.py`. A plate of 1000 x 100 x 2 mm with ten holes, on a
rail of 1200 mm; heads as those of `dual-gantry`, 70 mm apart at least. One head: the order `launch`
finds for one head alone, with contours whole. Bound: of the pieces as they are. Heads print: share
of the makespan, of all heads. Medians over seeds.

{table}{failures}"""


def main() -> None:
    parser = arguments(__doc__, time_limit=20.0, models="part")
    parser.add_argument("--heads", type=seeds, default=[2, 3, 4, 6, 8], help="N,N,…")
    parser.add_argument("--cuts", type=names, default=["inside", "all"])
    options: argparse.Namespace = parser.parse_args()
    rows = Rows(options.results / "shared_by_many.csv", KEY)
    for seed, heads, cut in product(options.seeds, options.heads, options.cuts):
        key = dict(zip(KEY, (heads, cut, options.time_limit, seed), strict=True))
        if options.table_only or rows.has(**key):
            continue
        rows.append(run(key))
        print(rows.rows[-1], flush=True)
    said = setting(note=options.note, time_limit=f"{options.time_limit:g} s")
    (options.results / "shared_by_many.md").write_text(
        PAGE.format(said=said, table=table(rows.rows), failures=rows.failures())
    )


if __name__ == "__main__":
    main()
