"""Random and hostile plans over all presets and machines made at random, judged by `sim`.

    python benchmarks/random_teams.py [--machines 100] [--plans 92] [--presets 9]

Machines: 100 of two to eight heads, on rails along x or y, on two rails, in a row or
around the bed, each with shapes, reaches and tools of its own (seeds are passed over where
heads can not print all of their print, or only one can print any), and every preset: those
of several heads with as many plans, the others with `--presets`. A print of eight small
towers for each. Kinds of plans: `tests.makers.random_teams.KINDS` in turn, then mixed
from head to head. A plan is *serial* if no two heads ever print at once though it does not
ask for one order and in another plan of the machine two heads do. One row a machine.
"""

from __future__ import annotations

import re
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import Rows, arguments, grouped, markdown, run_missing, setting

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine, preset_names
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.engine.problem import TeamProblem
from tests.makers.random_teams import KINDS, outcome, problem_of, problem_on, random_plans

KEY = ("machine", "plans")
MOST_SEEDS = 50  # of prints for a preset until one fits it
ASKED = ("one order", "bad order", "mixed")  # kinds that may ask for one order


def problem_named(name: str) -> TeamProblem:
    """Return the problem of a machine: `random SEED` or a preset with the first print it takes."""
    word, _, seed = name.partition(" ")
    if word == "random":
        return problem_of(int(seed))
    machine = load_machine(name)
    for k in range(MOST_SEEDS):
        try:
            return problem_on(machine, k)
        except InputError:
            continue
    raise InputError(f"no print of {MOST_SEEDS} fits machine {name}")


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Judge the plans of one machine."""
    began = time.process_time()
    try:
        problem = problem_named(key["machine"])
    except InputError as error:
        return key | {"error": error.what}
    rng = np.random.default_rng([crc32(key["machine"].encode()), 3])
    faults, alone, shared, makespan = [], Counter[str](), 0, []
    for k in range(key["plans"]):
        kind = (*KINDS, "mixed")[k % (len(KINDS) + 1)]
        found = outcome(problem, random_plans(problem, rng, kind))
        if found.fault or found.plan is None:
            faults.append(f"{kind} {k}: {found.fault}")
            continue
        shared += found.shared_s > 0.0
        alone[kind] += kind not in ASKED and found.shared_s == 0.0
        makespan.append(found.plan.makespan_s)
    machine = problem.machine
    bound = makespan_bound(problem.job, machine, problem.graph).bound_s
    if min(makespan, default=bound) < bound:
        faults.append(f"a plan of {min(makespan):.3f} s beats the bound of {bound:.3f} s")
    return key | {
        "kind": machine.name.partition("(")[2].rstrip(")") or "preset",
        "heads": len(machine.heads),
        "rails": len(machine.rails),
        "release": machine.release,
        "accepted": key["plans"] - len(faults),
        "fault": "; ".join(faults)[:300],
        "shares": int(shared > 0),
        "serial": alone.total() if shared else 0,
        "serial_kinds": told(alone) if shared else "",
        "bound_s": round(bound, 1),
        "best_s": round(min(makespan, default=0.0), 1),
        "worst_s": round(max(makespan, default=0.0), 1),
        "cpu_s": round(time.process_time() - began, 1),
        "error": "",
    }


def told(kinds: Counter[str]) -> str:
    """Return how many of each kind there are: `2 stated, 1 shuffled`."""
    return ", ".join(f"{count} {kind}" for kind, count in kinds.most_common() if count)


def machines_of(count: int) -> Iterator[str]:
    """Yield machines made at random whose heads can print all of their print, two of them some."""
    seed = 0
    while count:
        with suppress(InputError):
            if problem_of(seed).space.eligible.any(axis=0).sum() > 1:
                yield f"random {seed}"
                count -= 1
        seed += 1


def keys_of(machines: int, plans: int, presets: int) -> Iterator[dict[str, Any]]:
    """Yield the runs: presets, then machines made at random."""
    for name in preset_names():
        heads = len(load_machine(name).heads)
        yield {"machine": name, "plans": plans if heads > 1 else presets}
    for name in machines_of(machines):
        yield {"machine": name, "plans": plans}


def report(rows: list[dict[str, str]], options: str, said: str) -> str:
    """Return the page."""
    fine = [row for row in rows if not row["error"]]
    text = f"# Random and hostile plans\n\n{said}\n\n"
    text += f"Repeat: `python benchmarks/random_teams.py{options}`. Plans that are sensible, "
    text += "shuffled, everything for each head, nonsense, none, one order for all, an order that "
    text += "breaks the precedence, a stated order (of who prints what) and mixed from head to "
    text += "head. Each resolves to a joint order, is scheduled and judged by `sim`, nominal, at "
    text += "random and adversarial times. Serial: no two heads ever print at once, though nobody "
    text += "asked for one order and others of the machine's plans have two heads print at once. "
    text += "Machines that share: two heads print at once in some plan. A plan faster than the "
    text += "proven bound is a fault.\n\n"
    plans = sum(int(row["plans"]) for row in fine)
    bad = plans - sum(int(row["accepted"]) for row in fine)
    serial = sum(int(row["serial"]) for row in fine)
    cpu = sum(float(row["cpu_s"]) for row in fine) / 60.0
    text += f"**{plans} plans on {len(fine)} machines: {bad} not accepted, {serial} serial**; "
    text += f"{cpu:.0f} minutes of processor time.\n\n"
    text += serial_said(fine)
    groups = sorted(grouped(rows, "kind", "heads").items(), key=lambda g: (g[0][0], int(g[0][1])))
    head = ["machines", "heads", "machines tried", "that share", "plans", "accepted", "serial",
            "slowest ÷ fastest plan, most", "fastest plan ÷ bound, least"]  # fmt: skip
    text += markdown([line(key, group) for key, group in groups], head)
    return text + "".join(f"- {r['machine']}: {r['fault']}\n" for r in fine if r["fault"])


def serial_said(rows: list[dict[str, str]]) -> str:
    """Return which kinds of plans were serial, and on which machines; nothing if none was."""
    kinds, machines = Counter[str](), []
    for row in rows:
        if int(row["serial"]):
            machines.append(row["machine"])
            for count, kind in re.findall(r"(\d+) ([^,]+)", row.get("serial_kinds") or ""):
                kinds[kind] += int(count)
    return f"Serial: {told(kinds)}; on {', '.join(machines)}.\n\n" if machines else ""


def line(key: tuple[str, ...], group: list[dict[str, str]]) -> list[str]:
    """Return one line of the table."""
    total = [
        str(sum(int(row[name]) for row in group))
        for name in ("shares", "plans", "accepted", "serial")
    ]
    worst = max(float(row["worst_s"]) / max(float(row["best_s"]), 1e-9) for row in group)
    least = min(float(row["best_s"]) / max(float(row["bound_s"]), 1e-9) for row in group)
    return [*key, str(len(group)), *total, f"{worst:.1f}", f"{least:.3f}"]


def main() -> None:
    """Make the runs that are missing, then the page."""
    parser = arguments(__doc__, time_limit=0.0, models="")
    parser.add_argument("--machines", type=int, default=100, help="made at random")
    parser.add_argument("--plans", type=int, default=92, help="for each machine of several heads")
    parser.add_argument("--presets", type=int, default=9, help="plans for each preset of one head")
    options = parser.parse_args()
    rows = Rows(options.results / "random_teams.csv", KEY)
    if not options.table_only:
        run_missing(rows, keys_of(options.machines, options.plans, options.presets), run)
    said = setting(trials="1 random timing a plan", note=options.note)
    given = {"machines": (options.machines, 100), "plans": (options.plans, 92)}
    changed = "".join(f" --{name} {now}" for name, (now, usual) in given.items() if now != usual)
    (options.results / "random_teams.md").write_text(report(rows.rows, changed, said))


if __name__ == "__main__":
    main()
