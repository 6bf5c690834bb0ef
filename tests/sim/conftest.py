"""Small prints and plans made by hand, without any planner."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from decmcts.print.contours import Contours
from decmcts.print.machine import Body, Head, Machine, MotionLimits, Rail, Slice
from decmcts.print.plan import (
    ACTION_END,
    NO_CONTOUR,
    ActionKind,
    After,
    HeadActions,
    JointPlan,
    PlanDocument,
)
from sim.content.paths import check_structure, legs_of
from sim.replay.execution import execute
from sim.replay.least import least_arrivals, with_waits
from sim.rules.order import PartialOrder, order_of

LAYER = 0.2
FAST = MotionLimits(  # actions made by hand take a second
    max_feed=(1e4, 1e4, 1e3, 60.0), max_acceleration=(1e7, 1e7, 1e5, 5000.0)
)


def box(half: float) -> np.ndarray:
    return np.array([[-half, -half], [half, -half], [half, half], [-half, half]])


def contours_of(polylines, *, width=0.4, height=LAYER, tool=None) -> Contours:
    """Contours from (k, 3) polylines, one E a mm, 30 mm/s."""
    n = len(polylines)
    points = np.concatenate([np.asarray(p, float) for p in polylines])
    offsets = np.cumsum([0, *(len(p) for p in polylines)]).astype(np.int64)
    extrusion = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1)])
    feed = np.full(len(points), 30.0)
    extrusion[offsets[:-1]] = feed[offsets[:-1]] = 0.0
    closed = [bool(np.allclose(p[0], p[-1])) for p in polylines]
    layer = [round(p[0][2] / height) - 1 for p in polylines]
    return Contours(
        points, offsets, extrusion, feed, np.full(n, width), np.full(n, height),
        np.ones(n, np.int8), np.array(closed, bool), np.array(layer, np.int32),
        np.array(tool if tool is not None else [0] * n, np.int16), np.ones(n, bool),
        np.zeros(n, np.int32), np.zeros(n, np.int32),
    )  # fmt: skip


def square(x: float, y: float, z: float, side: float = 4.0) -> np.ndarray:
    corners = [[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]]
    return np.array([[*c, z] for c in corners])


def head_actions(head: Head, visits, paths, index: int, *, clearance_z: float, after=None):
    """Actions that lift to `clearance_z`, go, lower and print, then park.

    `after` maps a position in `visits` to what its travel waits for.
    """
    rows, polylines, waits = [], [], []
    at = np.array(head.park, float)
    for k, (contour, is_reversed) in enumerate(visits):
        path = paths[contour][::-1] if is_reversed else paths[contour]
        rows.append((ActionKind.TRAVEL, NO_CONTOUR, False))
        polylines.append(lift(at, path[0], clearance_z))
        waits.append((after or {}).get(k, []))
        rows.append((ActionKind.PRINT, contour, is_reversed))
        polylines.append(np.asarray(path, float))
        waits.append([])
        at = path[-1]
    rows.append((ActionKind.PARK, NO_CONTOUR, False))
    polylines.append(lift(at, np.array(head.park, float), clearance_z))
    waits.append((after or {}).get(len(visits), []))
    return actions_of_rows(head.name, rows, polylines, waits)


def lift(start, goal, z) -> np.ndarray:
    z = max(z, start[2], goal[2])
    return np.array([start, [*start[:2], z], [*goal[:2], z], goal], float)


def actions_of_rows(name, rows, polylines, waits) -> HeadActions:
    kind, contour, is_reversed = zip(*rows, strict=True)
    waits = [[After(*edge) for edge in w] for w in waits]
    flat = [edge for w in waits for edge in w]
    edges = np.array(flat, float).reshape(-1, 4)
    k = len(rows)
    begin = np.zeros(k)
    for a in range(k):  # one second each; others are taken to need as long
        begin[a] = max([begin[a - 1] + 1 if a else 0, *(e.action + 1 + e.lag_s for e in waits[a])])
    return HeadActions(
        name, np.array(kind, np.int8), np.array(contour, np.int32), np.array(is_reversed, bool),
        np.zeros(k, np.int32), np.cumsum([0, *(len(p) for p in polylines)]).astype(np.int64),
        np.concatenate(polylines), begin, begin + 1.0,
        np.cumsum([0, *(len(w) for w in waits)]).astype(np.int64),
        *edges[:, :3].T.astype(np.int32), edges[:, 3].copy(),
    )  # fmt: skip


def one_head_machine(half: float = 7.0) -> Machine:
    head = Head("head", (Slice(0.0, (box(half),)),), park=(-20.0, -20.0, 20.0))
    return Machine("paper", (0.0, 0.0), (200.0, 200.0), (head,), limits=FAST)


def two_head_machine(*, rail: bool = True) -> Machine:
    slices = (Slice(0.0, (box(2.0),)), Slice(5.0, (box(10.0),)))
    bodies = (Body("beam", (-10.0, -300.0, 30.0), (10.0, 300.0, 60.0)),)
    left = Head("left", slices, bodies, park=(-40.0, 50.0, 20.0))
    right = Head("right", slices, bodies, park=(240.0, 50.0, 20.0))
    return Machine(
        "two", (0.0, 0.0), (200.0, 200.0), (left, right), head_clearance_mm=1.0, limits=FAST,
        rails=(Rail(0, ("left", "right"), 25.0),) if rail else (), rest_s=0.0,
    )  # fmt: skip


def tower_plan(layers: int = 5, towers=((20.0, 20.0), (60.0, 20.0)), half: float = 7.0):
    """One head prints towers one after the other; far enough apart to be allowed."""
    machine = one_head_machine(half)
    paths = [square(x, y, LAYER * (k + 1)) for k in range(layers) for x, y in towers]
    n = len(towers)
    order = [k * n + t for t in range(n) for k in range(layers)]
    z = LAYER * layers + 0.2
    actions = head_actions(machine.heads[0], [(c, False) for c in order], paths, 0, clearance_z=z)
    pairs = [(k * n + t, (k + 1) * n + t) for k in range(layers - 1) for t in range(n)]
    return PlanDocument(
        "", machine, contours_of(paths), np.array(pairs, np.int32).reshape(-1, 2),
        JointPlan((actions,)), {},
    )  # fmt: skip


def two_head_plan(layers: int = 4, *, rail: bool = True, meet: bool = True):
    """Each head prints a tower of its own; then the right head one in the left one's half.

    The last tower is printed only after the left head has parked.
    """
    machine = two_head_machine(rail=rail)
    places = [(20.0, 50.0), (150.0, 50.0), (40.0, 80.0)]
    paths = [square(x, y, LAYER * (k + 1)) for x, y in places for k in range(layers)]
    z = LAYER * layers + 0.2
    left = head_actions(
        machine.heads[0], [(k, False) for k in range(layers)], paths, 0, clearance_z=z
    )
    work = list(range(layers, 3 * layers if meet else 2 * layers))
    after = {layers: [(0, 2 * layers)]} if meet else {}
    right = head_actions(
        machine.heads[1], [(c, False) for c in work], paths, 1, clearance_z=z, after=after
    )
    count = 3 if meet else 2
    paths = paths[: count * layers]
    pairs = [(t * layers + k, t * layers + k + 1) for t in range(count) for k in range(layers - 1)]
    return PlanDocument(
        "", machine, contours_of(paths), np.array(pairs, np.int32).reshape(-1, 2),
        JointPlan((left, right)), {},
    )  # fmt: skip


def shared_plan(after=((0, 1, 5),), *, rail: bool = True):
    """The left head prints a line from x = 100 to 20, the right one meanwhile from 80 to 120.

    The right head's first travel waits for `after`; the left one's nozzle is at x = 100 - 10 k
    at point k of its action 1, and 50 is far enough away.
    """
    machine = replace(two_head_machine(rail=rail), release="point")
    paths = [
        np.array([[100.0 - 10 * k, 50.0, LAYER] for k in range(9)]),
        np.array([[80.0 + 10 * k, 80.0, LAYER] for k in range(5)]),
    ]
    left = head_actions(machine.heads[0], [(0, False)], paths, 0, clearance_z=1.0)
    right = head_actions(
        machine.heads[1], [(1, False)], paths, 1, clearance_z=1.0, after={0: list(after)}
    )
    pairs = np.zeros((0, 2), np.int32)
    return timed(PlanDocument("", machine, contours_of(paths), pairs, JointPlan((left, right)), {}))


def stacked_plan(*after, first=()):
    """The plan of `shared_plan`; then the right head prints line 2, on top of the left one's.

    Its way to line 2 waits for `after`, to line 1 (40 s) for `first`, too; the rule is 20 s.
    """
    document = shared_plan()
    machine, old = document.machine, document.contours
    over = old.polyline(0) + np.array([0.0, 0.0, LAYER])
    paths = [old.polyline(0), old.polyline(1), over]
    feed = np.where(np.repeat(np.arange(3), [9, 5, 9]) == 1, 1.0, 30.0)
    right = head_actions(
        machine.heads[1], [(1, False), (2, False)], paths, 1, clearance_z=1.0,
        after={0: [(0, 1, 5), *first], 1: list(after)},
    )  # fmt: skip
    contours = replace(contours_of(paths), feed=feed)
    plan = JointPlan((document.plan.heads[0], right))
    return timed(replace(document, contours=contours, plan=plan, min_layer_time_s=20.0))


def arrivals_of(document: PlanDocument, actions: HeadActions) -> np.ndarray:
    """Seconds from the begin of its action to each point of a head's paths."""
    return with_waits(actions, least_arrivals(document, actions, None, rests=True))


def timed(document: PlanDocument, more_s: float = 1.0) -> PlanDocument:
    """The plan with times that its motion and its waits allow, some more for each action."""
    if check_structure(document):
        return document
    all_actions = document.plan.heads
    legs = legs_of(all_actions)
    order = order_of(legs.all_actions)
    if not isinstance(order, PartialOrder):
        return document
    seconds = []
    for h, actions in enumerate(all_actions):
        passed = legs.arrivals(h, arrivals_of(document, actions))
        seconds.append(more_s + passed[legs.all_actions[h].path_offsets[1:] - 1])
    begin = execute(legs.all_actions, order, seconds)
    made = []
    for h, actions in enumerate(all_actions):
        ends, legs_at = begin[h] + seconds[h], np.arange(len(actions))
        first = np.searchsorted(legs.origin[h], legs_at)
        last = np.searchsorted(legs.origin[h], legs_at, side="right") - 1
        made.append(replace(actions, begin_s=begin[h][first], end_s=ends[last]))
    return replace(document, plan=JointPlan(tuple(made)))


def actions_with_points(rng, points=4):
    """Actions of three heads whose random edges name points and follow a random interleaving."""
    sizes = rng.integers(1, 6, 3)
    slots = rng.permutation(np.repeat(np.arange(3), sizes)).tolist()
    seen, sequence = [0, 0, 0], []
    for h in slots:
        sequence.append((h, seen[h]))
        seen[h] += 1
    waits = {key: [] for key in sequence}
    for _ in range(8 if len(sequence) > 1 else 0):
        i, j = sorted(rng.choice(len(sequence), 2, replace=False))
        if sequence[i][0] != sequence[j][0]:
            point = int(rng.choice([ACTION_END, *range(1, points)]))
            waits[sequence[j]].append((*sequence[i], point))
    path = np.arange(points)[:, None] * np.ones(3)
    return tuple(
        actions_of_rows(
            f"h{h}", [(ActionKind.TRAVEL, -1, False)] * n, [path] * n,
            [waits[h, a] for a in range(n)],
        )
        for h, n in enumerate(sizes.tolist())
    )  # fmt: skip


def to_rows(actions: HeadActions) -> list[dict]:
    """The actions of a head as mutable rows, for tests that spoil one."""
    return [
        {
            "kind": ActionKind(int(actions.kind[a])),
            "contour": int(actions.contour[a]),
            "reversed": bool(actions.reversed[a]),
            "entry": int(actions.entry[a]),
            "path": actions.action_path(a).copy(),
            "after": actions.after_edges(a),
            "begin_s": float(actions.begin_s[a]),
            "end_s": float(actions.end_s[a]),
        }
        for a in range(len(actions))
    ]


def from_rows(name: str, rows: list[dict]) -> HeadActions:
    made = actions_of_rows(
        name,
        [(r["kind"], r["contour"], r["reversed"]) for r in rows],
        [r["path"] for r in rows],
        [r["after"] for r in rows],
    )
    return replace(
        made,
        entry=np.array([r["entry"] for r in rows], np.int32),
        begin_s=np.array([r["begin_s"] for r in rows]),
        end_s=np.array([r["end_s"] for r in rows]),
    )


def edited(document: PlanDocument, head: int, change) -> PlanDocument:
    """The plan with the rows of one head changed by `change(rows)`, which may return new rows."""
    rows = to_rows(document.plan.heads[head])
    rows = change(rows) or rows
    all_actions = list(document.plan.heads)
    all_actions[head] = from_rows(all_actions[head].head, rows)
    return replace(document, plan=JointPlan(tuple(all_actions)))


@pytest.fixture
def make():
    """The builders of this file, for tests that need another shape of print."""
    return SimpleNamespace(
        contours_of=contours_of, square=square, head_actions=head_actions,
        actions_of_rows=actions_of_rows, lift=lift,
        one_head_machine=one_head_machine, two_head_machine=two_head_machine,
        tower_plan=tower_plan, two_head_plan=two_head_plan, shared_plan=shared_plan,
        stacked_plan=stacked_plan, edited=edited, timed=timed, arrivals_of=arrivals_of,
        to_rows=to_rows, from_rows=from_rows, actions_with_points=actions_with_points,
    )  # fmt: skip
