"""One part on two heads: with its contours whole, cut inside, and cut outside too.

    python benchmarks/shared_parts.py [--models gf_baseplate,…] [--cuts none,inside,all]
        [--machine dual-gantry] [--time-limit 60] [--seeds 0,1,2]

Real agent processes. The speed-up is against the order that `launch` finds for one head alone, on
the whole print. Every plan is judged against its source again. Writes
docs/results/shared_parts.csv (resumable) and shared_parts.md.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import product
from typing import Any

from common import Rows, arguments, grouped, markdown, measured, median, names, setting, spread
from team_prints import plate_path

KEY = ("machine", "model", "cut", "limit_s", "seed")
PARTS = "moveo_1m2,gf_baseplate,so100_plate_part1,openbot_top_A"


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Launch one part, and judge the plan against its source."""
    path = str(plate_path(key["model"]))
    options = ["--machine", key["machine"], "--cut", key["cut"], "--seed", str(key["seed"])]
    with tempfile.TemporaryDirectory() as folder:
        plan = f"{folder}/plan.json.gz"
        limit = ["--time-limit", str(key["limit_s"])]
        two = measured(["launch", path, *options, *limit, "--plan", plan])
        if two["exit"]:
            return {**key, **dict.fromkeys(FIGURES, ""), "error": two["error"]}
        judged = measured(["verify", plan, "--source", path])
    after = two["after"]
    cut = after.get("cut", {"cuts": 0, "outside": 0})
    makespan = after["makespan_s"]
    prints, travels = sum(after["printing_s_per_head"]), sum(after["travelling_s_per_head"])
    heads = len(after["printing_s_per_head"]) * makespan
    return {
        **key,
        "contours": two["before"]["contours"],
        "pieces": after["contours"],
        "cuts": cut["cuts"],
        "outside": cut["outside"],
        "one_head_s": round(after["one_head_s"], 1),
        "makespan_s": round(makespan, 1),
        "speedup": round(after["one_head_s"] / makespan, 3),
        "over_bound": round(makespan / after["bound"]["bound_s"], 3),
        "prints": round(prints / heads, 3),
        "travels": round(travels / heads, 3),
        "faults": len(judged.get("faults", [judged.get("error", "?")])),
        "wall_s": round(two["wall_s"], 1),
        "error": "",
    }


FIGURES = ("contours", "pieces", "cuts", "outside", "one_head_s", "makespan_s", "speedup",
           "over_bound", "prints", "travels", "faults", "wall_s", "error")  # fmt: skip


def of_parts(rows: list[dict[str, str]]) -> str:
    """Return a line for each part and cut: medians over seeds."""
    lines = [
        [
            model, cut, str(len(mine)), mine[0]["contours"], f"{median(mine, 'pieces'):.0f}",
            f"{median(mine, 'cuts'):.0f}", f"{median(mine, 'outside'):.0f}",
            f"{median(mine, 'one_head_s'):.0f}", f"{median(mine, 'makespan_s'):.0f}",
            spread([float(r["speedup"]) for r in mine], 2), f"{median(mine, 'over_bound'):.2f}",
            f"{100 * median(mine, 'prints'):.0f} %", f"{100 * median(mine, 'travels'):.0f} %",
            str(sum(int(r["faults"]) for r in mine)), f"{median(mine, 'wall_s'):.0f}",
        ]
        for (model, cut), mine in grouped(rows, "model", "cut").items()
    ]  # fmt: skip
    head = ["part", "cut", "seeds", "contours", "pieces", "cuts", "outside", "one head s",
            "two heads s", "speed-up", "÷ bound", "heads print", "travel", "faults",
            "wall s"]  # fmt: skip
    return markdown(lines, head)


def report(rows: Rows, said: str) -> str:
    """Return the page, a table for each machine."""
    text = f"# One part on several heads\n\n{said}\n\nRepeat: `python benchmarks/shared_parts.py`. "
    text += "One head: the order `launch` finds for one head alone, with contours whole. Bound: of "
    text += (
        "the contours or pieces as they are, so it falls with cuts. Heads print, travel: shares "
    )
    text += "of the makespan, of all heads; the rest they wait. Medians over seeds.\n"
    for (machine, limit_s), mine in grouped(rows.rows, "machine", "limit_s").items():
        text += f"\n## `{machine}`, {float(limit_s):g} s\n\n{of_parts(mine)}"
    return text + rows.failures()


def main() -> None:
    parser = arguments(__doc__, time_limit=60.0, models=PARTS)
    parser.add_argument("--cuts", type=names, default=["none", "inside", "all"])
    parser.add_argument("--machine", default="dual-gantry")
    options: argparse.Namespace = parser.parse_args()
    rows = Rows(options.results / "shared_parts.csv", KEY)
    for seed, model, cut in product(options.seeds, options.models, options.cuts):
        key = dict(zip(KEY, (options.machine, model, cut, options.time_limit, seed), strict=True))
        if options.table_only or rows.has(**key):
            continue
        rows.append(run(key))
        print(rows.rows[-1], flush=True)
    said = setting(note=options.note, time_limit="as each table says")
    (options.results / "shared_parts.md").write_text(report(rows, said))


if __name__ == "__main__":
    main()
