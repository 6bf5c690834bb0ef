"""Whatever stands in a plan, the judge answers in one line and within a gigabyte more.

The plans are judged in a process of their own, whose address space is limited to what
the honest plan took and 1 GiB.
"""

from __future__ import annotations

import copy
import json
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.formats.plans.plan_json import write_plan
from decmcts.planning.verify import digest_of
from sim.verify import verify_plan

ROOM = 2**30
CPU_S = 240  # of all mutants together
COUNT = 30
ODD = (
    None, True, -1, 0, 1, 1e-300, -0.5, 2**31, 2**63, 10**4000, 1e308, 9999.0, -9999.0, 1e5, 1e7,
    "", "x" * 10**5, "\ud800", [], [[]], {}, {"a": 1}, [1, "a"], [None], [[[[[[]]]]]], [0] * 10**5,
)  # fmt: skip


def places(value: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a nested value."""
    keys = list(value) if isinstance(value, dict) else range(len(value))
    own = [(value, key) for key in keys]
    deeper = [p for _, k in own if isinstance(value[k], dict | list) for p in places(value[k])]
    return own + deeper


def spoil(plan: Any, rng: np.random.Generator) -> None:
    """Change a place or several: another value, twice, left out, or exchanged; changes `plan`."""
    for _ in range(int(rng.integers(1, 4))):
        spots = places(plan)
        container, key = spots[int(rng.integers(len(spots)))]
        kind = int(rng.integers(4))
        if kind == 0:
            del container[key]
        elif kind == 1 and isinstance(container, list):
            container.insert(key, copy.deepcopy(container[key]))
        elif kind == 2 and isinstance(container[key], int | float):
            container[key] = container[key] * float(10.0 ** rng.integers(-9, 5))
        else:
            container[key] = ODD[int(rng.integers(len(ODD)))]


def main(good: Path, seed: int, count: int) -> None:
    """Judge the good plan, then `count` spoilt ones; prints the exit code of each."""
    assert run(["verify", str(good)]) == 0
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + ROOM, size + ROOM))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    plan, rng = json.loads(good.read_text()), np.random.default_rng(seed)
    spoilt = good.with_name("spoilt.json")
    for number in range(count):
        one = copy.deepcopy(plan)
        spoil(one, rng)
        spoilt.write_text(json.dumps(one))
        code = run(["verify", str(spoilt)])
        if code not in (0, 1, 2):
            spoilt.rename(good.with_name(f"crash{number}.json"))
        print("code", code, flush=True)


@pytest.mark.slow
@pytest.mark.parametrize("heads", [1, 2])
def test_spoilt_plans_are_faulted_or_refused(make, tmp_path, heads):
    """No crash (70), no killed process, and one line for each that is refused."""
    good = tmp_path / "good.json"
    document = make.tower_plan() if heads == 1 else make.two_head_plan()
    write_plan(replace(document, problem=digest_of(document)), good)
    done = subprocess.run(
        [sys.executable, __file__, str(good), str(heads), str(COUNT)],
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    codes = [int(line.split()[1]) for line in done.stdout.splitlines() if line[:5] == "code "]
    assert (done.returncode, len(codes)) == (0, COUNT), done.stderr[-2000:]
    assert set(codes) <= {0, 1, 2}, done.stderr[-2000:]
    assert codes.count(2) > 0.4 * COUNT
    assert done.stderr.count("decmcts: ") == codes.count(2)


@pytest.mark.slow
def test_a_print_of_kilometres_of_beads_is_judged_in_little_memory(make, tmp_path):
    """Beads from corner to corner of the largest area there is, and a bed as large."""
    document = make.tower_plan(layers=3)
    points = document.contours.points.copy()
    points[:, :2] = points[:, :2] % 2 * 9000.0 - 4000.0
    wide = replace(document.machine, bed_min=(-9000.0, -9000.0), bed_max=(9000.0, 9000.0))
    contours = replace(document.contours, points=points)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert not verify_plan(replace(document, contours=contours, machine=wide)).ok
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM / 1024


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
