"""Two heads on the eight large plates: makespan against one head and the bound.

    python benchmarks/two_heads.py [--time-limit 60] [--plates a,b]

Real processes over real zenoh sessions. Every plan is verified for every timing
its order allows, and replayed with timing errors of 0.5x to 2x on each action.
Writes docs/results/two_heads.csv (resumable) and two_heads.md.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from common import RESULTS, Rows, corpus, markdown, measured, setting

KEY = ("plate", "limit_s", "seed")


def run(path: Path, key: dict[str, Any], trials: int) -> dict[str, Any]:
    """Plan for two heads, each a process, and replay the joint plan."""
    limit = ["--time-limit", str(key["limit_s"]), "--seed", str(key["seed"])]
    machine = ["--machine", "dual-gantry"]
    with tempfile.TemporaryDirectory() as folder:
        plan = f"{folder}/plan.json.gz"
        two = measured(["launch", str(path), *machine, *limit, "--no-quality", "--plan", plan])
        replay: dict[str, Any] = {"faults": ["not planned"]}
        if not two["exit"]:
            replay = measured(["verify", plan, "--source", str(path), "--trials", str(trials)])
    return {**key, **figures_of(path, two, replay)}


def figures_of(path: Path, two: dict[str, Any], replay: dict[str, Any]) -> dict[str, Any]:
    if two["exit"]:
        return dict.fromkeys(FIGURES, "") | {"error": two["error"]}
    after = two["after"]
    alone, bound = after["one_head_s"], after["bound"]
    agents = after["agents"]
    return {
        "contours": after["contours"],
        "one_head_s": alone,
        "two_heads_s": after["makespan_s"],
        "speedup": round(alone / after["makespan_s"], 3),
        "bound_s": round(bound["bound_s"], 1),
        "over_bound": round(after["makespan_s"] / bound["bound_s"], 3),
        "whole_s": round(whole_bound(path), 1),
        "over_whole": round(after["makespan_s"] / whole_bound(path), 3),
        "messages": sum(agent["sent"] for agent in agents),
        "bytes": sum(agent["sent_bytes"] for agent in agents),
        "planner": after["planner"],
        "faults": len(replay.get("faults", [replay.get("error", "?")])),
        "plan_s": round(two["wall_s"], 1),
        "peak_mib": round(two["peak_mib"]),
        "error": "",
    }


@cache
def whole_bound(path: Path) -> float:
    """Return the bound for heads that hold a contour's whole room to its end: W - M."""
    from decmcts.feasibility.rules import order_rules
    from decmcts.formats.gcode import read_gcode
    from decmcts.formats.machine_file import load_machine
    from decmcts.team.bound import makespan_bound

    machine = replace(load_machine("dual-gantry"), release="action")
    job, _ = read_gcode(path)
    machine = replace(machine, limits=machine.limits.under(job.limits))
    return makespan_bound(job, machine, order_rules(job, machine)).bound_s


FIGURES = ("contours", "one_head_s", "two_heads_s", "speedup", "bound_s", "over_bound",
           "whole_s", "over_whole", "messages", "bytes", "planner", "faults", "plan_s",
           "peak_mib", "error")  # fmt: skip


def report(rows: list[dict[str, str]], said: str) -> str:
    head = ["plate", "contours", "one head s", "two heads s", "speed-up", "bound s",
            "makespan ÷ bound", "W−M s", "makespan ÷ (W−M)", "messages", "KiB",
            "faults in replay", "wall s"]  # fmt: skip
    done = [r for r in rows if not r["error"]]
    lines = [
        [
            r["plate"],
            r["contours"],
            f"{float(r['one_head_s']):.0f}",
            f"{float(r['two_heads_s']):.0f}",
            f"{r['speedup']}×",
            f"{float(r['bound_s']):.0f}",
            r["over_bound"],
            f"{float(r['whole_s']):.0f}",
            r["over_whole"],
            r["messages"],
            f"{int(r['bytes']) / 1024:.0f}",
            r["faults"],
            r["plan_s"],
        ]
        for r in done
    ]
    text = f"# Two heads on large plates\n\n{said}\n\nRepeat: `python benchmarks/two_heads.py`. "
    text += "One head: the best order `local` finds in a third of the time (at most 10 s), for one "
    text += "such head that reaches everything, alone on the machine. Bound: proven for heads that "
    text += "give room back piece by piece, as here; no travel is counted. W−M: the bound for "
    text += "heads that hold a contour's whole room to its end, which others may beat. Messages "
    text += "and bytes: sent by both agents.\n\n"
    if done:
        bound = statistics.median(float(r["over_bound"]) for r in done)
        whole = statistics.median(float(r["over_whole"]) for r in done)
        text += f"Median: makespan {bound:.2f} times the bound, {whole:.2f} times W−M.\n\n"
    text += markdown(lines, head)
    failed = [f"- {r['plate']}: {r['error']}\n" for r in rows if r["error"]]
    return text + "".join(failed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--plates", default="")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    rows = Rows(RESULTS / "two_heads.csv", KEY)
    for path in sorted((corpus() / "models" / "plates" / "gcode").glob("*.gcode.gz")):
        key = {
            "plate": path.name.removesuffix(".gcode.gz"),
            "limit_s": options.time_limit,
            "seed": 0,
        }
        wanted = not options.plates or key["plate"] in options.plates.split(",")
        if wanted and not rows.has(**key):
            rows.append(run(path, key, options.trials))
            print(rows.rows[-1], flush=True)
    said = setting(note=options.note, quality="none",
                   machine="dual-gantry", time_limit=f"{options.time_limit:g} s", seed=0,
                   timing_trials=options.trials)  # fmt: skip
    (RESULTS / "two_heads.md").write_text(report(rows.rows, said))


if __name__ == "__main__":
    main()
