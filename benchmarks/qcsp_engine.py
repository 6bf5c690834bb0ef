"""How much later the engine of prints makes the order that the cranes' own kernel found.

    python benchmarks/qcsp_engine.py --find 400000 schedules.json  # makes that file
    python benchmarks/qcsp_engine.py schedules.json

Tasks become contours of no length at bays (x), cranes become heads on one rail that
accelerate at once. Compiling the engine takes about two minutes; makespans alone are
sooner had with NUMBA_DISABLE_JIT=1. Times are processor time, the call from Python counted.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common import corpus

from decmcts.formats.bare.qcsp import QcspProblem, read_qcsp
from decmcts.print.lags_kernels import no_lags
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.joint_kernels import NONE, Visits, all_parked, new_units
from decmcts.team.engine.replay_kernels import JointOrder, Marks, finish, link
from decmcts.team.engine.spaces_kernels import Fleet, Pieces
from decmcts.team.qcsp.solver import _threads_of, search_qcsp
from decmcts.team.qcsp.solver_kernels import decode, find_loads

NAMES = "KP_k_059,MBB_n50_003,MBE_d0.85_005,MBD_f0.2cl2_009,MBC_n80_007,MBF_q6_007"
AT_ONCE = 1e12  # acceleration
REPEATS = 20
FAR = 1000.0  # bays to either side that cranes may step aside


def visits_of(problem: QcspProblem) -> Visits:
    """Return tasks as contours without length."""
    n = len(problem)
    ends = np.zeros((n, 2, 3))
    ends[:, :, 0] = problem.bay[:, None]
    space = np.zeros((2 * n, 6))
    space[:, 0] = space[:, 1] = np.repeat(problem.bay, 2)
    pieces = Pieces(
        np.arange(2 * n + 1, dtype=np.int64), space, np.zeros(2 * n), np.zeros(2 * n, np.int32)
    )
    pairs = problem.precedence[np.argsort(problem.precedence[:, 1], kind="stable")]
    counts = np.bincount(pairs[:, 1], minlength=n)
    offsets = np.append(0, np.cumsum(counts)).astype(np.int64)
    preds = np.ascontiguousarray(pairs[:, 0], np.int32)
    still = np.zeros(n, np.bool_)
    return Visits(
        ends,
        np.tile(problem.duration, (problem.cranes, 1)),
        still,
        pieces,
        offsets,
        preds,
        no_lags(n),
    )


def fleet_of(problem: QcspProblem) -> Fleet:
    """Return cranes as heads on one rail; they must begin far enough apart."""
    q = problem.cranes
    rows, offsets = [], [0]
    for r in range(q):
        for s in range(q):
            if r != s:
                half = np.tile([-np.inf, np.inf], 3)
                half[1 if s > r else 0] = (s - r) * problem.spacing
                rows.append(half)
            offsets.append(len(rows))
    parks, low, high = np.zeros((q, 3)), np.zeros((q, 2)), np.zeros((q, 2))
    parks[:, 0], low[:, 0], high[:, 0] = problem.start, -FAR, FAR
    travel = np.tile([1.0 / problem.travel, AT_ONCE, 1.0, AT_ONCE, 0.0, np.inf], (q, 1))
    relation = np.array(rows).reshape(-1, 6)
    return Fleet(relation, np.array(offsets, np.int64), parks, low, high, travel, 0.0, 0.0, True)


def by_engine(
    problem: QcspProblem, order: list[int], crane: list[int]
) -> tuple[float, float]:  # fmt: skip
    """Return the end of the last task when the engine of prints carries the order out, and µs."""
    n, q = len(problem), problem.cranes
    visits, fleet = visits_of(problem), fleet_of(problem)
    joint = JointOrder(
        np.array(order, np.int64), np.empty(n, np.int64), np.array(crane, np.int64),
        np.zeros(n, np.bool_), np.empty(n, np.int64), np.empty(n, np.int64),
    )  # fmt: skip
    link(joint, q)
    heads, units = all_parked(n, fleet), new_units(8 * n + 64 * q * (q + 2))
    marks = Marks(
        np.zeros(n + 1, np.int64), np.full((n + 1, q), NONE), np.zeros((n + 1, q)),
        np.empty((n + 1, q, 3)), np.empty((n + 1, q, 6)), np.zeros(1, np.int64),
        np.full((n + 1, q, q), NONE), np.zeros((n + 1, q)),
    )  # fmt: skip
    marks.at[0], marks.rest[0] = heads.at, heads.rest
    spent = microseconds(lambda: finish(0, joint, visits, fleet, units, heads, marks))
    return float(heads.ended.max()), spent


def by_own_kernel(problem: QcspProblem, order: list[int], crane: list[int]) -> float:
    """Return the µs that the cranes' own kernel takes to time the order."""
    thread = next(iter(_threads_of(problem, 0)))
    thread.schedule.order[:], thread.schedule.crane[:] = order, crane
    return microseconds(
        lambda: (
            find_loads(thread.problem, thread.schedule),
            decode(thread.problem, thread.schedule, np.inf),
        )
    )


def microseconds(call: Callable[[], object]) -> float:
    """Return the processor time of a call that was made before."""
    call()
    began = time.process_time()
    for _ in range(REPEATS):
        call()
    return 1e6 * (time.process_time() - began) / REPEATS


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, help="orders by instance, JSON")
    parser.add_argument("--find", type=int, default=0, help="find them with so many proposals")
    options = parser.parse_args()
    folder = corpus() / "qcsp" / "instances.json.gz"
    if options.find:
        found = {}
        for name in NAMES.split(","):
            problem, stopping = read_qcsp(f"{folder}:{name}"), Stopping(iterations=options.find)
            schedule = search_qcsp(problem, stopping=stopping).schedule
            order = np.lexsort((schedule.crane, schedule.begin)).tolist()
            found[name] = {
                "order": order, "crane": schedule.crane.tolist(), "makespan": schedule.makespan,
            }  # fmt: skip
        options.file.write_text(json.dumps(found))
        return
    for name, one in json.loads(options.file.read_text()).items():
        task = read_qcsp(f"{folder}:{name}"), one["order"], one["crane"]
        (end, spent), own = by_engine(*task), by_own_kernel(*task)
        more = 100.0 * (end / one["makespan"] - 1.0)
        print(
            f"{name}: {one['makespan']:g} of its own, {own:.0f} µs; {end:.6g} by the engine, "
            f"{more:+.2f} %, {spent:.0f} µs"
        )


if __name__ == "__main__":
    main()
