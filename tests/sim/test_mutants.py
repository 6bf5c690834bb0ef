"""A sample of the mutation bench: each kind of fault, once, in a small print made by code."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.planning.verify import digest_of
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.mutants.catalogue import NotHereError
from tests.mutants.gcode import GCODE_MUTANTS
from tests.mutants.order import SAFE_MUTANTS, TEMPERATURE_MUTANTS, made_unsafe
from tests.mutants.plan import PLAN_MUTANTS, as_text
from tests.mutants.waits import STOP_MUTANTS, WAIT_MUTANTS

MACHINE = "mk4s"
JUDGED = {  # what a reader cannot see
    "no head waits for the other": FaultKind.HEAD_HEAD,
    "one wait dropped": FaultKind.RAIL,
    "two heads wait for each other": FaultKind.DEADLOCK,
    "a wait for the point before": FaultKind.RAIL,
    "waits for first points, not for ends": FaultKind.HEAD_HEAD,
    "waits for the actions before": FaultKind.HEAD_HEAD,
    "lags dropped": FaultKind.COOLING,
}
WITH_TWO_HEADS = {mutant.name for mutant in (*WAIT_MUTANTS, *STOP_MUTANTS)}
WITH_TWO_HEADS.add("the heads exchanged")


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plan the made print for one head; the folder holds source, plan and G-code."""
    folder = tmp_path_factory.mktemp("good")
    source = folder / "in.gcode"
    source.write_text(made_gcode([(60.0, 100.0), (200.0, 100.0)]))
    code = run(
        ["plan", str(source), "-o", str(folder / "out.gcode"), "--plan", str(folder / "plan.json"),
         "--machine", MACHINE, "--planner", "greedy", "--time-limit", "0.2", "--no-certificate"]
    )  # fmt: skip
    assert code == 0
    return folder


@pytest.fixture(scope="module")
def safe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plan parts that the source prints one by one, too near each other; as `good`."""
    folder = tmp_path_factory.mktemp("safe")
    (folder / "in.gcode").write_text(made_unsafe())
    code = run(
        ["plan", str(folder / "in.gcode"), "-o", str(folder / "out.gcode"), "--machine", MACHINE,
         "--planner", "greedy", "--time-limit", "0.2", "--no-certificate", "--allow-slower"]
    )  # fmt: skip
    assert code == 0
    return folder


def judged(result: Path, good: Path) -> int:
    """Return the exit code of `decmcts verify`: 0 no fault, 1 faults, 2 refused, 70 a crash."""
    source = str(good / "in.gcode")
    return run(["verify", str(result), "--source", source, "--machine", MACHINE, "--trials", "1"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plan.json", "out.gcode"])
def test_the_good_result_passes(good: Path, name: str):
    """A judge that faults everything would catch every mutant."""
    assert judged(good / name, good) == 0


@pytest.mark.slow
@pytest.mark.parametrize("mutant", PLAN_MUTANTS, ids=lambda m: m.name)
def test_a_spoilt_plan_does_not_pass(good: Path, tmp_path: Path, mutant):
    """Each kind is caught or refused, or does no harm for a stated reason; none crashes."""
    if mutant.name in WITH_TWO_HEADS:
        pytest.skip("needs two heads: below, or in the bench")
    plan, spoilt = json.loads((good / "plan.json").read_text()), tmp_path / "plan.json"
    mutant.spoil(plan, np.random.default_rng(0))
    spoilt.write_text(as_text(plan))
    if mutant.sealed:
        with contextlib.suppress(InputError):  # then it is refused with any digest
            plan["problem"] = digest_of(read_plan(spoilt))
        spoilt.write_text(as_text(plan))
    assert judged(spoilt, good) in ((0, 1) if mutant.harmless else (1, 2))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("mutant", WAIT_MUTANTS, ids=lambda m: m.name)
def test_spoilt_waits_do_not_pass(make, tmp_path: Path, mutant, seed: int):
    """Each wait of this plan is needed, at its point and with its lag; other values are refused."""
    write_plan(make.stacked_plan((0, 2, -1, 18.0)), tmp_path / "plan.json")
    assert verify_plan(read_plan(tmp_path / "plan.json"), trials=1).ok
    plan = json.loads((tmp_path / "plan.json").read_text())
    mutant.spoil(plan, np.random.default_rng(seed))
    (tmp_path / "plan.json").write_text(as_text(plan))
    if mutant.name in JUDGED:
        kinds = verify_plan(read_plan(tmp_path / "plan.json"), trials=1).kinds()
        assert JUDGED[mutant.name] in kinds
    else:
        with pytest.raises(InputError):
            read_plan(tmp_path / "plan.json")


def spoilt(good: Path, mutant, folder: Path) -> int:
    """Return what the judge says of a good file's lines, spoilt."""
    lines = (good / "out.gcode").read_text().splitlines()
    try:
        mutant.spoil(lines, np.random.default_rng(0))
    except NotHereError:
        pytest.fail("the made print has no place for this mutant")
    (folder / "out.gcode").write_text("\n".join(lines) + "\n")
    return judged(folder / "out.gcode", good)


@pytest.mark.slow
@pytest.mark.parametrize("mutant", GCODE_MUTANTS + TEMPERATURE_MUTANTS, ids=lambda m: m.name)
def test_spoilt_gcode_does_not_pass(good: Path, tmp_path: Path, mutant):
    """Each kind is caught or refused, or does no harm for a stated reason; none crashes."""
    assert spoilt(good, mutant, tmp_path) in ((0, 1, 2) if mutant.harmless else (1, 2))


@pytest.mark.slow
def test_a_print_made_safe_passes(safe: Path):
    """By the file that was given."""
    assert judged(safe / "out.gcode", safe) == 0


@pytest.mark.slow
@pytest.mark.parametrize("mutant", SAFE_MUTANTS, ids=lambda m: m.name)
def test_a_spoilt_print_made_safe_does_not_pass(safe: Path, tmp_path: Path, mutant):
    """The source's own order least of all."""
    assert spoilt(safe, mutant, tmp_path) == 1
