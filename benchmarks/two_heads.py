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
    return {**key, **figures_of(two, replay)}


def figures_of(two: dict[str, Any], replay: dict[str, Any]) -> dict[str, Any]:
    if two["exit"]:
        return dict.fromkeys(FIGURES, "") | {"error": two["error"]}
    after = two["after"]
    alone = after["one_head_s"]
    possible = after["bound"]["speedup"]
    speedup = alone / after["makespan_s"]
    agents = after["agents"]
    return {
        "contours": after["contours"],
        "one_head_s": alone,
        "two_heads_s": after["makespan_s"],
        "speedup": round(speedup, 3),
        "possible": round(possible, 3),
        "of_possible": round(speedup / possible, 3),
        "of_gain": round((speedup - 1) / (possible - 1), 3) if possible > 1 else 1.0,
        "messages": sum(agent["sent"] for agent in agents),
        "bytes": sum(agent["sent_bytes"] for agent in agents),
        "planner": after["planner"],
        "faults": len(replay.get("faults", [replay.get("error", "?")])),
        "plan_s": round(two["wall_s"], 1),
        "peak_mib": round(two["peak_mib"]),
        "error": "",
    }


FIGURES = ("contours", "one_head_s", "two_heads_s", "speedup", "possible",
           "of_possible", "of_gain", "messages", "bytes", "planner", "faults", "plan_s",
           "peak_mib", "error")  # fmt: skip


def report(rows: list[dict[str, str]], said: str) -> str:
    head = ["plate", "contours", "one head s", "two heads s",
            "speed-up", "at most possible", "of the possible", "of the possible gain",
            "messages", "KiB", "faults in replay", "wall s"]  # fmt: skip
    done = [r for r in rows if not r["error"]]
    lines = [
        [r["plate"], r["contours"], f"{float(r['one_head_s']):.0f}"]
        + [f"{float(r['two_heads_s']):.0f}", f"{r['speedup']}×", f"{r['possible']}×"]
        + [f"{100 * float(r[k]):.0f} %" for k in ("of_possible", "of_gain")]
        + [r["messages"], f"{int(r['bytes']) / 1024:.0f}", r["faults"], r["plan_s"]]
        for r in done
    ]
    text = f"# Two heads on large plates\n\n{said}\n\nRepeat: `python benchmarks/two_heads.py`. "
    text += "One head: the best order `local` finds in a third of the time (at most 10 s), for one "
    text += "such head that reaches everything, alone on the machine. Possible: "
    text += "W/(W−M), the conflict-aware bound. Messages and bytes: sent by both agents.\n\n"
    if done:
        ratio = statistics.median(float(r["of_possible"]) for r in done)
        gain = statistics.median(float(r["of_gain"]) for r in done)
        text += f"Median: {100 * ratio:.0f} % of the possible speed-up factor, "
        text += f"{100 * gain:.0f} % of the possible gain (speed-up − 1).\n\n"
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
