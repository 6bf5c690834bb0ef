"""Bare sequential ordering problems against best known values, OR-Tools beside us.

    python benchmarks/sop.py [--time-limit 60] [--solvers decmcts,routing,cp-sat] [--instances a,b]

Instances: TSPLIB and SOPLIB2006, and two print-like ones whose values to beat
were found by LKH-3. OR-Tools (`pip install "decmcts[benchmarks]"`) gets the same
time: its routing solver (guided local search, one thread) and CP-SAT (both
cores). Writes docs/results/sop.csv (resumable: one row a run), sop.md and sop.png.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import CPU_TIME, RESULTS, Rows, corpus, markdown, measured, setting

from decmcts.formats.bare.sop import SopInstance, read_sop
from decmcts.search.sop.precedence import Precedence

KEY = ("instance", "solver", "time_limit_s", "seed")
LKH3 = {"prt300": 287996, "prt1000b": 521201}  # 60 s, from the corpus' README
LEAST_FOR_PERCENT = 50  # below, per cent say nothing
SETS = {"TSPLIB": 0.5, "SOPLIB": 2.0, "print-like": 0.0}  # mean gap wanted, %


def set_of(name: str) -> str:
    return "SOPLIB" if name.startswith("R.") else "print-like" if name in LKH3 else "TSPLIB"


def best_known(folder: Path) -> dict[str, int]:
    with (folder / "best_known.csv").open(newline="") as file:
        known = {row["instance"]: int(row["best_known"]) for row in csv.DictReader(file)}
    return known | LKH3


def with_decmcts(path: Path, *, time_limit_s: float, seed: int) -> dict[str, Any]:
    """Run the command line as a user would, the search timed by its work."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["plan", str(path), "-o", f"{folder}/out.tour", "--seed", str(seed)]
        return measured([*arguments, "--time-limit", str(time_limit_s)], cpu_time=True)


def with_routing(path: Path, *, time_limit_s: float, seed: int) -> dict[str, Any]:
    """OR-Tools' routing solver: one vehicle, a counter dimension for the precedence.

    It finds no first sequence itself where precedence is dense, so it gets one.
    """
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    instance = read_sop(path)
    n, started = len(instance), time.perf_counter()
    numbered = Precedence.of(n, instance.precedence)
    first, last = int(numbered.original[0]), int(numbered.original[-1])
    manager = pywrapcp.RoutingIndexManager(n, 1, [first], [last])
    routing = pywrapcp.RoutingModel(manager)
    costs = instance.costs.astype(np.int64).tolist()
    routing.SetArcCostEvaluatorOfAllVehicles(routing.RegisterTransitMatrix(costs))
    routing.AddConstantDimension(1, n, True, "place")
    place, solver = routing.GetDimensionOrDie("place"), routing.solver()
    for a, b in numbered.original[numbered.pairs].tolist():
        if a != first and b != last:
            earlier, later = (place.CumulVar(manager.NodeToIndex(x)) for x in (a, b))
            solver.Add(earlier < later)
    options = pywrapcp.DefaultRoutingSearchParameters()
    options.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    options.local_search_metaheuristic = (
        routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    )
    options.time_limit.FromMilliseconds(int(1000 * time_limit_s))
    routing.CloseModelWithParameters(options)
    start = routing.ReadAssignmentFromRoutes([nearest_ready(instance, numbered)[1:-1]], True)
    found = routing.SolveFromAssignmentWithParameters(start, options)
    if found is None:
        return {"wall_s": time.perf_counter() - started, "error": "no sequence in this time"}
    order, at = [], routing.Start(0)
    while not routing.IsEnd(at):
        order.append(manager.IndexToNode(at))
        at = found.Value(routing.NextVar(at))
    order.append(manager.IndexToNode(at))
    return judged(instance, order) | {"wall_s": time.perf_counter() - started}


def with_cp_sat(path: Path, *, time_limit_s: float, seed: int) -> dict[str, Any]:
    """OR-Tools' CP-SAT: a circuit, places in the sequence, two workers, a first sequence."""
    from ortools.sat.python import cp_model

    instance = read_sop(path)
    n, started = len(instance), time.perf_counter()
    numbered, model = Precedence.of(n, instance.precedence), cp_model.CpModel()
    node = numbered.original
    place = [model.new_int_var(0, n - 1, f"place{a}") for a in range(n)]
    arcs, terms = [(n - 1, 0, model.new_constant(1))], []
    for a, b in np.argwhere(numbered.possible).tolist():
        taken = model.new_bool_var(f"{a}-{b}")
        arcs.append((a, b, taken))
        terms.append(int(instance.costs[node[a], node[b]]) * taken)
        model.add(place[b] == place[a] + 1).only_enforce_if(taken)
    model.add_circuit(arcs)
    for a, b in numbered.pairs.tolist():
        model.add(place[a] < place[b])
    model.minimize(sum(terms))
    rank = np.argsort(nearest_ready(instance, numbered))
    for a in range(n):
        model.add_hint(place[a], int(rank[node[a]]))
    for a, b, taken in arcs[1:]:
        model.add_hint(taken, bool(rank[node[b]] == rank[node[a]] + 1))
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = max(time_limit_s - (time.perf_counter() - started), 0.1)
    solver.parameters.num_workers = 2
    solver.parameters.random_seed = seed
    status = solver.solve(model)
    wall = {"wall_s": time.perf_counter() - started}
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return wall | {"error": "no sequence in this time"}
    order = node[np.argsort([solver.value(p) for p in place])].tolist()
    return judged(instance, order) | wall | {"optimal": status == cp_model.OPTIMAL}


def nearest_ready(instance: SopInstance, numbered: Precedence) -> list[int]:
    """Return the sequence that always takes the cheapest of the nodes that may come next."""
    missing, node = numbered.direct.sum(axis=0), numbered.original
    costs, order = instance.costs[np.ix_(node, node)], [0]
    missing[0] = -1
    for _ in range(len(node) - 1):
        missing[numbered.direct[order[-1]]] -= 1
        ready = np.flatnonzero(missing == 0)
        order.append(int(ready[np.argmin(costs[order[-1], ready])]))
        missing[order[-1]] = -1
    return [int(at) for at in node[order]]


def judged(instance: SopInstance, order: list[int]) -> dict[str, Any]:
    """Return the cost of a sequence, or what is wrong with it."""
    position = np.argsort(order)
    if sorted(order) != list(range(len(instance))):
        return {"error": "not every node once"}
    if (position[instance.precedence[:, 0]] > position[instance.precedence[:, 1]]).any():
        return {"error": "breaks the precedence"}
    return {"cost": float(instance.costs[order[:-1], order[1:]].sum())}


SOLVERS = {"decmcts": with_decmcts, "routing": with_routing, "cp-sat": with_cp_sat}


def figures(result: dict[str, Any], known: int) -> dict[str, Any]:
    cost = result.get("cost", "")
    return {
        "best_known": known,
        "cost": cost,
        "gap_percent": "" if cost == "" else round(100 * (cost / known - 1), 4),
        "bound": result.get("bound", ""),
        "optimal": result.get("optimal", ""),
        "found_by": result.get("found_by", ""),
        "found_at_s": result.get("found_at_s", ""),
        "wall_s": round(result["wall_s"], 2),
        "error": result.get("error", ""),
    }


def by_instance(rows: list[dict[str, str]]) -> dict[str, dict[str, dict[str, str]]]:
    """Return instance -> solver -> row, instances in order of set and name."""
    table: dict[str, dict[str, dict[str, str]]] = {}
    for row in sorted(rows, key=lambda r: (list(SETS).index(set_of(r["instance"])), r["instance"])):
        table.setdefault(row["instance"], {})[row["solver"]] = row
    return table


def mean_gaps(rows: list[dict[str, str]], solvers: list[str]) -> list[list[str]]:
    """Return one line a set: the mean gaps, where the best known value is large enough."""
    lines = []
    for name, wanted in SETS.items():
        line = [name, f"{wanted:g}"]
        for solver in solvers:
            mine = [r for r in rows if r["solver"] == solver and set_of(r["instance"]) == name]
            mine = [r for r in mine if int(r["best_known"]) >= LEAST_FOR_PERCENT]
            gaps = [float(r["gap_percent"]) for r in mine if r["gap_percent"]]
            without = (
                f", {len(mine) - len(gaps)} without a sequence" if len(gaps) < len(mine) else ""
            )
            line.append(f"{np.mean(gaps):.2f} ({len(gaps)}{without})" if gaps else "")
        lines.append(line)
    return lines


def instance_table(rows: list[dict[str, str]], solvers: list[str]) -> str:
    lines = []
    for name, found in by_instance(rows).items():
        known = next(iter(found.values()))["best_known"]
        line = [name, known]
        for solver in solvers:
            row = found.get(solver)
            cost = (
                f"{float(row['cost']):.0f}" if row and row["cost"] else (row or {}).get("error", "")
            )
            line += [cost, f"{float(row['gap_percent']):.2f}" if row and row["gap_percent"] else ""]
        ours = found.get("decmcts", {})
        line += ["yes" if ours.get("optimal") == "True" else ours.get("bound", "")]
        line += [ours.get("found_by", ""), ours.get("found_at_s", "")[:5]]
        lines.append(line)
    head = ["instance", "best known"]
    for solver in solvers:
        head += [solver, "gap %"]
    return markdown(lines, [*head, "proven optimal, or bound", "found by", "at s"])


def plot(rows: list[dict[str, str]], solvers: list[str], path: Path) -> None:
    import matplotlib.pyplot as plt

    table = by_instance(rows)
    figure, axis = plt.subplots(figsize=(13, 5), layout="constrained")
    for k, solver in enumerate(solvers):
        places = [x for x, found in enumerate(table.values()) if found.get(solver, {}).get("cost")]
        gaps = [float(list(table.values())[x][solver]["gap_percent"]) for x in places]
        axis.plot(np.array(places) + 0.15 * k, gaps, "os^"[k], label=solver, markersize=5)
    axis.set_yscale("symlog", linthresh=0.1)
    axis.set(ylabel="above best known, %", xlim=(-1, len(table)))
    axis.set_xticks(range(len(table)), list(table), rotation=90)
    axis.grid(alpha=0.3)
    axis.legend()
    figure.savefig(path, dpi=110)


def write_results(rows: list[dict[str, str]], options: argparse.Namespace) -> None:
    rows = [r for r in rows if float(r["time_limit_s"]) == options.time_limit]
    solvers = [name for name in SOLVERS if any(r["solver"] == name for r in rows)]
    said = setting(
        note=options.note, time_limit=f"{options.time_limit:g} s", seed=options.seed,
        seconds=f"of decmcts: {CPU_TIME}",
    )  # fmt: skip
    text = f"# Sequential ordering problems\n\n{said}\n\n"
    text += f"Repeat: `python benchmarks/sop.py --time-limit {options.time_limit:g}`. "
    text += "Costs against the best known values of the literature (print-like: LKH-3's, 60 s); "
    text += "`routing` (one thread) and `cp-sat` (two) are OR-Tools'.\n\n## Mean gaps, %\n\n"
    text += f"Instances with a best known value of {LEAST_FOR_PERCENT} or more; how many in "
    text += "brackets.\n\n" + markdown(mean_gaps(rows, solvers), ["set", "wanted", *solvers])
    text += "\n![gaps](sop.png)\n\n## Instances\n\n" + instance_table(rows, solvers)
    (RESULTS / "sop.md").write_text(text)
    plot(rows, solvers, RESULTS / "sop.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solvers", default=",".join(SOLVERS))
    parser.add_argument("--instances", default="", help="names; default: all")
    parser.add_argument("--table-only", action="store_true")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    folder = corpus() / "sop"
    known, rows = best_known(folder), Rows(RESULTS / "sop.csv", KEY)
    chosen = options.instances.split(",") if options.instances else sorted(known)
    for solver in [] if options.table_only else options.solvers.split(","):
        for name in chosen:
            key = dict(zip(KEY, (name, solver, options.time_limit, options.seed), strict=True))
            if not rows.has(**key):
                path = folder / f"{name}.sop.gz"
                result = SOLVERS[solver](path, time_limit_s=options.time_limit, seed=options.seed)
                rows.append(key | figures(result, known[name]))
                print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)
    rows.read()
    write_results(rows.rows, options)


if __name__ == "__main__":
    main()
