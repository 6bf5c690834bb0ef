"""Written files of two heads run as controllers run them, on time and not, and spoilt plans.

    python benchmarks/simulated.py [--models NAME,…] [--machine dual-gantry] [--time-limit 10]
        [--trials 27] [--seeds 0]

Of each print: the simulated print time of plan and files beside the plan's, contacts under random
errors of time (`--trials` draws of each kind, up to 30 %) and under an adversary; and of five
spoilt plans how many the judge finds unsafe, and how many of these are seen to collide. Writes
docs/results/simulated.csv (resumable) and simulated.md.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import Rows, arguments, grouped, markdown, measured, median, run_missing, setting
from team_prints import plate_path

from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.simulate import Simulated, simulate
from sim.controllers.timing import Timing
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.mutants.catalogue import NotHereError
from tests.mutants.waits import (
    action_before,
    ends_to_points,
    one_wait_dropped,
    waits_dropped,
)

KEY = ("machine", "model", "limit_s", "trials", "seed")
FIGURES = ("contours", "planned_s", "plan_off", "files_off", "draws", "contacts", "least_rail_mm",
           "adversaries", "spoilt", "unsafe", "seen", "seconds", "error")  # fmt: skip
RANDOM = (Timing.UNIFORM, Timing.HEAVY_TAILS, Timing.DRIFT)
FOUND_BY = (Timing.NONE, Timing.ADVERSARIAL)  # of spoilt plans, in turn
SIZE = 0.3
SPOILT: tuple[Callable[..., None], ...] = (
    waits_dropped, one_wait_dropped, one_wait_dropped, ends_to_points, action_before,
)  # fmt: skip
UNSAFE = {FaultKind.HEAD_HEAD, FaultKind.RAIL}
PRINTS = "same_4_far,mix_4,mix_2,mix_6,mix_3,mix_1,mix_5,same_9,gf_baseplate,openbot_top_A"


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Launch a print, and run what was written."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = folder / "plan.json"
        options = ["--machine", key["machine"], "--seed", str(key["seed"])]
        outputs = ["-o", str(folder / "out"), "--plan", str(plan)]
        limit = ["--time-limit", str(key["limit_s"])]
        two = measured(["launch", str(plate_path(key["model"])), *options, *limit, *outputs])
        if two["exit"]:
            return {**key, **dict.fromkeys(FIGURES, ""), "error": two["error"]}
        files = sorted(folder.glob("out_*.gcode"))
        began = time.perf_counter()
        own = simulate([plan])
        seconds = time.perf_counter() - began
        drawn = [own, simulate([plan, *files])]
        drawn += [
            simulate([plan, *files], timing=timing, size=SIZE, trials=key["trials"])
            for timing in (*RANDOM, Timing.ADVERSARIAL)
        ]
        spoilt = _seen(plan)
    return {**key, **_figures(drawn), **spoilt,
            "seconds": round(seconds, 1), "error": ""}  # fmt: skip


def _figures(drawn: list[Simulated]) -> dict[str, Any]:
    own, files, *others = drawn
    planned = own.planned_s
    assert planned is not None and own.plan is not None
    trials = [trial for found in others for trial in found.simulation.trials[1:]]
    rail = min(near.rail_mm for trial in trials for near in trial.near)
    return {
        "contours": len(own.plan.contours),
        "planned_s": round(planned, 1),
        "plan_off": round(own.simulation.makespan_s / planned - 1.0, 5),
        "files_off": round(files.simulation.makespan_s / planned - 1.0, 5),
        "draws": len(trials),
        "contacts": sum(found.simulation.contacts for found in drawn),
        "least_rail_mm": round(rail, 3),
        "adversaries": len(others[-1].simulation.trials) - 1,
    }


def _seen(plan: Path) -> dict[str, int]:
    """Count spoilt plans, those in which the judge finds that heads may touch, those seen to."""
    found = {"spoilt": 0, "unsafe": 0, "seen": 0}
    for seed, spoil in enumerate(SPOILT):
        document = json.loads(plan.read_text())
        try:
            spoil(document, np.random.default_rng(seed))
        except NotHereError:
            continue
        path = plan.with_name("spoilt.json")
        path.write_text(json.dumps(document))
        found["spoilt"] += 1
        if UNSAFE & {fault.kind for fault in verify_plan(read_plan(path)).faults}:
            found["unsafe"] += 1
            found["seen"] += not all(simulate([path], timing=t).simulation.safe for t in FOUND_BY)
    return found


def report(rows: Rows, said: str) -> str:
    """Return the page."""
    text = f"# Prints of two heads, simulated\n\n{said}\n\nRepeat: `python "
    text += "benchmarks/simulated.py`. Plan, files: how much longer their simulated print time is "
    text += f"than planned. Draws: random errors of time up to {SIZE:.0%}, and adversaries. Rail: "
    text += "the least of what lay between heads beyond the rail's separation. Spoilt: plans whose "
    text += "waits are gone (all, or one of two), are for first points in place of ends, or for "
    text += "the action before. Of those in which `verify` finds that heads may touch (a single "
    text += "wait may be kept by others), seen are those that collide on time or under an "
    text += "adversary. Seconds: reading and running the plan once.\n\n"
    lines = [
        [
            model, f"{median(mine, 'contours'):.0f}", f"{median(mine, 'planned_s'):.0f}",
            f"{median(mine, 'plan_off'):+.2%}", f"{median(mine, 'files_off'):+.2%}",
            str(sum(int(r["draws"]) for r in mine)), str(sum(int(r["contacts"]) for r in mine)),
            f"{median(mine, 'least_rail_mm'):.3f}",
            str(sum(int(r["spoilt"]) for r in mine)),
            f"{sum(int(r['seen']) for r in mine)} of {sum(int(r['unsafe']) for r in mine)}",
            f"{median(mine, 'seconds'):.1f}",
        ]
        for (_, model), mine in grouped(rows.rows, "machine", "model").items()
    ]  # fmt: skip
    head = ["print", "contours", "planned s", "plan", "files", "draws", "contacts", "rail mm",
            "spoilt", "seen of unsafe", "s"]  # fmt: skip
    return text + markdown(lines, head) + rows.failures()


def main() -> None:
    parser = arguments(__doc__, time_limit=10.0, models=PRINTS)
    parser.add_argument("--machine", default="dual-gantry")
    parser.add_argument("--trials", type=int, default=27)
    options: argparse.Namespace = parser.parse_args()
    rows = Rows(options.results / "simulated.csv", KEY)
    always = options.time_limit, options.trials
    keys = [
        dict(zip(KEY, (options.machine, model, *always, seed), strict=True))
        for seed, model in product(options.seeds, options.models)
    ]
    if not options.table_only:
        run_missing(rows, keys, run)
    said = setting(note=options.note, time_limit=f"{options.time_limit:g} s")
    (options.results / "simulated.md").write_text(report(rows, said))


if __name__ == "__main__":
    main()
