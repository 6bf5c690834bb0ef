"""What looking at walls costs and brings in searches for time, where travels are left bare.

    python benchmarks/bare_travels.py [--files cura,simplify3d] [--steps 1000]

Each file of the corpus whose slicer leaves travels inside the part unretracted is searched
by `hybrid` with `--objective time`, `--steps` proposals a contour, twice: with travels
priced by length alone, and by the walls they cross. Writes docs/results/bare_travels.csv
(a row a file, resumable) and bare_travels.md.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from common import RESULTS, Rows, corpus, markdown, names, setting

from decmcts.errors import InputError
from decmcts.planning.events import unheard
from decmcts.planning.one_head.no_slower import draft_single
from decmcts.planning.options import NO_QUALITY, Objective
from decmcts.planning.problem.planned import check, document_of, source_plan
from decmcts.planning.problem.print_problem import load
from decmcts.print.metrics import Metrics
from decmcts.print.walls import no_walls
from decmcts.random_kernels import seeded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.planners import plan_order
from decmcts.search.sequence.anneal_kernels import anneal
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import OrderProblem, Pace
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.joint_plan import schedule

FILES = (
    "cura_5.3.1_marlin_lightning,cura_5.2.1_spool,cura_master_marlin_duet,"
    "cura_4.6.1_marlin_benchy,superslicer_2.3.56_klipper_arcs_crlf,simplify3d_4.1.2_relE,"
    "kisslicer_1.6.3_crlf"
)
PROPOSALS, REPEATS = 500_000, 3
SAID: Metrics = {"planner": "hybrid", "objective": "time", "freedom": "reversible", "seed": 0}
WARMTH = {"hot": 1.5, "cold": 0.05}  # of the mean travel, as planner `local` begins and ends


def by_length(*given: Any) -> Pace:
    """Return the pace of a search that does not look at walls."""
    return replace(pace_of(*given), walls=no_walls())


PRICES: dict[str, Callable[..., Pace]] = {"length": by_length, "walls": pace_of}


def nanoseconds(problem: OrderProblem) -> dict[str, float]:
    """Return the processor time of a proposal, the least of some runs each."""
    none = Incumbent(problem, clock=lambda: 0.0, stopping=Stopping(seconds=1.0))
    sliced = Sequence.best_of(none, near_ports(problem))
    tour, mean = cut(sliced, 0, len(problem)).tour, none.cost / len(problem)
    least: dict[str, float] = {}
    anneal(tour, seeded(0), mean, 1000)
    for name, share in WARMTH.items():
        took = []
        for seed in range(REPEATS):
            started = time.process_time()
            anneal(tour, seeded(seed), share * mean, PROPOSALS)
            took.append(time.process_time() - started)
        least[name] = round(min(took) / PROPOSALS * 1e9)
    return least


def attempt(path: Path, steps: int) -> dict[str, Any]:
    """Search a print by either price and write both files."""
    row: dict[str, Any] = {"file": path.name, "steps": steps}
    loaded = load(path, "paper", NO_QUALITY)
    own, n = source_plan(loaded), len(loaded.job.contours)
    plain = loaded.for_one_head(Objective.TRAVEL)
    row |= {f"{name}_travel_ns": ns for name, ns in nanoseconds(plain).items()}
    for price, pace in PRICES.items():
        timed = replace(plain, pace=pace(loaded.job, loaded.machine.limits))
        row |= {f"{name}_{price}_ns": ns for name, ns in nanoseconds(timed).items()}
        found = plan_order(timed, planner="hybrid", stopping=Stopping(iterations=steps * n), seed=0)
        plan = schedule(loaded.job, loaded.machine, loaded.graph, [found.toolpath])
        planned = check(loaded, own, document_of(loaded, plan, SAID), found.history, {}, unheard)
        with tempfile.TemporaryDirectory() as folder:
            made = draft_single(planned, Path(folder) / "draft.gcode", Path(folder) / "out.gcode")
        row |= {
            f"{price}_s": made.after_s,
            f"{price}_retractions": made.after["retractions"],
            "before_s": made.before_s,
            "before_retractions": made.before["retractions"],
            "contours": n,
        }
    return row


def table(rows: list[dict[str, str]]) -> str:
    """Return the rows as markdown."""
    lines = []
    for row in sorted(rows, key=lambda row: row["file"]):
        before = float(row["before_s"])
        made = [float(row[f"{price}_s"]) for price in PRICES]
        files = [f"{after:.0f} ({100 * (after / before - 1):+.2f} %)" for after in made]
        pulls = " → ".join(row[f"{name}_retractions"] for name in ("before", *PRICES))
        speed = [
            " / ".join(row[f"{name}_{price}_ns"] for price in ("travel", *PRICES))
            for name in WARMTH
        ]
        lines.append([row["file"], row["contours"], f"{before:.0f}", *files, pulls, *speed])
    head = ["file", "contours", "source s", "by length s", "by walls s",
            "retractions: source → length → walls",
            *(f"ns a proposal, {name}: travel / length / walls" for name in WARMTH)]  # fmt: skip
    return markdown(lines, head)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=names, default=names(FILES))
    parser.add_argument("--steps", type=int, default=1000, help="proposals a contour")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    rows = Rows(RESULTS / "bare_travels.csv", ("file", "steps"))
    for name in options.files:
        for path in sorted((corpus() / "gcode").glob(f"{name}*.gcode.gz")):
            if not rows.has(file=path.name, steps=options.steps):
                try:
                    rows.append(attempt(path, options.steps))
                except InputError as error:
                    print(error)
                    continue
                print(rows.rows[-1], flush=True)
    kept = [row for row in rows.rows if row["steps"] == str(options.steps)]
    said = setting(
        note=options.note, planner="hybrid", objective="time", machine="paper", quality="none",
        proposals=f"{options.steps} a contour", seed=0,
    )  # fmt: skip
    text = (
        f"# One price for bare travels\n\n{said}\n\nRepeat: `python benchmarks/bare_travels.py`. "
    )
    text += "Seconds are of whole files, retractions in them too. By length: a search for time as "
    text += "it was, which takes every travel from the source's least length up for retracted. "
    text += "By walls: as plan, times and writer decide. Nanoseconds are processor time of one "
    text += "proposal of annealing, hot as it begins and cold as it ends, the least of "
    text += f"{REPEATS} runs: in a search for travel, and in one for time by either price.\n\n"
    (RESULTS / "bare_travels.md").write_text(text + table(kept))


if __name__ == "__main__":
    main()
