"""Travels of one head round outer walls: as far as the source's, always, or never."""

from __future__ import annotations

from dataclasses import replace
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.commands.plan import plan
from decmcts.cli.commands.post import post
from decmcts.cli.run import run
from decmcts.planning.one_head.detours import WallRule
from decmcts.planning.one_head.no_slower import write_no_slower
from decmcts.planning.one_head.pipeline import plan_judged
from decmcts.planning.options import AvoidWalls, PlannerName, Rules, Search
from decmcts.planning.problem.planned import Planned
from decmcts.planning.problem.print_problem import PrintProblem, load
from decmcts.planning.writing.file_times import source_time
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.metric_kernels import distance
from sim.content.over_walls import over_walls_mm
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.formats.gcode.reading.test_combing import part

SLICED = Search(0.1, planner=PlannerName.SLICER, certificate=False)
GREEDY = replace(SLICED, planner=PlannerName.GREEDY)
ROUND = "G1 X113 Y108 F7800\nG1 X147 Y108 F7800\nG1 X150 Y140 F7800\n"


def problem_of(tmp_path: Path, avoid: AvoidWalls, *, goes_round: bool = False) -> PrintProblem:
    """Return a U-shaped part whose travels from arm to arm cross the gap, or go round it."""
    text = part(bare_mm=1.0)
    if goes_round:
        text = text.replace("G1 X150 Y140 F7800\n", ROUND)
    path = tmp_path / "part.gcode"
    path.write_text(text)
    return load(path, "mk4s", Rules(quality=False, avoid_walls=avoid))


def written(planned: Planned, tmp_path: Path) -> tuple[Planned, float, float]:
    """Write a plan; returns it with travel over walls of the source's file and of its own."""
    out = tmp_path / "out.gcode"
    made, times = write_no_slower(planned, SLICED, out, allow_slower=True)
    return made, times.before["travel_over_walls_mm"], times.after["travel_over_walls_mm"]


def bends(document: PlanDocument) -> int:
    """Return how many corners the travels between prints have, seen from above."""
    actions, found = document.plan.heads[0], 0
    printing = np.flatnonzero(actions.kind == ActionKind.PRINT)
    for k in range(printing[0], printing[-1]):
        if actions.kind[k] != ActionKind.PRINT:
            way = actions.action_path(k)[:, :2]
            found += max(0, int((np.diff(way, axis=0) != 0.0).any(axis=1).sum()) - 1)
    return found


@pytest.mark.parametrize("search", [SLICED, GREEDY])
def test_always_keeps_travels_inside_the_part_and_the_judge_agrees(tmp_path, search):
    """From arm to arm they go through the base; the judge's own measure says the same."""
    planned, was, now = written(
        plan_judged(problem_of(tmp_path, AvoidWalls.ALWAYS), search), tmp_path
    )
    assert was > 100.0 and now == 0.0
    assert bends(planned.after) > 0 or search is GREEDY  # its order has no need of them
    assert over_walls_mm(planned.problem.job.contours, planned.after.plan.heads[0]) == 0.0


def test_never_goes_straight(tmp_path):
    """As before this option, whatever the source does."""
    problem = problem_of(tmp_path, AvoidWalls.NEVER, goes_round=True)
    planned, was, now = written(plan_judged(problem, SLICED), tmp_path)
    assert bends(planned.after) == 0
    assert was == 0.0 and now > 100.0


def test_auto_leads_over_walls_no_more_than_the_source(tmp_path):
    """A source that goes round is followed; one that goes straight stays so."""
    round_it = problem_of(tmp_path, AvoidWalls.AUTO, goes_round=True)
    planned, was, now = written(plan_judged(round_it, SLICED), tmp_path)
    assert was == now == 0.0 and bends(planned.after) > 0
    straight = problem_of(tmp_path, AvoidWalls.AUTO)
    planned, was, now = written(plan_judged(straight, SLICED), tmp_path)
    assert now == pytest.approx(was) and bends(planned.after) == 0


def test_a_search_prices_travels_over_walls_where_the_source_goes_round_them(tmp_path):
    """In mm and in seconds; a travel that stays inside costs what it did."""
    problem = problem_of(tmp_path, AvoidWalls.AUTO, goes_round=True)
    rule = WallRule.of(problem, source_time(problem))
    assert rule.over > 0.0
    straight = problem_of(tmp_path, AvoidWalls.AUTO)
    assert WallRule.of(straight, source_time(straight)).over == 0.0
    plain = problem.for_one_head(SLICED.objective)
    assert rule.priced(plain).unit == plain.unit == "mm"


def test_a_plan_that_says_it_keeps_off_walls_and_does_not_is_a_fault(tmp_path):
    """The judge measures the travels of the plan itself."""
    planned, _, now = written(plan_judged(problem_of(tmp_path, AvoidWalls.NEVER), SLICED), tmp_path)
    job = planned.problem.job
    assert not verify_plan(planned.after, source=job).faults
    false = replace(planned.after, metrics={**planned.after.metrics, "travel_over_walls_mm": 0.0})
    assert now > 100.0
    assert [fault.kind for fault in verify_plan(false, source=job).faults] == [FaultKind.TIMES]


def test_a_bend_into_what_is_printed_is_a_fault(tmp_path):
    """A way round is judged leg by leg: one bend at the height of an arm's first layer."""
    planned = plan_judged(problem_of(tmp_path, AvoidWalls.ALWAYS), SLICED)
    plan = planned.after.plan
    actions = plan.heads[0]
    sizes = np.diff(actions.path_offsets)
    routed = [
        k for k in range(len(actions)) if actions.kind[k] == ActionKind.TRAVEL and sizes[k] > 3
    ]
    inside = [k for k in routed if actions.action_path(k)[:, 2].min() > 0.5]  # above two layers
    path = actions.path.copy()
    path[actions.path_offsets[inside[-1]] + 1, 2] = 0.1
    spoilt = replace(planned.after, plan=replace(plan, heads=(replace(actions, path=path),)))
    faults = verify_plan(spoilt, source=planned.problem.job).faults
    assert any(fault.kind == FaultKind.HEAD_MATERIAL for fault in faults)


def test_an_order_of_one_contour_has_no_travels_to_lead(tmp_path):
    """Nothing to route, and nothing that fails."""
    problem = problem_of(tmp_path, AvoidWalls.ALWAYS)
    rule = WallRule.of(problem, None)
    assert rule.most_mm == np.inf
    assert rule.detours(problem, Toolpath.as_sliced(len(problem.job.contours))) is not None


def test_a_result_with_more_travel_over_walls_is_not_written(tmp_path):
    """The source is kept, and the line says why; the writer here leads its travels astray."""
    planned = plan_judged(problem_of(tmp_path, AvoidWalls.AUTO, goes_round=True), SLICED)
    straight = plan_judged(problem_of(tmp_path, AvoidWalls.NEVER, goes_round=True), SLICED)
    straight = replace(straight, problem=planned.problem, sliced=planned.sliced)
    out = tmp_path / "out.gcode"
    made, times = write_no_slower(straight, SLICED, out, allow_slower=True)
    assert times.kept and made.after.metrics["kept_source"]
    assert out.read_text() == (tmp_path / "part.gcode").read_text()
    assert (
        "161 mm of the new order's travels would lead over outer walls, of the source's 0"
        in made.after.metrics["kept_because"]
    )


def test_a_price_in_mm_is_the_length_and_more_over_walls(tmp_path):
    """Straight inside the part: its length; over the gap of the U: twice that."""
    problem = problem_of(tmp_path, AvoidWalls.ALWAYS)
    priced = WallRule.of(problem, None).priced(problem.for_one_head(SLICED.objective))
    start, end = priced.start, priced.end
    metric = priced.metric()
    strokes = [k for k in range(13) if start[k, 1] == 140.0]
    left, right = (next(k for k in strokes if start[k, 0] == x) for x in (110.0, 150.0))
    over = distance(metric, 2 * left + 1, 2 * right)
    assert over == pytest.approx(2.0 * np.linalg.norm(end[left] - start[right]))
    near = next(k for k in strokes if start[k, 0] == 105.0)
    inside = distance(metric, 2 * near + 1, 2 * left)
    assert inside == pytest.approx(np.linalg.norm(end[near] - start[left]))


@pytest.mark.parametrize("command", [plan, post])
def test_commands_do_as_the_source_does_unless_told(command):
    """What the docs say of the default, and of rules made in Python."""
    default = signature(command).parameters["avoid_walls"].default
    assert default == Rules().avoid_walls == AvoidWalls.AUTO


def test_what_lies_between_epochs_is_not_counted(tmp_path):
    """The source's own lines move the head there: a timelapse in the gap of the U."""
    path = tmp_path / "part.gcode"
    lapse = "M104 S201\nG1 X130 Y160 F7800\nG4 P1\n"
    path.write_text(part(bare_mm=1.0).replace("G1 X150 Y140 F7800\n", lapse + "G1 X150 Y140\n", 1))
    problem = load(path, "mk4s", Rules(quality=False, avoid_walls=AvoidWalls.NEVER))
    planned, _, now = written(plan_judged(problem, SLICED), tmp_path)
    due = over_walls_mm(problem.job.contours, planned.after.plan.heads[0])
    assert due <= now + 0.05
    assert not verify_plan(planned.after, source=problem.job).faults


@pytest.mark.slow
@pytest.mark.parametrize("choice", ["auto", "always", "never"])
@pytest.mark.parametrize("between", [None, "M600", ""])
def test_prints_with_one_travel_or_none_are_planned(tmp_path, between, choice):
    """A vase is one wall, and what pauses stand between is not travelled: nothing to measure."""
    source = tmp_path / "in.gcode"
    rows = ["; generated by PrusaSlicer 2.5.0", "G28", "G90", "M83", "G1 Z0.2 F600"]
    for x in (60,) if between is None else (60, 100):
        rows += [between] if x > 60 else []
        rows += [f"G1 X{x} Y60 F7800", ";TYPE:External perimeter", f"G1 X{x + 20} E1 F1800"]
        rows += ["G1 Y80 E1", f"G1 X{x} E1", "G1 Y60.1 E1"]
    source.write_text("\n".join([*rows, "M84", ""]))
    options = ["--machine", "paper", "--time-limit", "0.1", "--avoid-walls", choice]
    assert run(["plan", str(source), "-o", str(tmp_path / "out.gcode"), *options]) == 0
