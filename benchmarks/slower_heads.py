"""A head that is late: the rest planned anew, against going on by the old plan.

    python benchmarks/slower_heads.py [--models NAME,…] [--machine dual-gantry] [--time-limit 20]
        [--seeds 0] [--slower 1.2] [--moments 0.1,0.5]

Each print is launched. From the begin on its last head takes `--slower` times as long as planned.
Kept: the plan is carried out as it is, waits by what has happened. Replanned: at a moment, a share
of the planned time, heads end the bead they are at, and the rest is planned by the head's true
pace with `--time-limit`; heads begin again at their parks. Writes docs/results/slower_heads.csv
(resumable) and slower_heads.md.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

from common import Rows, arguments, grouped, markdown, measured, median, run_missing, setting
from team_prints import plate_path

from decmcts.experiments.stopped import ended_by, with_late_head
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.options import Cut, TeamSearch
from decmcts.planning.read import read
from decmcts.planning.replanning.replan import replan, rest_of, rules_of
from decmcts.print.print_state import state_of_heads
from sim.controllers.from_plan import programs_of_plan

KEY = ("machine", "model", "limit_s", "slower", "moment", "seed")
FIGURES = ("planned_s", "kept_s", "stopped_s", "rest_s", "error")
PRINTS = "same_4_far,mix_4,mix_2,gf_baseplate,openbot_top_A"


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Launch a print, slow its last head down, and compare going on with planning anew."""
    with tempfile.TemporaryDirectory() as name:
        plan, source = Path(name) / "plan.json", plate_path(key["model"])
        options = ["--machine", key["machine"], "--seed", str(key["seed"]), "--plan", str(plan)]
        limit = ["--time-limit", str(key["limit_s"])]
        made = measured(["launch", str(source), *options, *limit])
        if made["exit"]:
            return {**key, **dict.fromkeys(FIGURES, ""), "error": made["error"]}
        document = read_plan(plan)
    programs, last = programs_of_plan(document), len(document.plan.heads) - 1
    late, now = document.plan.heads[last].head, key["moment"] * document.plan.makespan_s
    happened = with_late_head(document, programs, last, key["slower"])
    heads, stopped_s = ended_by(document, programs, happened, now)
    state = state_of_heads(document, heads)
    rest = rest_of(
        document, read(source, document.machine), state, {}, slower={late: key["slower"]}
    )
    cut = Cut.NONE if document.rules is None else Cut(document.rules.cut)
    search = TeamSearch(key["limit_s"], key["seed"], cut=cut)
    found = replan(rest, search, rules_of(document), writes=False)
    return {
        **key,
        "planned_s": round(document.plan.makespan_s, 1),
        "kept_s": round(max(head.end_s for head in happened.heads), 1),
        "stopped_s": round(stopped_s, 1),
        "rest_s": round(found.document.plan.makespan_s, 1),
        "error": "",
    }


def report(rows: Rows, said: str) -> str:
    """Return the page."""
    text = f"# A head that is late\n\n{said}\n\nRepeat: `python benchmarks/slower_heads.py`. "
    text += "From the begin on the last head takes longer than planned. Kept: the plan is carried "
    text += "out all the same, heads wait for what has happened. Replanned: at a moment all heads "
    text += "end the bead they are at and go to their parks, and the rest is planned by the pace "
    text += "the head really has; what planning takes is not counted, as heads could print on "
    text += "meanwhile. Both are times of the whole print over the planned one.\n\n"
    lines = []
    for (_, model, slower, moment), mine in grouped(
        rows.rows, "machine", "model", "slower", "moment"
    ).items():
        planned, kept = median(mine, "planned_s"), median(mine, "kept_s")
        anew = median(mine, "stopped_s") + median(mine, "rest_s")
        lines.append(
            [model, slower, f"{float(moment):.0%}", f"{planned:.0f}", f"{kept / planned:.3f}",
             f"{anew / planned:.3f}", f"{1.0 - anew / kept:+.1%}"]
        )  # fmt: skip
    head = ["print", "times as long", "replanned at", "planned s", "kept", "replanned", "gain"]
    return text + markdown(lines, head) + rows.failures()


def main() -> None:
    parser = arguments(__doc__, time_limit=20.0, models=PRINTS)
    parser.add_argument("--machine", default="dual-gantry")
    parser.add_argument("--slower", default="1.2,1.5")
    parser.add_argument("--moments", default="0.1,0.5")
    options: argparse.Namespace = parser.parse_args()
    rows = Rows(options.results / "slower_heads.csv", KEY)
    factors, moments = (
        [float(v) for v in text.split(",")] for text in (options.slower, options.moments)
    )
    keys = [
        dict(zip(KEY, (options.machine, model, options.time_limit, *more, seed), strict=True))
        for seed, model, *more in product(options.seeds, options.models, factors, moments)
    ]
    if not options.table_only:
        run_missing(rows, keys, run)
    said = setting(note=options.note, time_limit=f"{options.time_limit:g} s")
    (options.results / "slower_heads.md").write_text(report(rows, said))


if __name__ == "__main__":
    main()
