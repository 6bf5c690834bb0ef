"""Signals in motion: files that say in a bead how far the head has come."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode import write_head_gcode
from decmcts.formats.gcode.dialects.dialect import WAIT_MARK
from decmcts.print.machine import Head, Machine
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, JointPlan
from sim.faults import FaultKind
from sim.heads.file import read_head_file
from sim.heads.plan import plan_of_files
from sim.heads.together import verify_heads
from tests.makers.parked import parked
from tests.mutants.catalogue import Mutant, NotHereError
from tests.mutants.heads import HEAD_MUTANTS
from tests.sim.heads.test_together import LAYERS, PARKS, Made, cut, moved, signals

PASSED = re.compile(r"SYNC_PASSED N=(\d+)\n")
MOVE = re.compile(r"^G1 [XY].*\n", re.M)


def with_edges(plan: JointPlan, points: dict[int, list[int]], lag_s: float = 0.0) -> JointPlan:
    """Return the plan whose head's waits, one after the other, are for these points."""
    return JointPlan(
        tuple(
            replace(
                actions,
                after_point=np.array(points.get(h, [ACTION_END] * 2), np.int32),
                after_lag_s=np.array([lag_s, 0.0]),
            )
            for h, actions in enumerate(plan.heads)
        )
    )


def half_way(plan: JointPlan) -> JointPlan:
    """The right head waits for the middle of a bead, the left one for the middle of another."""
    return with_edges(plan, {0: [1, ACTION_END], 1: [1, ACTION_END]})


@pytest.fixture
def made(tmp_path: Path) -> Made:
    return Made(tmp_path, change=half_way, release="point")


def texts(made: Made) -> list[str]:
    return [path.read_text() for path in made.paths]


def spoil(made: Made, head: int, change: Callable[[str], str]) -> None:
    """Rewrite one head's file."""
    path = made.paths[head]
    text = path.read_text()
    assert change(text) != text
    path.write_text(change(text))


def signal(text: str) -> re.Match[str]:
    """The first signal of a file within a bead, else the first in motion."""
    every = list(PASSED.finditer(text))
    return next((m for m in every if re.match(r"G1 .* E0\.", text[m.end() :])), every[0])


def test_honest_files_pass(made: Made) -> None:
    """Each file signals once within a bead, between its two segments."""
    assert made.judged().faults == ()
    for text in texts(made):
        match = signal(text)
        above, below = text[: match.start()].splitlines()[-1], text[match.end() :].splitlines()[0]
        assert " E0.5" in above and " E0.2" in below
        assert text.count(f"N={match[1]}") == 1


def test_the_other_head_waits_for_that_number_at_rest(made: Made) -> None:
    """Only the head in front goes on; who waits does so before it begins, without an M400."""
    left, right = texts(made)
    for text, other in ((left, right), (right, left)):
        assert f"\nSYNC_WAIT N={signal(text)[1]}\n" in other
        assert f"M400\nSYNC_WAIT N={signal(text)[1]}\n" not in other


@pytest.mark.parametrize("head", [0, 1])
def test_a_signal_one_move_too_early_is_seen(made: Made, head: int) -> None:
    """The room is given away while the head is still in it."""

    def earlier(text: str) -> str:
        match = signal(text)
        return moved(text, match, list(MOVE.finditer(text[: match.start()]))[-1].start())

    spoil(made, head, earlier)
    (first, *_) = made.judged().faults
    assert first.kind == FaultKind.PRECEDENCE and "does not wait for point 1 of" in first.text


@pytest.mark.parametrize("head", [0, 1])
def test_a_signal_one_move_too_late_is_seen(made: Made, head: int) -> None:
    """It is another plan: nobody checked that it does not stop for good."""

    def later(text: str) -> str:
        match = signal(text)
        return moved(text, match, MOVE.search(text, match.end()).end())

    spoil(made, head, later)
    assert ["waits where no plan does" in fault.text for fault in made.judged().faults] == [True]


@pytest.mark.parametrize("head", [0, 1])
def test_a_signal_dropped_is_seen(made: Made, head: int) -> None:
    """The other head would stand for ever."""
    spoil(made, head, lambda text: cut(text, signal(text)))
    assert FaultKind.DEADLOCK in made.judged().kinds()


@pytest.mark.parametrize("head", [0, 1])
def test_a_signal_doubled_is_seen(made: Made, head: int) -> None:
    """The first of the two would let the other head in."""
    spoil(made, head, lambda text: cut(text, signal(text), signal(text)[0] * 2))
    assert any("is given 2 times" in fault.text for fault in made.judged().faults)


@pytest.mark.parametrize("head", [0, 1])
def test_a_head_that_stops_in_its_bead_is_seen(made: Made, head: int) -> None:
    """M400 and a signal at rest, or a dwell, leave a blob where the plan has none."""
    for words in ("M400\nSYNC_SIGNAL N={}\n", "M400\nSYNC_PASSED N={}\n"):
        text = made.paths[head].read_text()
        spoil(made, head, lambda t, w=words: cut(t, signal(t), w.format(signal(t)[1])))
        assert not made.judged().ok
        made.paths[head].write_text(text)
    spoil(made, head, lambda t: cut(t, signal(t), signal(t)[0] + f"G4 P90 {WAIT_MARK}\n"))
    assert any("stops the head within action" in fault.text for fault in made.judged().faults)


def test_ends_are_signalled_in_motion_where_heads_can(made: Made) -> None:
    """A stop costs a rest, and an end needs none: all that was waited for is behind the head."""
    ends = 0
    for text in texts(made):
        assert len(signals(text)) in (2, 3)  # set up, done, and but for the last head ended
        ends += len(PASSED.findall(text)) - 1
    assert ends == 2
    for path in made.paths:
        ended = re.compile(r"^SYNC_PASSED N=(\d+)\n(?!G1 .* E0\.)", re.M)
        path.write_text(ended.sub(r"M400\nSYNC_SIGNAL N=\1\n", path.read_text()))
    assert made.judged().faults == ()  # a stop that is not needed is safe


@pytest.mark.parametrize("head", [0, 1])
def test_a_signal_at_rest_that_does_not_stop_the_head_is_seen(made: Made, head: int) -> None:
    """Whoever hears that a head is done runs its end code: it switches off the motors."""

    def hasty(text: str) -> str:
        match = signals(text)[1]
        return cut(text, match, match[0].removeprefix("M400\n").replace("SIGNAL", "PASSED"))

    spoil(made, head, hasty)
    assert any("at rest" in fault.text for fault in made.judged().faults)


@pytest.mark.parametrize("head", [0, 1])
def test_an_end_signalled_before_the_wipe_is_seen(made: Made, head: int) -> None:
    """The head goes back along its bead, where the other one may be by then."""

    def early(text: str) -> str:
        match = next(m for m in PASSED.finditer(text) if m[1] != signal(text)[1])
        wipe = list(re.finditer(r"^G1 X.* E-.*\n", text[: match.start()], re.M))[-1]
        return moved(text, match, wipe.start())

    spoil(made, head, early)
    assert FaultKind.PRECEDENCE in made.judged().kinds()


def test_a_wait_for_an_end_is_none_for_a_point(tmp_path: Path) -> None:
    """Files of one plan are not those of another, even where they wait for more."""
    made = Made(tmp_path)
    made.plan = half_way(made.plan)
    assert "waits where no plan does" in made.judged().faults[0].text


def test_controllers_that_meet_at_rest_get_no_such_files(made: Made) -> None:
    """On them the command would do nothing, or something else."""
    machine = replace(two_heads(made), release="action")
    for head in (0, 1):
        with pytest.raises(InputError, match="in motion, and the machine's controllers only"):
            write_head_gcode(
                made.document, made.job, made.plan, head, io.StringIO(), machine=machine
            )
    made.release = "action"
    assert (
        sum("which the machine's controllers cannot" in f.text for f in made.judged().faults) == 4
    )


def test_the_last_point_is_the_end(tmp_path: Path) -> None:
    """Who waits for the last point of a bead waits until the head has wiped, too."""
    made = Made(tmp_path, change=lambda plan: with_edges(plan, {0: [2, 2]}))
    assert made.judged().faults == ()
    assert not any(PASSED.search(text) for text in texts(made))


SHORT = LAYERS.replace("3 E.2 F1200", "0.5 E.2 F1200")  # the wipe is longer than what is left


def test_a_head_does_not_wipe_back_to_where_others_are(tmp_path: Path) -> None:
    """Behind the point that was passed another head may be at work."""
    made = Made(tmp_path, layers=SHORT, change=half_way, release="point")
    assert made.judged().faults == ()
    plain = tmp_path / "plain"
    plain.mkdir()
    wiping = Made(plain, layers=SHORT)
    assert wiping.judged().faults == ()
    for head in (0, 1):
        bead = re.compile(r"^G1 .*E0\.2\d*.*\n(?:G1 .*E-.*\n)+", re.M)
        text, full = texts(made)[head], texts(wiping)[head]
        own = bead.search(text, signal(text).start())
        same = next(m for m in bead.finditer(full) if m[0].split("\n")[0] == own[0].split("\n")[0])
        assert own[0] != same[0]
        made.paths[head].write_text(cut(text, own, same[0]))
        assert any("wipes beside contour" in fault.text for fault in made.judged().faults)
        made.paths[head].write_text(text)


def test_lags_are_dwelt_behind_the_wait(tmp_path: Path) -> None:
    """The signal says when; the waiting head lets the seconds pass."""
    made = Made(tmp_path, change=lambda plan: with_edges(plan, {0: [1, -1]}, 2.5), release="point")
    assert made.judged().faults == ()
    for text in texts(made):
        assert re.search(r"SYNC_WAIT N=\d+\nG4 P2500 ;", text)
    for head in (0, 1):
        text = made.paths[head].read_text()
        dwell = re.search(r"G4 P2500 .*\n", text)
        for change in (
            cut(text, dwell),
            cut(text, dwell, dwell[0].replace("2500", "2400")),
            moved(text, dwell, text.rindex("SYNC_WAIT", 0, dwell.start())),
        ):
            made.paths[head].write_text(change)
            assert any("does not dwell for 2.5 s" in fault.text for fault in made.judged().faults)
        made.paths[head].write_text(text)


def test_long_lags_are_dwelt_in_parts(tmp_path: Path) -> None:
    """No controller is asked to stand for longer than ten minutes at once."""
    made = Made(tmp_path, change=lambda plan: with_edges(plan, {}, 900.0))
    assert made.judged().faults == ()
    assert "G4 P600000" in texts(made)[0] and "G4 P300000" in texts(made)[0]


def test_points_are_read_back_from_the_files_alone(made: Made) -> None:
    """Without the plan the judge knows how far each head has come when another begins."""
    files = [read_head_file(path) for path in made.paths]
    document, faults = plan_of_files(files, made.job, two_heads(made))
    assert faults == []
    for h, (actions, mine) in enumerate(zip(document.plan.heads, made.plan.heads, strict=True)):
        found = [edge for k in range(len(actions)) for edge in actions.after_edges(k)]
        due = [edge for k in range(len(mine)) for edge in mine.after_edges(k)]
        assert [edge.point for edge in found if edge.point != ACTION_END] == [1], h
        (partial,) = [edge for edge in found if edge.point != ACTION_END]
        (wanted,) = [edge for edge in due if edge.point != ACTION_END]
        other, theirs = document.plan.heads[1 - h], made.plan.heads[1 - h]
        assert other.contour[partial.action] == theirs.contour[wanted.action]


def waiting_twice(plan: JointPlan) -> JointPlan:
    """The left head also waits for an action that ended before what it waits for anyway."""
    left, right = plan.heads
    offsets = left.after_offsets + (np.arange(len(left.after_offsets)) > 8)
    two = [np.append(edges, edges[-1:]) for edges in (left.after_head, left.after_lag_s)]
    points = np.append(left.after_point, left.after_point[-1:])
    first, last = left.after_action
    more = replace(
        left, after_offsets=offsets, after_head=two[0], after_lag_s=two[1], after_point=points,
        after_action=np.array([first, last - 2, last], np.int32),
    )  # fmt: skip
    return JointPlan((more, right))


def test_a_wait_for_what_is_known_already_is_no_fault_without_the_plan(tmp_path: Path) -> None:
    """The plan as it is read has no edge for it; the files of `launch` were refused for that."""
    made = Made(tmp_path, change=waiting_twice)
    files = [read_head_file(path) for path in made.paths]
    document, faults = plan_of_files(files, made.job, two_heads(made))
    read = [len(actions.after_head) for actions in document.plan.heads]
    assert faults == [] and read[0] < len(made.plan.heads[0].after_head)
    verdict = verify_heads(
        parked(made.plan, PARKS), made.paths, document.plan, made.job, made.document, read=True
    )
    assert verdict.faults == ()


@pytest.mark.parametrize("move", ["G1 E.01\n", "G1 X{x}.0004 E.01\n", "G1 X{x}.001 E.01\n"])
def test_points_that_a_file_cannot_tell_apart_are_no_fault_without_the_plan(
    tmp_path: Path, move: str
) -> None:
    """A segment of no length, or of less than a file's last decimal, is one of the contour."""
    layers = re.sub(r"(G1 X(\d+) E\.5 .*\n)", lambda m: m[1] + move.format(x=m[2]), LAYERS)
    made = Made(tmp_path, layers=layers)
    files = [read_head_file(path) for path in made.paths]
    document, faults = plan_of_files(files, made.job, two_heads(made))
    assert faults == []
    for read, actions in zip(document.plan.heads, made.plan.heads, strict=True):
        for a, b in zip(prints(read), prints(actions), strict=True):
            assert np.array_equal(read.action_path(a), actions.action_path(b))
    assert made.judged().faults == ()


def prints(actions: HeadActions) -> list[int]:
    return np.flatnonzero(actions.kind == ActionKind.PRINT).tolist()


def two_heads(made: Made) -> Machine:
    """A machine of the two heads, as far as the plan of files needs one."""
    heads = tuple(
        Head(actions.head, (), park=park)
        for actions, park in zip(made.plan.heads, PARKS, strict=True)
    )
    return Machine("two", (0.0, 0.0), (200.0, 200.0), heads, release="point")


def test_points_of_travels_are_signalled_too(tmp_path: Path) -> None:
    """The plan format lets any action be waited for in its midst."""

    def change(plan: JointPlan) -> JointPlan:
        left, right = plan.heads
        path = left.action_path(0)
        middle = np.array([path.mean(axis=0)])
        longer = replace(
            left,
            path=np.concatenate([path[:1], middle, left.path[1:]]),
            path_offsets=np.concatenate([[0], left.path_offsets[1:] + 1]),
        )
        waits = replace(
            right,
            after_action=np.array([0, 3], np.int32),
            after_point=np.array([1, ACTION_END], np.int32),
        )
        assert waits.after_edges(3) == [After(0, 0, 1, 0.0)]
        return JointPlan((longer, waits))

    made = Made(tmp_path, change=change, release="point")
    assert made.judged().faults == ()
    spoil(made, 0, lambda t: moved(t, signal(t), t.rindex("G1 X", 0, signal(t).start())))
    assert any("point 1 of action 0" in fault.text for fault in made.judged().faults)


@pytest.mark.parametrize("mutant", HEAD_MUTANTS, ids=lambda mutant: mutant.name)
def test_mutants_of_files_with_points_are_seen(made: Made, mutant: Mutant[list[list[str]]]) -> None:
    """The mutation bench for files of several heads, on files that signal in motion."""
    good = [text.splitlines() for text in texts(made)]
    for seed in range(3):
        files = [list(lines) for lines in good]
        try:
            mutant.spoil(files, np.random.default_rng(seed))
        except NotHereError:
            pytest.skip("these files have no such place")
        for path, lines in zip(made.paths, files, strict=True):
            path.write_text("\n".join(lines) + "\n")
        assert not made.judged().ok or mutant.harmless
