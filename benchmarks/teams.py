"""Ours against every baseline for several heads, at equal processor time.

    python benchmarks/teams.py [--time-limit 120] [--seeds 0,1,2] [--heads 2,4,8]

Two heads (`dual-gantry`) print the corpus' eight plates; four and eight heads on a rail
print `wide`, 1200 mm of all eight (`team_prints.py`). Methods: Dec-MCTS as real processes
and in one process, and `team_baselines.py`. Makespans are those of the exact plans,
each judged for every timing its order allows. pyrobopath is left out: it schedules paths
with no rule for what must be printed before what lies on it or beside it, and without
heads at rest; the judge would refuse its plans.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Iterator
from typing import Any

from common import (
    Rows,
    arguments,
    grouped,
    markdown,
    names,
    run_missing,
    seeds,
    setting,
    spread,
)
from team_prints import PLATES
from team_run import METHODS, PROCESSES, in_own_process

KEY = ("plate", "heads", "method", "seed", "cpu_s")


def keys_of(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the runs, print after print."""
    for heads in options.heads:
        prints = options.models or (PLATES if heads == 2 else ["wide"])
        for plate in prints:
            for method in options.methods:
                for seed in options.seeds:
                    yield dict(
                        zip(KEY, (plate, heads, method, seed, options.time_limit), strict=True)
                    )


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Make one run; how the makespan fell is not kept here."""
    row = in_own_process(key)
    row.pop("history", None)
    return row


def of_heads(rows: list[dict[str, str]]) -> str:
    """Return a line for each method: against the bound, and against ours."""
    ours = medians([r for r in rows if r["method"] == PROCESSES])
    lines = []
    for (method,), mine in grouped(rows, "method").items():
        found = medians(mine)
        against = [found[plate] / ours[plate] for plate in found if plate in ours]
        lines.append(
            [
                method,
                str(len(found)),
                spread([float(r["over_bound"]) for r in mine], 3),
                spread(against, 3),
                f"{min(against):.3f}" if against else "",
                f"{statistics.median(float(r['spent_s']) for r in mine):.0f}",
                str(sum(int(r["faults"]) for r in mine)),
            ]
        )
    head = ["method", "prints", "makespan ÷ bound", "÷ ours", "least ÷ ours", "processor s",
            "faults"]  # fmt: skip
    return markdown(lines, head)


def medians(rows: list[dict[str, str]]) -> dict[str, float]:
    """Return print -> median makespan over its seeds."""
    return {
        plate: statistics.median(float(r["makespan_s"]) for r in mine)
        for (plate,), mine in grouped(rows, "plate").items()
    }


def of_prints(rows: list[dict[str, str]]) -> str:
    """Return a line for each print, number of heads and time: makespan ÷ bound of every method."""
    there = list(dict.fromkeys(r["method"] for r in rows))
    lines = []
    for (heads, cpu_s, plate), mine in grouped(rows, "heads", "cpu_s", "plate").items():
        over = {m: [float(r["over_bound"]) for r in mine if r["method"] == m] for m in there}
        said = [plate, heads, f"{float(cpu_s):g}", mine[0]["contours"]]
        said.append(f"{float(mine[0]['bound_s']):.0f}")
        lines.append([*said, *(spread(values, 3) for values in over.values())])
    return markdown(lines, ["print", "heads", "time s", "contours", "bound s", *there])


def report(rows: Rows, options: argparse.Namespace) -> str:
    """Return the page: all rows there are, whatever the time."""
    mine = [r for r in rows.rows if not r["error"]]
    there = sorted({int(r["seed"]) for r in mine})
    said = setting(note=options.note, seeds=" ".join(map(str, there)), quality="none")
    text = f"# Several heads against baselines\n\n{said}\n\n"
    text += "Repeat: `python benchmarks/teams.py --time-limit SECONDS --heads N --seeds "
    text += f"{','.join(map(str, there))}`. *Time*: processor time of a search. "
    text += "Medians, quartiles in brackets, over prints and seeds. "
    text += "*÷ ours*: makespans over those of real processes, medians over the seeds of each "
    text += "print; above 1 ours is ahead; *least*: on the print that is worst for ours. "
    text += "*Processor s*: what the search took; of `processes` what all agents took from start "
    text += "to end, reading the print included. *Faults*: of all plans, by the judge.\n"
    gone = sorted({r["method"] for r in mine} - set(METHODS))
    if gone:
        text += f"\nHistory: {', '.join(gone)} are planners that the program had before.\n"
    for (heads, cpu_s), group in grouped(mine, "heads", "cpu_s").items():
        text += f"\n## {heads} heads, {float(cpu_s):g} s\n\n{of_heads(group)}"
    text += f"\n## Makespan ÷ bound by print\n\n{of_prints(mine)}"
    return text + rows.failures()


def main() -> None:
    parser = arguments(__doc__, time_limit=120.0, models="")
    parser.add_argument("--heads", type=seeds, default=[2, 4, 8], help="N,N,…")
    parser.add_argument("--methods", type=names, default=list(METHODS), help="NAME,NAME,…")
    options = parser.parse_args()
    rows = Rows(options.results / "teams.csv", KEY)
    if not options.table_only:
        run_missing(rows, keys_of(options), run)
    rows.read()
    (options.results / "teams.md").write_text(report(rows, options))


if __name__ == "__main__":
    main()
