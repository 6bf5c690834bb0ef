"""Plans and their files run in simulated controllers: as the plan says, and safe."""

from __future__ import annotations

import contextlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.messages.event_stream import read_events, stream_of
from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.events import Step, unheard
from decmcts.planning.options import Cut, Rules, TeamSearch
from decmcts.planning.problem.print_problem import problem_of
from decmcts.planning.problem.source import read
from decmcts.planning.result import Result
from decmcts.planning.simulate import USUAL_HEADS, simulate
from decmcts.planning.team.pipeline import plan_team
from decmcts.print.print_events import EventKind
from sim.controllers.simulate import events_of
from sim.controllers.timing import Timing
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.makers.agents import Agents
from tests.mutants.actions import travel_at, upper_layer_first
from tests.mutants.catalogue import NotHereError
from tests.mutants.waits import one_wait_dropped, waits_dropped
from tests.prints import slab


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path], Result]:
    """A slab on two heads: its plan.json and its files."""
    folder = tmp_path_factory.mktemp("slab")
    source = slab(folder / "slab.gcode")
    problem = problem_of(read(source, "dual-gantry"), Rules(), unheard)
    search = TeamSearch(1.0, cut=Cut.INSIDE)
    result = Result(plan_team(problem, search, writes=True, agents=Agents()), search)
    files = list(result.write_gcode(folder / "out").paths)
    plan = folder / "plan.json"
    result.write_plan(plan)
    return plan, files, result


def test_files_take_what_the_plan_says(made):
    """Within 1 %, with a queue of 16 moves and a time model of its own."""
    plan, files, result = made
    makespan = result.document.plan.makespan_s
    for inputs in ([plan], [plan, *files], files):
        found = simulate(inputs)
        assert found.simulation.safe
        assert found.simulation.makespan_s == pytest.approx(makespan, rel=0.01)


def test_whose_heads_are_simulated_is_said_where_nobody_names_them(made):
    """Safe files of another machine were said to touch, and nothing was said of its heads."""
    plan, files, _ = made
    for inputs, machine, count in (files, None, 1), (files, "dual-gantry", 0), ([plan], None, 0):
        said = []
        simulate(inputs, machine, report=said.append)
        assert [getattr(event, "text", "") for event in said].count(USUAL_HEADS) == count


def test_what_files_state_does_not_replace_a_heads_own_limits(made):
    """A slower head was simulated as fast as its source said: M201 of 1500 mm/s² here."""
    _, files, _ = made
    machine = load_machine("dual-gantry")
    slow = replace(machine.limits, max_acceleration=(200.0, 200.0, 100.0, 5000.0))
    left, right = machine.heads
    machine = replace(machine, heads=(left, replace(right, limits=slow)))
    rates = [
        {limits.max_acceleration for limits in program.limits}
        for program in simulate(files, machine).simulation.programs
    ]
    assert (1500.0, 1500.0, 300.0, 5000.0) in rates[0]
    assert rates[1] == {slow.max_acceleration}


def test_all_filament_is_pushed(made):
    """Both heads together push what the contours have."""
    plan, _, result = made
    heads = simulate([plan]).simulation.heads
    due = float(result.document.contours.extrusion.sum())
    assert sum(head.filament_mm for head in heads) == pytest.approx(due)


@pytest.mark.parametrize("timing", list(Timing))
def test_no_error_of_time_makes_heads_touch(made, timing):
    """J1 to J5: the order is safe for every timing."""
    plan, files, _ = made
    found = simulate([plan, *files], timing=timing, size=0.5, trials=6).simulation
    assert found.safe
    assert min(trial.near[0].rail_mm for trial in found.trials) > -1e-3


def test_how_near_heads_have_come_is_told_meanwhile(made):
    """Many trials of a large print take minutes."""
    said: list[str] = []
    found = simulate(
        [made[0]], timing=Timing.UNIFORM, trials=3,
        report=lambda event: said.append(event.text) if isinstance(event, Step) else None,
    ).simulation  # fmt: skip
    first = min(near.gap_mm for near in found.trials[0].near)
    lines = [text for text in said if "contacts so far" in text]
    assert len(lines) == 3 and f"heads {first:.1f} mm apart at least, 0 contacts" in lines[0]


def test_what_errors_of_time_leave_no_time_to_cool_is_counted(made, tmp_path):
    """Against a look at all pairs of contours, by the times of a run on time."""
    plan = json.loads(made[0].read_text())
    assert not simulate([made[0]]).cools  # it has no rule
    plan["min_layer_time_s"] = 400.0
    ruled = tmp_path / "ruled.json"
    ruled.write_text(json.dumps(plan))
    found = simulate([ruled], timing=Timing.UNIFORM, size=0.9, trials=3)
    on_time, *late = found.simulation.trials
    assert found.cools and sum(len(trial.too_soon) for trial in late) > 0
    run, programs = found.simulation.run, found.simulation.programs
    contours = found.plan.contours
    times = {}
    for actions, program, head in zip(found.plan.plan.heads, programs, run.heads, strict=True):
        for a in np.flatnonzero(actions.contour >= 0).tolist():
            moves = np.flatnonzero(program.action == a)
            times[int(actions.contour[a])] = head.begin[moves[0]], head.end[moves[-1]]
    for each in on_time.too_soon + late[0].too_soon:
        assert each.under < each.contour and each.gap_s < each.due_s <= 400.0
        floor = contours.bottom[each.contour] - contours.height[each.contour]
        assert contours.top[each.under] == pytest.approx(floor)
    for each in on_time.too_soon:
        assert each.gap_s == pytest.approx(times[each.contour][0] - times[each.under][1])


@pytest.mark.parametrize("spoil", [waits_dropped, one_wait_dropped])
def test_a_plan_without_its_waits_is_seen_to_collide(made, tmp_path, spoil):
    """The simulator can see what it is there to see."""
    seen = 0
    for seed in range(3):
        plan = json.loads(made[0].read_text())
        spoil(plan, np.random.default_rng(seed))
        spoilt = tmp_path / "spoilt.json"
        spoilt.write_text(json.dumps(plan))
        found = simulate([spoilt], timing=Timing.ADVERSARIAL).simulation
        seen += not found.safe
    assert seen == 3 if spoil is waits_dropped else seen >= 1


def goes_into_the_print(made, folder: Path, spoil) -> list[Path]:
    """Return spoilt plans; a seed with which none can be made or read is left out."""
    found = []
    for seed in range(20):
        plan = json.loads(made[0].read_text())
        path = folder / f"spoilt_{seed}.json"
        with contextlib.suppress(NotHereError, InputError):
            spoil(plan, np.random.default_rng(seed))
            path.write_text(json.dumps(plan))
            read_plan(path)
            found.append(path)
    return found[:4]


@pytest.mark.parametrize("spoil", [upper_layer_first, travel_at(0.05)])
def test_a_plan_that_goes_into_the_print_is_seen_to(made, tmp_path, spoil):
    """Whatever the judge finds of these by logic of its own; none is seen in the sound plan."""
    assert simulate([made[0]]).simulation.print_contacts == 0
    unsafe = seen = 0
    for spoilt in goes_into_the_print(made, tmp_path, spoil):
        judged = {fault.kind for fault in verify_plan(read_plan(spoilt)).faults}
        found = simulate([spoilt])
        unsafe += FaultKind.HEAD_MATERIAL in judged
        seen += found.simulation.print_contacts > 0
        for one in found.simulation.trials[0].on_print:
            top = found.plan.contours.top[one.bead]
            assert one.spot[2] <= top + 1e-9 and one.depth_mm > 0.0
    assert seen == unsafe > 0


def test_a_head_without_work_stands_at_its_park(made, tmp_path):
    """Not where machines begin to count."""
    plan = json.loads(made[0].read_text())
    waits_dropped(plan, np.random.default_rng(0))
    plan["heads"][1]["actions"] = []
    (tmp_path / "idle.json").write_text(json.dumps(plan))
    found = simulate([tmp_path / "idle.json"]).simulation
    assert found.safe and found.heads[1].printing_s == 0.0


def test_events_tell_the_actions_of_the_plan(made):
    """Replanning starts from them."""
    plan, _, result = made
    log = events_of(simulate([plan]).simulation, result.document.problem)
    for h, head in enumerate(result.document.plan.heads):
        moves = np.flatnonzero(np.diff(head.path_offsets) > 1).tolist()
        for kind in (EventKind.BEGAN, EventKind.ENDED):
            on_trial = [e for e in log.events if e.head == h and e.kind == kind]
            assert [event.action for event in on_trial] == moves
            at = head.path[head.path_offsets[:-1] if kind == EventKind.BEGAN
                           else head.path_offsets[1:] - 1]  # fmt: skip
            assert np.allclose([event.at for event in on_trial], at[moves])
    assert [e.time_s for e in log.events] == sorted(e.time_s for e in log.events)
    assert len(stream_of(log)) < 200 * len(log.events)


def test_files_that_do_not_belong_together_are_refused(made):
    plan, files, _ = made
    for inputs, said in (
        ([files[0]], "which no file gives"),
        ([files[0], files[0]], "name all files of one `launch`"),
        ([plan, plan], "one plan can be run"),
    ):
        with pytest.raises(InputError, match=said):
            simulate(inputs)
    with pytest.raises(InputError, match="a plan has its machine"):
        simulate([plan], "dual-gantry")


def test_files_of_another_plan_are_refused(made, tmp_path):
    """Else their time would be compared with a plan they have nothing to do with."""
    plan, files, _ = made
    other = [tmp_path / path.name for path in files]
    for path, spoilt in zip(files, other, strict=True):
        lines = path.read_text().splitlines()
        beads = [k for k, line in enumerate(lines) if line.startswith("G1 X") and " E" in line]
        gone = set(beads[: len(beads) // 10])
        spoilt.write_text("\n".join(line for k, line in enumerate(lines) if k not in gone))
    with pytest.raises(InputError, match="mm of beads here"):
        simulate([plan, *other])


def test_feeds_that_are_none_are_passed_over(tmp_path):
    """As controllers do; such a move would take no time else."""
    begin = "G28\nG90\nM83\nG1 X10 Y10 Z0.2 F1200\n"
    times = []
    for feed in ("", " F0", " F-600"):
        path = tmp_path / "feed.gcode"
        path.write_text(f"{begin}G1 X50 Y10 E2 F600\nG1 X50 Y50 E2{feed}\n")
        times.append(simulate([path]).simulation.makespan_s)
    assert times[0] > 7.0 and times[1:] == [times[0]] * 2


def test_a_file_of_no_known_printer_is_run(made, tmp_path):
    """One head alone touches no other, so its shape does not matter."""
    said = []
    found = simulate([slab(tmp_path / "slab.gcode")], report=said.append)
    assert found.simulation.makespan_s > 100.0
    assert any("no printer is known" in getattr(event, "text", "") for event in said)
    assert not found.looked_at_print and simulate([found_path(tmp_path)], "mk4s").looked_at_print


def found_path(folder: Path) -> Path:
    """Return the one file of a folder."""
    (path,) = folder.iterdir()
    return path


@pytest.mark.parametrize("options", [{"size": 1.0}, {"trials": 0}, {"queue": 0}])
def test_options_that_mean_nothing_are_refused(made, options):
    with pytest.raises(InputError):
        simulate([made[0]], **options)


def test_the_command_shows_and_keeps_what_happened(made, tmp_path, capsys):
    from decmcts.cli.run import run

    plan, files, _ = made
    kept = [tmp_path / name for name in ("e.events", "where.csv", "run.png")]
    options = ["--events", str(kept[0]), "--csv", str(kept[1]), "--picture", str(kept[2])]
    assert run(["simulate", str(plan), *map(str, files), *options]) == 0
    said = capsys.readouterr().out
    assert "0 contacts of heads" in said and "0 contacts with the print" in said
    assert "than planned" in said
    assert read_events(kept[0]).heads == ("left", "right")
    rows = np.loadtxt(kept[1], delimiter=",", skiprows=1)
    assert np.diff(rows[:, 0]).min() == pytest.approx(1.0)
    assert kept[2].read_bytes().startswith(b"\x89PNG")
    assert run(["simulate", str(plan), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["schema"] == "decmcts-simulation/1" and figures["safe"] is True
    assert run(["simulate", str(tmp_path / "none.gcode")]) == 2
    assert run(["simulate", str(plan), "--csv", "-"]) == 2


def test_the_command_says_where_a_head_goes_into_the_print(made, tmp_path, capsys):
    from decmcts.cli.run import run

    spoilt, picture = goes_into_the_print(made, tmp_path, upper_layer_first)[0], tmp_path / "r.png"
    assert run(["simulate", str(spoilt), "--picture", str(picture)]) == 1
    said = capsys.readouterr()
    assert "a head touches the print" in said.err
    assert re.search(r"0:\d\d:\d\d: \w+ (prints contour \d+|travels), its slice", said.out)
    assert run(["simulate", str(spoilt), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    first = found["trials"][0]["print_contacts"][0]
    assert first["bead"] >= 0 and first["depth_mm"] > 0.0 and found["safe"] is False
