"""Contours are cut where heads that share them end the print sooner."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from playwright.sync_api import Browser

from agents.launch import LaunchResult
from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.machines.rail_family import rail_machine
from decmcts.formats.mesh import SliceOptions
from decmcts.planning.events import Event, Note, unheard
from decmcts.planning.options import Cut, Freedom, Limits, Rules, TeamSearch
from decmcts.planning.problem.by_pieces import before_by_pieces
from decmcts.planning.problem.print_problem import load, problem_of
from decmcts.planning.problem.source import read_source
from decmcts.planning.read import read
from decmcts.planning.result import Result
from decmcts.planning.team import cutting, joint
from decmcts.planning.team.cutting import best_sweep
from decmcts.planning.team.joint import sweep_plan
from decmcts.planning.team.pipeline import plan_team, prepared, swept
from decmcts.planning.verify import verify
from decmcts.print.cut import OUTSIDE, cuts_of, weld_ages
from decmcts.print.job import PrintJob
from decmcts.print.motion import segment_times
from decmcts.print.plan import ActionKind
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.dec_mcts import planner
from decmcts.team.engine.plans import encode_stated
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.entries import entries_of
from sim.content.inventory import move_segments
from sim.content.welds import welds_of
from sim.faults import FaultKind
from sim.heads.file import read_head_file
from sim.pictures.layer_travels import travels_of
from sim.pictures.layer_view import draw_pieces
from sim.pictures.report.saving import saving_of
from sim.verify import verify_plan
from tests.conftest import opened
from tests.makers.agents import Agents
from tests.prints import slab
from tests.sim.pictures.report.unpacking import page_of


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return slab(tmp_path_factory.mktemp("slab") / "slab.gcode")


@pytest.fixture(scope="module")
def result(source: Path) -> Result:
    """A slab planned for two heads with all its contours cut."""
    search = TeamSearch(1.0, cut=Cut.ALL)
    problem = problem_of(read(source, "dual-gantry"), Rules(), unheard)
    return Result(plan_team(problem, search, writes=True, agents=Agents()), search)


def test_the_more_is_cut_the_sooner_a_sweep_ends(source: Path) -> None:
    """One slab 200 mm wide: whole nothing can be shared, cut nearly all."""
    problem = load(source, "dual-gantry")
    ends = {}
    for cut in Cut:
        swept = best_sweep(problem, cut, unheard)
        assert swept is not None
        ends[cut] = swept.makespan_s
    assert ends[Cut.NONE] > 1.2 * ends[Cut.INSIDE]
    assert ends[Cut.INSIDE] > 1.05 * ends[Cut.ALL]


@pytest.mark.parametrize("listed", [(1, 0), (2, 0, 1)])
def test_a_machine_may_list_its_heads_in_any_order(tmp_path: Path, listed: tuple[int, ...]) -> None:
    """Who prints which part of a slab follows from where heads stand."""
    machine = rail_machine(load_machine("dual-gantry"), len(listed), 600.0)
    made = slab(tmp_path / "slab.gcode", wide=400.0, middle=(300.0, 150.0))
    heads = tuple(machine.heads[h] for h in listed)
    first = best_sweep(load(made, machine), Cut.INSIDE, unheard)
    other = best_sweep(load(made, replace(machine, heads=heads)), Cut.INSIDE, unheard)
    assert first is not None and other is not None
    assert other.makespan_s == pytest.approx(first.makespan_s, rel=2e-3)  # ties fall otherwise
    prints = [np.bincount(one.order.head, minlength=len(listed)) for one in (first, other)]
    assert prints[1] == pytest.approx(prints[0][list(listed)], rel=0.05)


def test_cuts_that_gain_next_to_nothing_over_one_head_are_not_made(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then one head prints whole contours."""
    monkeypatch.setattr(joint, "GAIN", 0.1)
    problem = problem_of(read(source, "dual-gantry"), Rules(), unheard)
    planned = plan_team(problem, TeamSearch(0.5, cut=Cut.ALL), writes=False, agents=Agents())
    assert planned.after.contours.of is None
    assert planned.after.metrics["planner"] == "local, one head"


def test_prints_whose_order_no_message_holds_are_cut(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Heads begin with the sweep, and tell each other what they change of it."""
    monkeypatch.setattr(planner, "MOST_STATED", 10)
    problem = problem_of(read(source, "dual-gantry"), Rules(), unheard)
    swept = best_sweep(problem, Cut.ALL, unheard)
    planned = plan_team(problem, TeamSearch(1.0, cut=Cut.ALL), writes=False, agents=Agents())
    assert swept is not None and planned.problem.cut == Cut.ALL
    assert planned.after.plan.makespan_s < 1.05 * swept.makespan_s


def test_of_prints_that_are_too_large_it_is_said(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, heard = load(source, "dual-gantry"), list[Event]()
    monkeypatch.setattr(cutting, "MOST_SWEPT", 10)
    assert best_sweep(problem, Cut.ALL, heard.append) is None
    assert heard == [Note("more than 10 contours: no sweep is tried, nothing cut")]


def test_nothing_is_cut_where_heads_end_sooner_without_any_sweep(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of many small parts heads choose freely: a sweep of pieces must beat that, not a sweep."""
    problem = load(source, "dual-gantry")
    pieces = best_sweep(problem, Cut.INSIDE, unheard)
    assert pieces is not None and pieces.problem.whole is not None
    policies = {len(problem.job.contours): 0.99 * pieces.makespan_s}
    monkeypatch.setattr(
        cutting, "first_policies_s", lambda team: policies.get(len(team.macro), 1e9)
    )
    whole = best_sweep(problem, Cut.INSIDE, unheard)
    assert whole is not None and whole.problem.whole is None
    policies.clear()
    again = best_sweep(problem, Cut.INSIDE, unheard)
    assert again is not None and again.problem.whole is not None


@pytest.mark.parametrize(("heads", "wide", "times"), [(4, 600.0, 3.2), (8, 1000.0, 5.5)])
def test_many_heads_share_one_part(tmp_path: Path, heads: int, wide: float, times: float) -> None:
    """Each has a territory; all print at once nearly all of the time."""
    bed = wide + 200.0
    machine = rail_machine(load_machine("dual-gantry"), heads, bed)
    problem = load(slab(tmp_path / "slab.gcode", wide=wide, middle=(bed / 2.0, 150.0)), machine)
    swept = best_sweep(problem, Cut.ALL, unheard)
    job = problem.job
    alone = segment_times(job.contours, problem.machine.limits, job.acceleration).sum()
    assert swept is not None and alone / swept.makespan_s > times


def test_of_each_layer_the_layout_is_taken_in_which_heads_end_first(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the strips are expected to take is not what pieces take: the best is measured."""
    problem, ends = load(source, "dual-gantry"), {}
    for others in (cutting.OTHERS, ()):
        monkeypatch.setattr(cutting, "OTHERS", others)
        swept = best_sweep(problem, Cut.ALL, unheard)
        assert swept is not None
        heads = range(len(problem.machine.heads))
        plan = encode_stated(swept.order, len(heads), swept.team.n_macros)
        resolved = resolve(swept.team, {0: plan}, heads)
        assert resolved.makespan_s == pytest.approx(swept.makespan_s)
        ends[len(others)] = swept.makespan_s
    assert max(ends.values()) == ends[0] > min(ends.values())


def test_what_is_late_in_a_sweep_is_cut_sooner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Round holes touch what lies between them where the heads' territories meet."""
    plate = trimesh.creation.box((1000.0, 100.0, 0.8))
    holes = [trimesh.creation.cylinder(15.0, 2.0) for _ in range(10)]
    for k, hole in enumerate(holes):
        hole.apply_translation((100.0 * k - 450.0, 0.0, 0.0))
    plate = trimesh.boolean.difference([plate, *holes], engine="manifold")
    plate.apply_translation((600.0, 150.0, 0.4))
    plate.export(tmp_path / "plate.stl")
    source = read_source(
        tmp_path / "plate.stl", rail_machine(load_machine("dual-gantry"), 8, 1200.0),
        limits=Limits.SOURCE, mesh=SliceOptions(center=None), report=unheard,
    )  # fmt: skip
    problem = problem_of(source, Rules(), unheard)
    ends = {}
    monkeypatch.setattr(cutting, "OTHERS", ())
    for rounds in (1, cutting.ROUNDS):
        monkeypatch.setattr(cutting, "ROUNDS", rounds)
        swept = best_sweep(problem, Cut.ALL, unheard)
        assert swept is not None
        ends[rounds] = swept.makespan_s
    assert max(ends.values()) == ends[1] > 1.1 * min(ends.values())


def test_the_bound_of_pieces_holds_wherever_loops_are_entered(source: Path) -> None:
    """Loops that stay whole may be entered elsewhere yet, so a bound as sliced proves nothing."""
    seams = Rules(freedom=Freedom.SEAM)
    problem = problem_of(read(source, "dual-gantry"), seams, unheard)
    search = TeamSearch(0.5, cut=Cut.INSIDE)
    ready = swept(prepared(problem, search, writes=False), search, unheard)
    assert ready.whole is not None
    pieces, entries = ready.problem, entries_of(ready.problem.job, ready.orders)
    assert entries is not None
    due = makespan_bound(pieces.job, pieces.machine, pieces.graph, entries=entries)
    assert ready.bound.result() == due


def test_heads_share_one_part(result: Result) -> None:
    """They print side by side, and the plan says what was cut."""
    after = result.planned.after
    assert after.metrics["one_head_s"] / after.metrics["makespan_s"] > 1.3
    assert after.contours.of is not None and after.rules is not None
    assert after.rules.cut == "all" and after.metrics["cut"]["cuts"] > 20


def test_accelerations_of_pieces_are_the_source_s(result: Result) -> None:
    """A plan that states others is refused, as it is of whole contours."""
    after, job = result.planned.after, result.planned.problem.job
    due = job.accelerations
    assert verify_plan(replace(after, acceleration=due), source=whole_job(result), trials=0).ok
    spoilt = verify_plan(
        replace(after, acceleration=due + 500.0), source=whole_job(result), trials=0
    )
    assert any("acceleration" in fault.text for fault in spoilt.faults)


def whole_job(result: Result) -> PrintJob:
    """Return the print as it was before it was cut."""
    whole = result.planned.problem.whole
    assert whole is not None
    return whole.job


def test_planner_and_judge_measure_the_same_welds(result: Result) -> None:
    """Each by code of its own, at each cut."""
    after = result.planned.after
    ages, cuts = weld_ages(after.contours, after.plan)
    found = welds_of(after, after.plan.heads)
    assert sum(map(len, found.values())) == len(ages) == after.metrics["cut"]["cuts"]
    for contour, judged in found.items():
        assert judged == pytest.approx(ages[cuts.contour == contour].tolist(), abs=1e-6)
    assert 0 < after.metrics["cut"]["weld_median_s"] < after.metrics["cut"]["weld_most_s"]


def test_a_plan_keeps_the_limit_that_it_states(result: Result) -> None:
    """Old welds are a fault there, and so is a figure that its actions do not have."""
    after, source = result.planned.after, whole_job(result)
    cut, rules = after.metrics["cut"], after.rules
    assert rules is not None
    for limit_s in (cut["weld_most_s"] + 0.01, cut["weld_most_s"] - 0.01):
        stated = replace(after, rules=replace(rules, weld_limit_s=limit_s))
        found = verify_plan(stated, source=source, trials=0).kinds()
        assert found == (set() if limit_s > cut["weld_most_s"] else {FaultKind.WELD})
    for name, value in cut.items():
        lie: Any = {**cut, name: value + 1}  # type: ignore[operator]  # all are numbers
        lie = replace(after, metrics={**after.metrics, "cut": lie})
        assert verify_plan(lie, source=source, trials=0).kinds() == {FaultKind.WELD}


class Careless(Agents):
    """Agents that do not begin with the sweep."""

    def __call__(self, *given: Any, **options: Any) -> LaunchResult:
        return super().__call__(*given, **{**options, "start": None})


def test_welds_are_no_older_than_asked(tmp_path: Path) -> None:
    """Where what is agreed welds later the sweep is printed, and cut is what that has in time."""
    source = read(slab(tmp_path / "slab.gcode", layers=3), "dual-gantry")
    nothing = {"share": 0.0, "windows": 0, "tries": 1}  # is searched
    problem, free = (
        problem_of(source, Rules(), unheard),
        TeamSearch(0.5, cut=Cut.ALL, parameters=nothing),
    )
    said: list[object] = []
    ready = prepared(problem, free, writes=False)
    plan = sweep_plan(cut := swept(ready, free, unheard))
    assert plan is not None
    latest = float(weld_ages(cut.problem.job.contours, plan)[0].max())
    limited = replace(free, weld_limit_s=latest + 0.01)
    after = plan_team(problem, limited, writes=False, agents=Careless(), report=said.append).after
    assert after.rules is not None and after.rules.weld_limit_s == latest + 0.01
    assert after.metrics["cut"]["weld_most_s"] == pytest.approx(latest)
    assert any("the sweep is printed" in note.text for note in said if isinstance(note, Note))
    assert swept(ready, replace(free, weld_limit_s=1.0), said.append).whole is None
    assert "9 contours stay whole" in [n.text for n in said if isinstance(n, Note)][-1]


def test_files_of_a_cut_print_hold_the_source_s_path(
    result: Result, source: Path, tmp_path: Path
) -> None:
    """Point by point: what both files lay down is the source's, filament to the last digit."""
    result.write_plan(tmp_path / "plan.json")
    files = result.write_gcode(tmp_path / "part").paths
    assert verify(files, source, plan=tmp_path / "plan.json").ok
    assert verify(tmp_path / "plan.json", source).ok
    with pytest.raises(InputError, match="add --plan"):
        verify(files, source, machine="dual-gantry")
    laid: dict[float, float] = defaultdict(float)
    words = result.planned.problem.machine.words
    length = 0.0
    for path in files:
        motion = read_head_file(path, words).motion
        rows = np.flatnonzero(
            (motion.extrusion > 0) & (np.diff(motion.points[:, :2], axis=0) != 0).any(axis=1)
        )
        segments = move_segments(motion.points, motion.extrusion, motion.feed, motion.line, rows)
        step = segments.ends[:, 3:] - segments.ends[:, :3]
        length += float(np.linalg.norm(step, axis=1).sum())
        for z, e in zip(segments.ends[:, 2], segments.extrusion, strict=True):
            laid[round(float(z), 3)] += float(e)
    contours = load(source, "dual-gantry").job.contours
    due: dict[float, float] = defaultdict(float)
    for z, e in zip(contours.points[:, 2], contours.extrusion, strict=True):
        due[round(float(z), 3)] += float(e)
    assert laid == pytest.approx(due, abs=1e-9)
    step = np.diff(contours.points, axis=0)
    inside = np.ones(len(step), np.bool_)
    inside[contours.offsets[1:-1] - 1] = False
    assert length == pytest.approx(np.linalg.norm(step[inside], axis=1).sum(), abs=0.05)


def test_joints_of_pieces_are_no_travels_of_the_source(result: Result) -> None:
    """Pictures show by layer what the source travelled, though they draw it in pieces."""
    planned = result.planned
    pieces = before_by_pieces(planned.before, planned.after)
    told = saving_of(pieces, planned.after)["by_layer"]["before"]
    moved = travels_of(planned.before).length_mm.sum()
    assert sum(told) == pytest.approx(moved, rel=0.01)


def test_no_head_waits_within_a_bead_without_retracting(result: Result, tmp_path: Path) -> None:
    """Pieces that follow one another are one bead, but for where the head waits for another."""
    waits = 0
    for path in result.write_gcode(tmp_path / "part").paths:
        pushed = [(line, "E" in line and "E-" not in line and " X" in line)
                  for line in path.read_text().splitlines()
                  if line.startswith(("G1 ", "SYNC_WAIT"))]  # fmt: skip
        for before, (line, _), behind in zip(pushed, pushed[1:], pushed[2:], strict=False):
            waits += line.startswith("SYNC_WAIT")
            assert not (line.startswith("SYNC_WAIT") and before[1] and behind[1]), line
    assert waits > 10


def test_views_have_the_source_beside_the_pieces(result: Result, tmp_path: Path) -> None:
    """The source's own order is drawn piece by piece, each in the time its contour takes."""
    result.write_report(tmp_path / "report.html")
    result.write_picture(tmp_path / "picture.svg")
    page, after = page_of(tmp_path / "report.html"), result.planned.after
    (was,) = page["plans"][0]["heads"]
    prints = was["kind"] == ActionKind.PRINT
    assert was["contour"][prints].tolist() == list(range(len(after.contours)))
    whole = result.planned.before.plan.heads[0]
    begin, end = (np.cumsum(was["idle"] + was["lasts"]) - k * was["lasts"] for k in (1, 0))
    for contour in range(len(whole_job(result).contours)):
        mine = np.isin(was["contour"], np.flatnonzero(after.contours.sources == contour)) & prints
        (row,) = np.flatnonzero(whole.contour == contour)
        assert begin[mine][0] / 1e3 == pytest.approx(whole.begin_s[row], abs=0.01)
        assert end[mine][-1] / 1e3 == pytest.approx(whole.end_s[row], abs=0.01)
    cut, cuts = page["facts"]["cut"], page["cuts"]
    assert cut["cuts"] == len(cuts["age"]) == sum(n for _, n in cut["roles"])
    assert cuts["age"] == pytest.approx(weld_ages(after.contours, after.plan)[0], abs=1e-3)
    of, meet = cuts["of"], [cuts[name].astype(int) for name in ("before", "after")]
    assert (of[meet[0]] == of[meet[1]]).all() and (meet[0] != meet[1]).any()


def test_cuts_are_marked_and_told_of_in_a_browser(
    result: Result, tmp_path: Path, browser: Browser
) -> None:
    """Of the layers shown; a piece says of what contour it is and how old its welds are."""
    result.write_report(tmp_path / "report.html")
    with opened(browser, tmp_path / "report.html") as page:
        page.evaluate("D.view.ready")
        action = "D.page.plans[1].heads[0].kind.indexOf(0, 9)"
        page.evaluate(f"D.selected.go({{ plan: 1, head: 0, action: {action} }})")
        page.evaluate("document.getElementById('view-cuts').click()")
        page.evaluate("D.state.set({ layers: [1, 1] })")
        legend, told, first = (
            page.inner_text(f"#{name}") for name in ("view-legend", "selected-facts", "facts")
        )
    after = result.planned.after
    owner = np.repeat(np.arange(len(after.contours)), np.diff(after.contours.offsets))
    there = owner[cuts_of(after.contours).before]
    shows = np.isin(after.contours.role[there], OUTSIDE)[after.contours.layer[there] == 1]
    assert f"cuts inside: {(~shows).sum()}" in legend and f"cuts that show: {shows.sum()}" in legend
    assert "of the source's contour" in told and "where the other piece is printed" in told
    assert "proven for the pieces as they are cut" in first and "contours cut at" in first


def test_a_layer_is_drawn_piece_by_piece(result: Result) -> None:
    """Each piece once, in a colour of its head, neighbours in unlike shades; a mark at each cut."""
    after, axis = result.planned.after, Figure().subplots()
    draw_pieces(axis, after, 1, inch_a_mm=0.02)
    contours = after.contours
    for actions, lines in zip(after.plan.heads, axis.collections, strict=True):
        printed = actions.contour[actions.kind == ActionKind.PRINT]
        there = int((contours.layer[printed] == 1).sum())
        assert there == len(lines.get_paths()) == len(shades := lines.get_color())
        assert (np.abs(np.diff(shades, axis=0)).max(axis=1) > 0.05).all()
    (marks,) = axis.lines
    at = cuts_of(contours).before
    owner = np.searchsorted(contours.offsets, at, side="right") - 1
    assert np.size(marks.get_xdata()) == (contours.layer[owner] == 1).sum() > 0
