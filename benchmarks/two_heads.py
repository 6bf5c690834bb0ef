"""Two heads on the eight large plates: makespan against one head and the bound.

    python benchmarks/two_heads.py [--time-limit 60] [--seeds 0,1,2] [--plates a,b]
    python benchmarks/two_heads.py --machine dueling-zero
    python benchmarks/two_heads.py --plates four_nuts,…   # also single parts of the corpus

Real processes over real zenoh sessions. Every plan is verified for every timing
its order allows, and replayed with timing errors of 0.5x to 2x on each action.
Writes docs/results/two_heads.csv (resumable) and two_heads.md.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from common import (
    RESULTS,
    Rows,
    grouped,
    markdown,
    measured,
    median,
    names,
    seeds,
    setting,
    spread,
)
from team_prints import PLATES, plate_path

KEY = ("machine", "plate", "limit_s", "seed")


def run(path: Path, key: dict[str, Any], trials: int) -> dict[str, Any]:
    """Plan for two heads, each a process, and replay the joint plan."""
    limit = ["--time-limit", str(key["limit_s"]), "--seed", str(key["seed"])]
    machine = ["--machine", key["machine"]]
    with tempfile.TemporaryDirectory() as folder:
        plan = f"{folder}/plan.json.gz"
        two = measured(["launch", str(path), *machine, *limit, "--no-quality", "--plan", plan])
        replay: dict[str, Any] = {"faults": ["not planned"]}
        if not two["exit"]:
            replay = measured(["verify", plan, "--source", str(path), "--trials", str(trials)])
    return {**key, **figures_of(path, key["machine"], two, replay)}


def figures_of(
    path: Path, machine: str, two: dict[str, Any], replay: dict[str, Any]
) -> dict[str, Any]:
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
        "whole_s": round(whole_bound(path, machine), 1),
        "over_whole": round(after["makespan_s"] / whole_bound(path, machine), 3),
        "messages": sum(agent["sent"] for agent in agents),
        "bytes": sum(agent["sent_bytes"] for agent in agents),
        "planner": after["planner"],
        "faults": len(replay.get("faults", [replay.get("error", "?")])),
        "plan_s": round(two["wall_s"], 1),
        "peak_mib": round(two["peak_mib"]),
        "error": "",
    }


@cache
def whole_bound(path: Path, name: str) -> float:
    """Return the bound for heads that hold a contour's whole room, without travel: W - M."""
    from decmcts.feasibility.rules import order_rules
    from decmcts.formats.gcode import read_gcode
    from decmcts.formats.machine_file import load_machine
    from decmcts.team.bound import makespan_bound

    machine = replace(load_machine(name), release="action")
    job, _ = read_gcode(path)
    machine = replace(machine, limits=machine.limits.under(job.limits))
    return makespan_bound(job, machine, order_rules(job, machine), travel=False).bound_s


FIGURES = ("contours", "one_head_s", "two_heads_s", "speedup", "bound_s", "over_bound",
           "whole_s", "over_whole", "messages", "bytes", "planner", "faults", "plan_s",
           "peak_mib", "error")  # fmt: skip


def of_prints(rows: list[dict[str, str]]) -> str:
    """Return a line for each print: medians and least and most over its seeds."""
    lines = []
    for (plate,), mine in grouped(rows, "plate").items():
        over = [float(r["over_whole"]) for r in mine]
        lines.append(
            [
                plate,
                mine[0]["contours"],
                str(len(mine)),
                f"{median(mine, 'one_head_s'):.0f}",
                f"{median(mine, 'two_heads_s'):.0f}",
                f"{median(mine, 'speedup'):.2f}×",
                f"{median(mine, 'bound_s'):.0f}",
                f"{median(mine, 'over_bound'):.3f}",
                f"{median(mine, 'whole_s'):.0f}",
                f"{median(mine, 'over_whole'):.3f} ({min(over):.3f} to {max(over):.3f})",
                f"{median(mine, 'messages'):.0f}",
                f"{median(mine, 'bytes') / 1024:.0f}",
                str(sum(int(r["faults"]) for r in mine)),
                f"{median(mine, 'plan_s'):.0f}",
            ]
        )
    head = ["print", "contours", "seeds", "one head s", "two heads s", "speed-up", "bound s",
            "makespan ÷ bound", "W−M s", "makespan ÷ (W−M)", "messages", "KiB",
            "faults in replay", "wall s"]  # fmt: skip
    return markdown(lines, head)


def report(rows: Rows, said: str) -> str:
    """Return the page: a table for each machine, plates and other prints apart."""
    text = f"# Two heads on large plates\n\n{said}\n\nRepeat: `python benchmarks/two_heads.py`. "
    text += "One head: the best order `local` finds in a third of the time (at most 10 s), for one "
    text += "such head that reaches everything, alone on the machine. Bound: proven for heads that "
    text += "give room back piece by piece, as here, with what they travel at least. W−M: the "
    text += "bound for heads that hold a contour's whole room to its end, without travel; heads as "
    text += "here may beat it. Messages and bytes: sent by both agents. Medians over seeds; in "
    text += "brackets least and most.\n"
    done = [r | {"of": "plates" if r["plate"] in PLATES else "single parts"} for r in rows.rows]
    for (machine, of), mine in grouped(done, "machine", "of").items():
        text += f"\n## `{machine}`, {of}\n\nMedian of the prints: makespan "
        text += f"{of_all(mine, 'over_bound')} times the bound, {of_all(mine, 'over_whole')} times "
        text += f"W−M, {of_all(mine, 'speedup')} times as fast as one head.\n\n{of_prints(mine)}"
    return text + rows.failures()


def of_all(rows: list[dict[str, str]], field: str) -> str:
    """Return the median over prints of the medians over their seeds, with quartiles."""
    return spread([median(mine, field) for mine in grouped(rows, "plate").values()], 2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--machine", default="dual-gantry")
    parser.add_argument("--plates", type=names, default=list(PLATES), help="NAME,NAME,…")
    parser.add_argument("--seeds", type=seeds, default=[0], help="SEED,SEED,…")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    rows = Rows(RESULTS / "two_heads.csv", KEY)
    for seed in options.seeds:
        for plate in options.plates:
            key = dict(zip(KEY, (options.machine, plate, options.time_limit, seed), strict=True))
            if not rows.has(**key):
                rows.append(run(plate_path(plate), key, options.trials))
                print(rows.rows[-1], flush=True)
    said = setting(note=options.note, quality="none", time_limit=f"{options.time_limit:g} s",
                   timing_trials=options.trials)  # fmt: skip
    (RESULTS / "two_heads.md").write_text(report(rows, said))


if __name__ == "__main__":
    main()
