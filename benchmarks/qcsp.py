"""Bare team problems: `decmcts launch X.qcsp` against best known makespans and OR-Tools' CP-SAT.

    python benchmarks/qcsp.py --time-limit 60
    python benchmarks/qcsp.py --time-limit 20 --every 8   # a sample: each eighth instance
    python benchmarks/qcsp.py --stop-at-best-known --solvers decmcts  # cheap: all of them

Instances are the corpus' `qcsp` (Kim & Park 2004; Meisel & Bierwirth 2011). The
search is timed by its work (`cpu_time.py`); CP-SAT, with two workers, gets twice as
much processor time, its model not counted. What it finds is made a schedule with
ways and judged like ours. Needs
`pip install 'decmcts[benchmarks]'` for CP-SAT.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from common import CPU_TIME, RESULTS, Rows, corpus, markdown, measured, setting
from cpu_time import TARGET

from decmcts.formats.bare.qcsp import QcspProblem, QcspSchedule, read_qcsp
from decmcts.team.qcsp.paths import paths_of
from sim.qcsp import faults_of

KEY = ("instance", "solver", "time_limit_s", "seed", "until")
BEST_KNOWN = "best known"  # the run ended once it was reached


def instances(folder: Path) -> dict[str, dict[str, str]]:
    """Return instance -> row of best known values, in the order of the corpus."""
    with (folder / "best_known.csv").open(newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def with_decmcts(
    path: str, *, time_limit_s: float, seed: int, target: int | None
) -> dict[str, Any]:
    """Run the command line as a user would, the search timed by its work; end at a target."""
    environment = {} if target is None else {TARGET: str(target)}
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["launch", path, "-o", f"{folder}/out.json", "--seed", str(seed)]
        arguments += ["--time-limit", str(time_limit_s)]
        return measured(arguments, cpu_time=True, environment=environment)


def with_cp_sat(path: str, *, time_limit_s: float, seed: int, target: int | None) -> dict[str, Any]:
    """OR-Tools' CP-SAT: who does what, an order of each pair, temporal distances, two workers."""
    from ortools.sat.python import cp_model

    problem, started = read_qcsp(path), time.perf_counter()
    model = cp_model.CpModel()
    begin, does, makespan = _cp_sat_model(problem, model)
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 2
    solver.parameters.random_seed = seed
    with stopped_after(2 * time_limit_s, solver.stop_search):
        status = solver.solve(model, _ending_at(target))
    wall = {"wall_s": time.perf_counter() - started}
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return wall | {"error": "no schedule in this time"}
    crane = np.array([int(np.argmax([solver.value(x) for x in row])) for row in does], np.int32)
    times = np.array([solver.value(b) for b in begin], np.float64)
    paths, end = paths_of(problem, crane, times), float(solver.value(makespan))
    if faults := faults_of(problem, QcspSchedule(crane, times, paths, end)):
        return wall | {"error": faults[0]}
    bound = float(np.ceil(solver.best_objective_bound - 1e-6))
    return wall | {"makespan": end, "bound": bound, "optimal": status == cp_model.OPTIMAL}


def _ending_at(target: int | None) -> Any:
    """Return what CP-SAT tells of its solutions, and which ends it at a target."""
    from ortools.sat.python import cp_model

    class Ending(cp_model.CpSolverSolutionCallback):
        def on_solution_callback(self) -> None:
            if target is not None and self.objective_value <= target:
                self.stop_search()

    return Ending()


@contextmanager
def stopped_after(processor_s: float, stop: Callable[[], Any]) -> Iterator[None]:
    """Call `stop` once this process has taken so much more processor time."""
    ended, most = threading.Event(), time.process_time() + processor_s

    def watch() -> None:
        while not ended.wait(0.05):
            if time.process_time() > most:
                stop()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


def _cp_sat_model(problem: QcspProblem, model: Any) -> tuple[list[Any], list[list[Any]], Any]:
    """Fill `model`; return begins, who does what, and the makespan. Times are whole numbers."""
    n, q, travel = len(problem), problem.cranes, int(problem.travel)
    took, bay = problem.duration.astype(int).tolist(), problem.bay.tolist()
    horizon = sum(took) + travel * (n + q) * (max(bay) + problem.spacing * q)
    begin = [model.new_int_var(0, horizon, f"begin{j}") for j in range(n)]
    does = [[model.new_bool_var(f"does{j},{v}") for v in range(q)] for j in range(n)]
    makespan = model.new_int_var(0, horizon, "makespan")
    for j in range(n):
        model.add_exactly_one(does[j])
        model.add(makespan >= begin[j] + took[j])
        for v in range(q):
            way = abs(bay[j] - int(problem.start[v])) * travel
            model.add(begin[j] >= int(problem.ready[v]) + way).only_enforce_if(does[j][v])
    for i, j in problem.precedence.tolist():
        model.add(begin[j] >= begin[i] + took[i])
    for i, j in itertools.combinations(range(n), 2):
        first = model.new_bool_var(f"{i}<{j}")
        for v, w in itertools.product(range(q), range(q)):
            if (apart := distance(problem, i, v, j, w)) is None:
                continue
            both = [does[i][v], does[j][w]]
            model.add(begin[j] >= begin[i] + took[i] + apart).only_enforce_if([*both, first])
            model.add(begin[i] >= begin[j] + took[j] + apart).only_enforce_if([*both, ~first])
    model.minimize(makespan)
    return begin, does, makespan


def distance(problem: QcspProblem, i: int, v: int, j: int, w: int) -> int | None:
    """Return the temporal distance of task i by crane v and j by w, None where they may overlap."""
    bays, gap = int(problem.bay[j]) - int(problem.bay[i]), problem.spacing * abs(w - v)
    if v == w:
        return abs(bays) * int(problem.travel)
    near = gap - bays if v < w else gap + bays
    return near * int(problem.travel) if near > 0 else None


SOLVERS = {"decmcts": with_decmcts, "cp-sat": with_cp_sat}


def figures(result: dict[str, Any], row: dict[str, str]) -> dict[str, Any]:
    known, makespan = int(row["zbest"]), result.get("makespan", "")
    gap = "" if makespan == "" else round(100 * (makespan / known - 1), 4)
    told = {key: result.get(key, "") for key in ("bound", "optimal", "found_at_s", "error")}
    return {
        "set": row["set"],
        "tasks": row["n"],
        "cranes": row["q"],
        "best_known": known,
        "makespan": makespan,
        "gap_percent": gap,
        "wall_s": round(result["wall_s"], 2),
        **told,
    }


def summary(rows: list[dict[str, str]], known: dict[str, dict[str, str]]) -> str:
    """Return the table of mean and largest gaps, by set and by what was tuned on."""
    solvers = [name for name in SOLVERS if any(r["solver"] == name for r in rows)]
    tuned = set(list(known)[1::2])
    parts = {
        name: [r for r in rows if r["set"] == name] for name in sorted({r["set"] for r in rows})
    }
    parts["tuned on"] = [r for r in rows if r["instance"] in tuned]
    parts["not tuned on"] = [r for r in rows if r["instance"] not in tuned]
    parts["all"] = rows
    lines = []
    for name, mine in parts.items():
        line = [name]
        for solver in solvers:
            gaps = [
                float(r["gap_percent"]) for r in mine if r["solver"] == solver and r["makespan"]
            ]
            tried = sum(r["solver"] == solver for r in mine)
            none = f", {tried - len(gaps)} without a schedule" if len(gaps) < tried else ""
            line += (
                [f"{len(gaps)}{none}", f"{np.mean(gaps):.2f}", f"{max(gaps):.2f}"]
                if gaps
                else ([f"0{none}", "", ""])
            )
        lines.append(line)
    head = ["set"]
    for solver in solvers:
        head += [f"{solver}: instances", "mean gap %", "largest %"]
    return markdown(lines, head)


def instance_table(rows: list[dict[str, str]]) -> str:
    """Return a line an instance."""
    table: dict[str, dict[str, dict[str, str]]] = {}
    for row in rows:
        table.setdefault(row["instance"], {})[row["solver"]] = row
    lines = []
    for name, found in table.items():
        some, ours = next(iter(found.values())), found.get("decmcts")
        line = [name, some["tasks"], some["cranes"], some["best_known"]]
        for one in (ours, found.get("cp-sat")):
            line += [one["makespan"] or one["error"], one["gap_percent"]] if one else ["", ""]
        line += [ours["bound"], ours["found_at_s"][:5]] if ours else ["", ""]
        lines.append(line)
    head = ["instance", "tasks", "cranes", "best known", "decmcts", "gap %", "cp-sat", "gap %"]
    return markdown(lines, [*head, "our bound", "at s"])


def reached(rows: list[dict[str, str]]) -> str:
    """Return a sentence on how often, and how soon, the search reached the best known value."""
    ours = [r for r in rows if r["solver"] == "decmcts" and r["makespan"]]
    seconds = [float(r["found_at_s"]) for r in ours if float(r["gap_percent"]) <= 0.0]
    if not seconds:
        return f"decmcts reached the best known value in none of {len(ours)} runs."
    return (
        f"decmcts reached the best known value in {len(seconds)} of {len(ours)} runs, "
        f"{statistics.median(seconds):.1f} s after its begin in the median, "
        f"{max(seconds):.1f} s at most."
    )


def write_results(
    rows: list[dict[str, str]], known: dict[str, dict[str, str]], options: argparse.Namespace
) -> None:
    until = BEST_KNOWN if options.stop_at_best_known else ""
    rows = [
        r for r in rows if float(r["time_limit_s"]) == options.time_limit and r["until"] == until
    ]
    place = {name: k for k, name in enumerate(known)}
    rows.sort(key=lambda r: place[r["instance"]])
    said = setting(
        note=options.note, time_limit=f"{options.time_limit:g} s", until=until, seed=options.seed,
        seconds=f"of decmcts: {CPU_TIME}; CP-SAT: twice as many of its process, two workers",
    )  # fmt: skip
    repeat = f"python benchmarks/qcsp.py --time-limit {options.time_limit:g}"
    repeat += " --stop-at-best-known" if until else ""
    repeat += f" --every {options.every}" if options.every > 1 else ""
    repeat += f" --first {options.first}" if options.first else ""
    text = f"# Bare team problems\n\n{said}\n\nRepeat: `{repeat}`. "
    text += f"Makespans against the best known of {len(known)} published instances, "
    text += f"of which {len({r['instance'] for r in rows})} were run. Parameters of the search "
    text += "were chosen on every second instance (*tuned on*). All schedules were judged. "
    text += f"{reached(rows)}\n\n"
    text += f"{summary(rows, known)}\n## Instances\n\n{instance_table(rows)}"
    (RESULTS / "qcsp.md").write_text(text)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solvers", default=",".join(SOLVERS))
    parser.add_argument("--instances", default="", help="names; default: all")
    parser.add_argument("--every", type=int, default=1, help="of these only one in so many")
    parser.add_argument("--first", type=int, default=0, help="and that many left out before")
    parser.add_argument(
        "--stop-at-best-known", action="store_true", help="end a run once it gets there"
    )
    parser.add_argument("--table-only", action="store_true")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    folder = corpus() / "qcsp"
    known, rows = instances(folder), Rows(RESULTS / "qcsp.csv", KEY)
    chosen = options.instances.split(",") if options.instances else list(known)
    until = BEST_KNOWN if options.stop_at_best_known else ""
    for solver in [] if options.table_only else options.solvers.split(","):
        for name in chosen[options.first :: options.every]:
            values = (name, solver, options.time_limit, options.seed, until)
            key = dict(zip(KEY, values, strict=True))
            if rows.has(**key):
                continue
            result = SOLVERS[solver](
                f"{folder / 'instances.json.gz'}:{name}",
                time_limit_s=options.time_limit,
                seed=options.seed,
                target=int(known[name]["zbest"]) if until else None,
            )
            rows.append(key | figures(result, known[name]))
            print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)
    rows.read()
    write_results(rows.rows, known, options)


if __name__ == "__main__":
    main()
