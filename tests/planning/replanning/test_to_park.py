"""Heads that are taken to their parks where a print was broken off, wherever they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.fenced import living_machine
from decmcts.planning.replanning.park_files import ParkFile, park_files, park_paths
from decmcts.print.machine import Body, Machine, Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from decmcts.print.print_state import (
    PrintState,
    state_of_events,
    state_of_layers,
    taken_to_parks,
    whereabouts,
)
from sim.faults import FaultKind, Verdict
from sim.heads.to_park import Whereabouts, check_to_park
from tests.makers.railed import broken_off, met, moved, moves_of_text, railed, replayed, touched
from tests.planning.replanning.conftest import Made

MOMENTS = np.random.default_rng(0).uniform(0.02, 0.98, 50)


class Team(NamedTuple):
    document: PlanDocument
    source: Source

    @property
    def machine(self) -> Machine:
        return self.document.machine


@pytest.fixture(scope="session")
def teams(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Team]:
    return {n: Team(*railed(tmp_path_factory.mktemp(f"rail{n}"), n)) for n in (2, 3, 4)}


def files_of(
    team: Team, state: PrintState, fenced: dict[str, Point] | None = None
) -> tuple[ParkFile, ...]:
    return park_files(team.document, team.source, state, team.machine, fenced or {})


def todays(machine: Machine, at: dict[str, Point]) -> list[tuple[str, np.ndarray]]:
    """What files of a rest do of themselves, in their order: over the print, across, down."""
    return [
        (
            h.name,
            moved(at[h.name], [{"Z": 15.0}, {"X": h.park[0], "Y": h.park[1]}, {"Z": h.park[2]}]),
        )
        for h in machine.heads
    ]


@pytest.mark.slow
@pytest.mark.parametrize("heads", [2, pytest.param(3, marks=pytest.mark.long)])
def test_heads_go_to_their_parks_and_never_meet(teams: dict[int, Team], heads: int) -> None:
    """At any moment, each head fenced in turn and none: from where each truly stands."""
    team = teams[heads]
    machine, several = team.machine, 0
    for k, (state, at) in enumerate(broken_off(team.document, MOMENTS)):
        for gone in (None, list(at)[k % heads]):
            fenced = {} if gone is None else {gone: at[gone]}
            try:
                living_machine(machine, fenced, team.document.contours)
            except InputError:
                continue  # it parks beyond the fenced one: then nothing is replanned
            files = files_of(team, state, fenced)
            several += len(files) > 1
            paths = [(one.head, moved(at[one.head], moves_of_text(one.text))) for one in files]
            assert not touched(machine, at, paths)
            end = at | {name: tuple(path[-1].tolist()) for name, path in paths}
            for head in machine.heads:
                assert (
                    head.name == gone or np.abs(np.subtract(end[head.name], head.park)).max() < 1e-3
                )
            top = float(team.document.contours.top[state.done].max(initial=0.0))
            for _, path in paths:
                assert np.array_equal(path[0, :2], path[1, :2])
                assert path[1:-1, 2].min() > top
    assert several > 20


@pytest.mark.slow
@pytest.mark.parametrize(("heads", "order"), [(3, (1, 0, 2)), (4, (0, 1, 2, 3))])
def test_in_another_order_they_meet(
    teams: dict[int, Team], heads: int, order: Sequence[int]
) -> None:
    """Four as the files of a rest are set up; of three an inner one before its neighbour."""
    team = teams[heads]
    (broken,) = broken_off(team.document, [0.5])
    paths = todays(team.machine, broken.at)
    again = [paths[k] for k in order]
    assert met(replayed(team.machine, broken.at, again))
    assert touched(team.machine, broken.at, again)


@pytest.mark.parametrize("heads", [2, 4])
def test_where_a_head_stands_is_on_the_line_it_is_looked_for(
    teams: dict[int, Team], heads: int
) -> None:
    """As controllers carry the plan out, points of paths passed within beads too."""
    team = teams[heads]
    for state, at in broken_off(team.document, MOMENTS):
        for one, actions in zip(state.heads, team.document.plan.heads, strict=True):
            line = whereabouts(one, actions, team.machine.head(one.head).park)
            assert _distance(line, np.array(at[one.head])) < 1e-6


def _distance(line: np.ndarray, at: np.ndarray) -> float:
    if len(line) == 1:
        return float(np.linalg.norm(line[0] - at))
    along = np.diff(line, axis=0)
    share = ((at - line[:-1]) * along).sum(axis=1) / (along**2).sum(axis=1)
    near = line[:-1] + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(near - at, axis=1).min())


def test_a_head_that_began_to_leave_its_park_is_away(teams: dict[int, Team]) -> None:
    """It was seen at its park last, and may be anywhere on its first travel."""
    document = teams[3].document
    names = tuple(actions.head for actions in document.plan.heads)
    h = next(h for h, head in enumerate(document.plan.heads) if not head.after_edges(0))
    park = document.machine.head(names[h]).park
    log = EventLog(document.problem, names, (PrintEvent(EventKind.BEGAN, h, 0.0, 0, 0, park),))
    (one,) = files_of(teams[3], state_of_events(document, log))
    assert one.head == names[h]


def test_heads_at_their_parks_need_no_files(teams: dict[int, Team]) -> None:
    """By layers nobody knows where heads stand; and people may have taken them there."""
    team = teams[3]
    assert not files_of(team, state_of_layers(team.document, 1))
    (broken,) = broken_off(team.document, [0.5])
    assert files_of(team, broken.state)
    assert not files_of(team, taken_to_parks(broken.state))


def test_that_the_last_point_was_passed_may_be_said_late(teams: dict[int, Team]) -> None:
    """A head that parks for another ends and passes the last point of its path at one time."""
    (broken,) = broken_off(teams[3].document, [1.0])
    assert not broken.state.broken and broken.state.done.all()


def test_a_head_without_a_clear_path_is_named(made: Made) -> None:
    """The fenced one stands where the other may be, somewhere within its bead."""
    team = Team(made.document, made.source)
    k = int(np.flatnonzero(made.document.plan.heads[0].contour >= 0)[0])
    events = [
        PrintEvent(kind, 0, float(j), j, 0, (50.0, 90.0, 0.2))
        for j in range(k) for kind in (EventKind.BEGAN, EventKind.ENDED)
    ]  # fmt: skip
    events.append(PrintEvent(EventKind.BEGAN, 0, 99.0, k, 0, (50.0, 90.0, 0.2)))
    state = state_of_events(
        made.document, EventLog(made.document.problem, ("left", "right"), tuple(events))
    )
    with pytest.raises(InputError, match="no clear path to its park from wherever it may stand"):
        files_of(team, state, {"right": (130.0, 100.0, 0.6)})


def test_what_hangs_below_a_tip_goes_over_the_print_too(teams: dict[int, Team]) -> None:
    """A probe, say, 3 mm below."""
    (broken,) = broken_off(teams[2].document, [0.5])
    probe = Body("probe", (20.0, -2.0, -3.0), (24.0, 2.0, 10.0))
    machine = teams[2].machine
    left = replace(machine.heads[0], bodies=(*machine.heads[0].bodies, probe))
    machine = replace(machine, heads=(left, machine.heads[1]))
    team = Team(replace(teams[2].document, machine=machine), teams[2].source)
    up = {one.head: moves_of_text(one.text)[0]["Z"] for one in files_of(team, broken.state)}
    assert up["left"] == pytest.approx(up["right"] + 3.0)


def test_files_say_what_they_are(teams: dict[int, Team]) -> None:
    """Who runs one must know that it homes nothing, and where all others must stand."""
    (broken,) = broken_off(teams[4].document, [0.5])
    files = files_of(teams[4], broken.state, {"head-4": (720.0, 150.0, 0.3)})
    assert [path.name for path in park_paths(files, Path("rest"))] == [
        f"rest-{k}_{one.head}_to_park.gcode" for k, one in enumerate(files, 1)
    ]
    text = files[1].text.decode()
    assert f"; head {files[1].head}, file 2 of 3: to its park" in text
    assert "still knows where the head" in text
    assert f"head {files[0].head}, at its park" in text and "head head-4, fenced" in text
    codes = [line.split(";")[0].strip() for line in text.splitlines()]
    codes = [code for code in codes if code]
    assert codes[:2] == ["G21", "G90"] and codes[-1] == "M400"
    assert all(code.startswith("G1 ") and " F" in code and "E" not in code for code in codes[2:-1])
    assert codes[2].startswith("G1 Z")


# What the judge refuses -----------------------------------------------------


def judged(team: Team, state: PrintState, texts: Sequence[bytes]) -> Verdict:
    """The judge's word on files, from wherever heads may stand."""
    standing = {}
    for one, actions in zip(state.heads, team.document.plan.heads, strict=True):
        within = int(actions.contour[one.ended]) if one.begun and one.ended < len(actions) else -1
        line = whereabouts(one, actions, team.machine.head(one.head).park)
        standing[one.head] = Whereabouts(line, within)
    return check_to_park(texts, team.document, team.machine, state.done, standing)


@pytest.fixture(scope="session")
def sound(teams: dict[int, Team]) -> tuple[PrintState, list[bytes]]:
    """Files that the judge passes, of three heads within beads of the last layer."""
    (broken,) = broken_off(teams[3].document, [0.9])
    texts = [one.text for one in files_of(teams[3], broken.state)]
    assert len(texts) == 3 and judged(teams[3], broken.state, texts).ok
    return broken.state, texts


def numbered(texts: Sequence[bytes]) -> list[bytes]:
    """The texts with the places of their files in this order."""
    return [
        b"\n".join([text.split(b", file ")[0] + b", file %d of %d: to its park" % (k, len(texts)),
                    text.split(b"\n", 1)[1]])
        for k, text in enumerate(texts, 1)
    ]  # fmt: skip


def lines_of(text: bytes) -> list[bytes]:
    return text.splitlines(keepends=True)


def across_first(text: bytes) -> bytes:
    rows = lines_of(text)
    k = next(k for k, row in enumerate(rows) if row.startswith(b"G1 "))
    rows[k], rows[k + 1] = rows[k + 1], rows[k]
    return b"".join(rows)


@pytest.mark.parametrize(
    ("name", "change", "kind"),
    [
        ("across before up", lambda t: [across_first(t[0]), *t[1:]], FaultKind.COMMAND),
        ("another order", lambda t: numbered([t[1], t[0], t[2]]), FaultKind.RAIL),
        ("files swapped", lambda t: [t[1], t[0], t[2]], FaultKind.COMMAND),
        (
            "through the print",
            lambda t: [t[0].replace(b"Z1.600 F720\nG1 X", b"Z0.300 F720\nG1 X"), *t[1:]],
            FaultKind.HEAD_MATERIAL,
        ),
        ("one is missing", lambda t: numbered(t[:2]), FaultKind.NOT_PARKED),
        ("one ends elsewhere", lambda t: [t[0].replace(b"X-115", b"X-114"), *t[1:]],
         FaultKind.NOT_PARKED),
        ("inches", lambda t: [t[0].replace(b"G21", b"G20"), *t[1:]], FaultKind.COMMAND),
        ("relative", lambda t: [t[0].replace(b"G90", b"G91"), *t[1:]], FaultKind.COMMAND),
        ("homing", lambda t: [t[0].replace(b"G90", b"G90\nG28"), *t[1:]], FaultKind.COMMAND),
        ("filament", lambda t: [t[0].replace(b"Y150.000 F", b"Y150.000 E1 F"), *t[1:]],
         FaultKind.COMMAND),
        ("no feed", lambda t: [t[0].replace(b" F720", b""), *t[1:]], FaultKind.COMMAND),
        ("no such head", lambda t: [t[0].replace(b"head-1", b"head-9"), *t[1:]],
         FaultKind.COMMAND),
    ],
)  # fmt: skip
def test_a_spoilt_file_is_refused(
    teams: dict[int, Team], sound: tuple[PrintState, list[bytes]], name: str, change: object,
    kind: FaultKind,
) -> None:  # fmt: skip
    """Whatever planned it, nothing is written that is not safe."""
    state, texts = sound
    spoilt = change(texts)  # type: ignore[operator]
    assert spoilt != texts, name
    assert kind in judged(teams[3], state, spoilt).kinds()


def test_without_a_rail_bodies_count(
    teams: dict[int, Team], sound: tuple[PrintState, list[bytes]]
) -> None:
    """Exact shapes, where the planner has boxes."""
    state, texts = sound
    bare = Team(
        replace(teams[3].document, machine=replace(teams[3].machine, rails=())), teams[3][1]
    )
    assert judged(bare, state, texts).ok
    swapped = judged(bare, state, numbered([texts[1], texts[0], texts[2]]))
    assert swapped.kinds() >= {FaultKind.HEAD_HEAD}


def test_a_head_that_goes_up_into_what_hangs_over_it_is_refused(
    teams: dict[int, Team], sound: tuple[PrintState, list[bytes]]
) -> None:
    """Its bodies pass on the way up what they did not where it stood."""
    state, texts = sound
    document = teams[3].document
    h, one = 0, state.heads[0]
    line = whereabouts(one, document.plan.heads[h], (0.0, 0.0, 0.0))
    contours = document.contours
    row = int(np.flatnonzero(state.done)[0])
    points = contours.points.copy()
    rows = slice(int(contours.offsets[row]), int(contours.offsets[row + 1]))
    points[rows] = (*line[0, :2], line[0, 2] + 3.0)  # above the nozzle's body, 2.5 mm high
    low = replace(teams[3].machine.heads[h], bodies=teams[3].machine.heads[h].bodies[:1])
    machine = replace(teams[3].machine, heads=(low, *teams[3].machine.heads[1:]))
    odd = replace(document, contours=replace(contours, points=points), machine=machine)
    faults = judged(Team(odd, teams[3][1]), state, texts).faults
    assert any("meets what is printed" in fault.text for fault in faults)
