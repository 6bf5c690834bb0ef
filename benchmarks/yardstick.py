"""`local` against published-style annealing figures: eleven models, fixed and reversible.

    python benchmarks/yardstick.py [--time-limit 60] [--models a,b]

The yardstick is plain simulated annealing on linear extensions with geometry
edges only (`--process-order free --no-quality`, machine `paper`); the default (`keep`) stands
beside it. Writes docs/results/yardstick.csv (resumable) and yardstick.md.
"""

from __future__ import annotations

import argparse

from common import RESULTS, Rows, corpus, markdown, setting
from models import KEY, run

YARDSTICK = {  # model: (fixed, reversible) reduction in per cent
    "stained_glass_3": (12, 33),
    "openbot_phone_mount": (20, 66),
    "pillars_5x5": (52, 58),
    "odri_spacers_6": (56, 59),
    "six_cylinders": (37, 48),
    "teaset_chess_7": (71, 73),
    "benchy_lowpoly": (48, 65),
    "spool_mount_4": (57, 77),
    "odri_pulleys_rollers_9": (61, 63),
    "gf_divided_cup": (60, 65),
    "tardis_drawer_4div": (62, 67),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--models", default=",".join(YARDSTICK))
    parser.add_argument("--process", default="free,keep")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    rows = Rows(RESULTS / "yardstick.csv", KEY)
    for process in options.process.split(","):
        for name in options.models.split(","):
            for freedom in ("fixed", "reversible"):
                key = dict(zip(KEY, (name, "paper", process, freedom, "local",
                                     options.time_limit, 0), strict=True))  # fmt: skip
                if not rows.has(**key):
                    path = corpus() / "models" / "gcode" / f"{name}.gcode.gz"
                    rows.append(run(path, key))
                    print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)
    shorter = [
        r
        for r in Rows(RESULTS / "models.csv", KEY).rows
        if (r["machine"], r["planner"], r["limit_s"]) == ("paper", "local", "5.0")
    ]
    found = {
        (r["model"], r["process"], r["freedom"]): r["less_percent"] for r in shorter + rows.rows
    }
    lines = []
    for name, targets in YARDSTICK.items():
        for freedom, target in zip(("fixed", "reversible"), targets, strict=True):
            free, keep = (found.get((name, p, freedom), "") for p in ("free", "keep"))
            reached = "" if free == "" else ("yes" if round(float(free)) >= target else "NO")
            lines.append([name, freedom, str(target), free, reached, keep])
    head = ["model", "freedom", "annealing %", "local, free %", "reached", "local, keep %"]
    said = setting(
        note=options.note or None,
        quality="none",
        planner="local",
        machine="paper",
        time_limit=f"{options.time_limit:g} s",
        seed=0,
    )
    text = f"# `local` against plain annealing\n\n{said}\n\n"
    text += "Repeat: `python benchmarks/yardstick.py`. Reduction of extrusionless travel "
    text += "against the source's order; the yardstick is known to whole per cent only. The "
    text += "default order `keep` stands beside it: from docs/results/models.csv (5 s) where "
    text += "`--process free,keep` was not run here.\n\n" + markdown(lines, head)
    (RESULTS / "yardstick.md").write_text(text)


if __name__ == "__main__":
    main()
