"""The rest of a print: nothing twice, nothing lost, nothing driven into what is printed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError, VerificationError
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.replanning.fenced import fenced_places
from decmcts.planning.replanning.replan import Rest, replan, rest_of
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.planning.result import Result
from decmcts.print.contours import taken
from decmcts.print.machine import Fenced
from decmcts.print.plan import ActionKind, JointPlan
from decmcts.print.print_state import state_of_events, state_of_height, state_of_layers
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.planning.replanning.conftest import (
    Made,
    faults_beside,
    log_until,
    read_made,
    within_print,
)

SEARCH = TeamSearch(0.2)
PARKED = (345.0, 150.0, 10.0)
OVER_PRINT = (150.0, 100.0, 0.6)


def planned(made: Made, rest: Rest, agents: Any) -> Result:
    return replan(rest, SEARCH, rules_of(made.document), agents=agents)


def laid(contours: Any) -> set[tuple[float, ...]]:
    """Return the segments of contours that are printed, whichever way they run."""
    found = set()
    for c in range(len(contours)):
        line = np.round(contours.polyline(c), 2)
        for a, b in zip(line[:-1].tolist(), line[1:].tolist(), strict=True):
            found.add(tuple(min(a, b) + max(a, b)))
    return found


@pytest.mark.slow
def test_printed_and_rest_are_the_print(made: Made, agents: Any) -> None:
    """Nothing is printed twice and nothing is lost, segment by segment."""
    state = state_of_layers(made.document, 3)
    result = planned(made, rest_of(made.document, made.source, state, {}), agents)
    rest, printed = result.document.contours, result.document.printed
    assert printed is not None and len(printed) + len(rest) == len(made.document.contours)
    assert not laid(rest) & laid(printed)
    assert laid(rest) | laid(printed) == laid(made.document.contours)
    assert result.verdict.ok
    assert [head.head for head in result.document.plan.heads] == ["left", "right"]


@pytest.mark.slow
def test_a_dead_head_leaves_what_it_alone_reaches(made: Made, alone: Any) -> None:
    """The rail keeps the living head away from it; what it reaches is finished."""
    state = state_of_layers(made.document, 3)
    rest = rest_of(made.document, made.source, state, {"right": OVER_PRINT})
    (head,) = rest.source.machine.heads
    assert head.name == "left" and head.reach_max[0] == pytest.approx(80.0)
    contours = made.document.contours
    assert (contours.start[rest.left.rows, 0] > 80.0).all()
    total = rest.done + int(rest.left.rows.sum()) + len(rest.source.job.contours)
    assert total == len(contours)
    assert "16 contours are not finished (layers 4 to 7)" in rest.lines[0]
    result = planned(made, rest, alone)
    assert result.verdict.ok
    assert rest.lines[0] in result.planned.problem.job.notes


@pytest.mark.slow
def test_a_dead_head_that_may_have_gone_on_is_met_nowhere_on_its_path(
    made: Made, alone: Any
) -> None:
    """Beside where it was seen last another head came too near to where it may stand."""
    time_s, k = within_print(made.document, 0, 30.0)
    state = state_of_events(made.document, log_until(made.document, time_s))
    path, machine = made.document.plan.heads[0].action_path(k), made.document.machine
    nearest = {"left": tuple(path[path[:, 0].argmax()].tolist())}
    anywhere = fenced_places(["left"], made.document, state, seen=True)
    result = planned(made, rest_of(made.document, made.source, state, anywhere), alone)
    assert result.verdict.ok and not faults_beside(result.document, machine, nearest)
    (head,) = result.document.machine.heads
    near = replace(head, park=(float(path[0, 0]) + 70.0, 100.0, 5.0))  # to where it was seen
    assert near.park[0] < head.reach_min[0]
    there = result.document.machine.of_heads((near,))
    idle = replace(result.document, machine=there, plan=JointPlan(()))
    assert faults_beside(idle, machine, anywhere)
    assert not faults_beside(idle, machine, {"left": tuple(path[0].tolist())})


@pytest.mark.slow
def test_the_judge_sees_a_head_that_comes_near_a_dead_one(made: Made, alone: Any) -> None:
    """It finds by itself where heads come too near, and what is printed into one."""
    state = state_of_layers(made.document, 3)
    result = planned(made, rest_of(made.document, made.source, state, {"right": PARKED}), alone)
    machine = made.document.machine
    assert not faults_beside(result.document, machine, {"right": PARKED})
    faults = faults_beside(result.document, machine, {"right": OVER_PRINT})
    assert {fault.kind for fault in faults} == {FaultKind.HEAD_HEAD}
    faults = faults_beside(result.document, machine, {"right": (60.0, 100.0, 0.4)})
    assert {fault.kind for fault in faults} == {FaultKind.HEAD_HEAD, FaultKind.HEAD_MATERIAL}


@pytest.mark.slow
def test_travels_clear_what_is_printed(made: Made, alone: Any, tmp_path: Path) -> None:
    """A travel as low as if nothing stood there is refused; so after plan.json is read back."""
    document = made.document
    done = np.zeros(len(document.contours), np.bool_)  # one tower stands, the other begins
    right = document.contours.start[:, 0] > 150.0
    done[right | (document.contours.layer < 1)] = True
    state = replace(state_of_layers(document, 1), done=done)
    rest = rest_of(document, made.source, state, {})
    result = planned(made, rest, alone)
    result.write_plan(tmp_path / "rest.json")
    read = read_plan(tmp_path / "rest.json")
    assert read.printed is not None and verify_plan(read).ok
    assert verify_plan(read, source=result.planned.problem.job).ok
    low = replace(read, plan=JointPlan(tuple(map(_through_the_tower, read.plan.heads))))
    faults = verify_plan(low).faults
    assert any("meets what was printed before" in fault.text for fault in faults)
    bare = verify_plan(replace(low, printed=None)).faults
    assert not any(fault.kind is FaultKind.HEAD_MATERIAL for fault in bare)


def _through_the_tower(head: Any) -> Any:
    """Return a head's actions with its longest travel led through the printed tower."""
    if not len(head):
        return head
    k = int(np.flatnonzero(head.kind == ActionKind.TRAVEL)[1])
    first, last = int(head.path_offsets[k]), int(head.path_offsets[k + 1])
    a, b = head.path[first], head.path[last - 1]
    path = np.array([a, [240.0, 100.0, 0.5], b])
    offsets = head.path_offsets.copy()
    offsets[k + 1 :] += len(path) - (last - first)
    whole = np.concatenate([head.path[:first], path, head.path[last:]])
    return replace(head, path=whole, path_offsets=offsets)


@pytest.mark.slow
@pytest.mark.parametrize("left_beads", list(LeftBeads))
def test_a_bead_broken_off_is_finished_or_left(
    made: Made, agents: Any, left_beads: LeftBeads
) -> None:
    """From the very place where its head failed, by whoever reaches it."""
    time_s, action = within_print(made.document, 1, 12.0)
    state = state_of_events(made.document, log_until(made.document, time_s, failed=1))
    assert state.failed == ("right",)
    rest = rest_of(made.document, made.source, state, {"right": PARKED}, left_beads)
    mine = next(one for one in rest.broken if one.head == "right")
    path = made.document.plan.heads[1].action_path(action)
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    half = float(np.linalg.norm(path[1] - path[0])) / 2.0
    assert mine.missing_mm == pytest.approx(length - half)
    assert bool(mine.rest) == (left_beads is LeftBeads.FINISH)
    result = planned(made, rest, agents)
    assert result.verdict.ok
    finished = [
        c for c in range(len(result.document.contours))
        if np.allclose(result.document.contours.polyline(c)[0], (path[0] + path[1]) / 2, atol=1e-3)
    ]  # fmt: skip
    assert len(finished) == (left_beads is LeftBeads.FINISH)
    if finished:
        line = result.document.contours.polyline(finished[0])
        assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(
            mine.missing_mm, abs=0.01
        )


@pytest.mark.slow
def test_head_files_go_to_their_parks_above_the_print(
    made: Made, alone: Any, tmp_path: Path
) -> None:
    """Up before across, whatever the start code left the head at."""
    state = state_of_layers(made.document, 3)
    result = planned(made, rest_of(made.document, made.source, state, {"right": PARKED}), alone)
    tall = replace(result.planned.problem.job.printed, points=_raised(result))
    job = replace(result.planned.problem.job, printed=tall)
    problem = replace(result.planned.problem, job=job)
    again = replace(result, planned=replace(result.planned, problem=problem, head_files=()))
    (path,) = again.write_gcode(tmp_path / "rest").paths
    moves = [row for row in path.read_text().splitlines() if re.match(r"G[01] .*[XYZ]", row)]
    assert moves[0].startswith("G1 Z55.") and moves[1].startswith("G1 X-45.000 Y150.000")
    across, down, onward = (row.split(" F") for row in moves[1:4])
    assert down[0].startswith("G1 Z") and down[1] != across[1]
    assert onward[0].startswith("G1 X") and onward[1] == across[1]


def _raised(result: Result) -> Any:
    points = result.document.printed.points.copy()
    points[:, 2] += 50.0 - points[:, 2].max()
    return points


@pytest.mark.slow
def test_a_plan_says_who_is_fenced(made: Made, alone: Any, tmp_path: Path) -> None:
    """So whoever judges it later looks there too, and sees heads that reach further."""
    state = state_of_layers(made.document, 3)
    result = planned(made, rest_of(made.document, made.source, state, {"right": PARKED}), alone)
    result.write_plan(tmp_path / "rest.json")
    read = read_plan(tmp_path / "rest.json")
    assert read.fenced is not None and read.fenced.at == {"right": PARKED}
    assert verify_plan(read, machine=made.document.machine).ok
    elsewhere = replace(read, fenced=Fenced(read.fenced.machine, {"right": OVER_PRINT}))
    assert FaultKind.HEAD_HEAD in {fault.kind for fault in verify_plan(elsewhere).faults}
    (left,) = read.machine.heads
    further = replace(left, reach_max=(900.0, 900.0, 900.0))
    wide = replace(read, machine=replace(read.machine, heads=(further,)))
    assert FaultKind.MACHINE in {fault.kind for fault in verify_plan(wide).faults}
    living = replace(read, fenced=Fenced(read.fenced.machine, {"left": PARKED}))
    assert FaultKind.MACHINE in {fault.kind for fault in verify_plan(living).faults}


@pytest.mark.slow
def test_a_rest_is_replanned_again(made: Made, alone: Any, agents: Any, tmp_path: Path) -> None:
    """From its own source; what was printed before it stands on the bed too."""
    state = state_of_layers(made.document, 2)
    first = planned(made, rest_of(made.document, made.source, state, {}), agents)
    draft = tmp_path / "rest.gcode"
    draft.write_bytes(first.planned.problem.source.path.read_bytes())
    again = replace(read_made(draft), machine=made.document.machine)
    with pytest.raises(InputError, match="counts layers from its own first"):
        state_of_layers(first.document, 1)
    state = state_of_height(first.document, 0.6)
    rest = rest_of(first.document, again, state, {"right": PARKED})
    second = replan(rest, SEARCH, rules_of(first.document), agents=alone)
    document, contours = second.document, made.document.contours
    assert second.verdict.ok
    assert document.printed is not None and document.fenced is not None
    left, printed = laid(document.contours), laid(document.printed)
    missing = laid(taken(first.document.contours, np.flatnonzero(rest.left.rows)))
    assert not left & printed and left | printed | missing == laid(contours)


def test_heads_that_stand_over_the_print_are_taken_to_their_parks(made: Made) -> None:
    """By files of their own, before those of the rest, which begin there."""
    state = state_of_events(made.document, log_until(made.document, 30.0))
    rest = rest_of(made.document, made.source, state, {})
    assert [one.head for one in rest.to_park] == ["left", "right"]
    assert "run STEM-1_left_to_park.gcode, STEM-2_right_to_park.gcode, one" in rest.lines[-1]
    rest = rest_of(made.document, made.source, state, {"right": PARKED})
    assert [one.head for one in rest.to_park] == ["left"]
    assert not rest_of(made.document, made.source, state_of_layers(made.document, 2), {}).to_park


def test_what_is_left_has_no_first_layer(made: Made) -> None:
    """It lies on what is printed: nothing keeps its lowest layer together before all others."""
    rest = rest_of(made.document, made.source, state_of_layers(made.document, 2), {})
    contours = rest.source.job.contours
    assert len(np.unique(contours.layer)) == 5 and len(np.unique(contours.epoch)) == 1


def test_another_source_is_refused(made: Made) -> None:
    """One line, before anything is planned."""
    state = state_of_layers(made.document, 3)
    contours = made.source.job.contours
    points = contours.points.copy()
    points[0, 0] += 1.0
    job = replace(made.source.job, contours=replace(contours, points=points))
    with pytest.raises(InputError, match="is not the print of this plan"):
        rest_of(made.document, replace(made.source, job=job), state, {})


def test_a_print_that_is_done_is_refused(made: Made) -> None:
    """There is nothing to write."""
    layers = int(made.document.contours.layer.max()) + 1
    with pytest.raises(InputError, match="nothing is left to print"):
        rest_of(made.document, made.source, state_of_layers(made.document, layers), {})


@pytest.mark.slow
def test_a_plan_the_judge_refuses_is_none(made: Made, alone: Any) -> None:
    """Here the heads believe a fenced head to stand elsewhere than it does."""
    state = state_of_layers(made.document, 3)
    rest = rest_of(made.document, made.source, state, {"right": PARKED})
    elsewhere = Fenced(made.document.machine, {"right": OVER_PRINT})
    job = replace(rest.source.job, fenced=elsewhere)
    with pytest.raises((InputError, VerificationError), match="too near"):
        planned(made, replace(rest, source=replace(rest.source, job=job)), alone)


def test_a_head_with_several_tools_left_is_refused(made: Made, alone: Any) -> None:
    """The refusal named a draft that was gone, and an option that `replan` does not have."""
    rest = rest_of(made.document, made.source, state_of_layers(made.document, 3), {})
    contours = rest.source.job.contours
    tool = np.arange(len(contours), dtype=contours.tool.dtype) % 2
    job = replace(rest.source.job, contours=replace(contours, tool=tool))
    several = replace(rest, source=replace(rest.source, job=job))
    with pytest.raises(InputError, match=r"^what is left for head left is of tools 0 and 1"):
        planned(made, several, alone)
