"""What the judge says of points, against all timings of small plans tried one by one."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.plan import ACTION_END, ActionKind, JointPlan
from sim.content.paths import legs_of
from sim.replay.bodies import check_heads, check_rail
from sim.rules.order import PartialOrder, order_of
from sim.verify import all_actions_of

BEAMS_MM, RAIL_MM = 21.0, 25.0  # how far apart the two heads of `two_head_machine` must be
PARKS = (-40.0, 240.0)


def random_plan(make, rng, *, rail: bool):
    """Two heads that go to and fro along x and wait for points of one another."""
    sizes, machine = rng.integers(1, 4, 2), make.two_head_machine(rail=rail)
    stops = []
    for h, n in enumerate(sizes.tolist()):
        inner = rng.integers(-2, 9, (n, 3)) * 10.0 + (0.0, 70.0)[h]
        ends = np.concatenate([[PARKS[h]], inner[:-1, -1]])
        stops.append([np.array([e, *row]) for e, row in zip(ends, inner, strict=True)])
        stops[h][-1][-1] = PARKS[h]
    slots = rng.permutation(np.repeat([0, 1], sizes)).tolist()
    sequence = [(h, slots[:i].count(h)) for i, h in enumerate(slots)]
    waits = {key: [] for key in sequence}
    for (h, a), (g, b) in itertools.combinations(sequence, 2):
        if g != h and rng.random() < 0.7:
            waits[g, b].append((h, a, int(rng.choice([ACTION_END, 1, 2, 3]))))
    all_actions = tuple(
        make.actions_of_rows(
            machine.heads[h].name,
            [(ActionKind.TRAVEL, -1, False)] * len(stops[h]),
            [np.column_stack([x, np.full(4, 50.0), np.full(4, 20.0)]) for x in stops[h]],
            [waits[h, a] for a in range(len(stops[h]))],
        )
        for h in range(2)
    )
    return replace(make.shared_plan(rail=rail), machine=machine, plan=JointPlan(all_actions))


def meets(all_actions, *, rail: bool) -> bool:
    """Try every timing: each head rests or moves on, one move at a time.

    On a rail the heads may not pass one another.

    A head's state is the number of half moves made; odd ones are on the way.
    """
    moves, least_mm = [3 * len(actions) for actions in all_actions], RAIL_MM if rail else BEAMS_MM

    def may_begin(h: int, state: int, other: int) -> bool:
        if state % 6 or state == 2 * moves[h]:
            return True
        for edge in all_actions[h].after_edges(state // 6):
            point = 3 if edge.point == ACTION_END else edge.point
            if other < 2 * (3 * edge.action + point):
                return False
        return True

    def reach(h: int, state: int) -> tuple[float, float]:
        stops = np.concatenate(
            [[PARKS[h]], all_actions[h].path[:, 0].reshape(-1, 4)[:, 1:].ravel()]
        )
        ends = stops[state // 2], stops[(state + 1) // 2]
        return float(min(ends)), float(max(ends))

    todo, seen = [(0, 0)], {(0, 0)}
    while todo:
        i, j = todo.pop()
        right, left = reach(1, j)[0] - reach(0, i)[1], reach(0, i)[0] - reach(1, j)[1]
        if right < least_mm and (rail or left < least_mm):
            return True
        steps = [(i + 1, j)] if i < 2 * moves[0] and may_begin(0, i, j) else []
        steps += [(i, j + 1)] if j < 2 * moves[1] and may_begin(1, j, i) else []
        todo += [step for step in steps if step not in seen]
        seen.update(steps)
    return False


@pytest.mark.parametrize(
    ("rail", "seeds"), [(True, 25), pytest.param(False, 60, marks=pytest.mark.slow)]
)
def test_the_verdict_is_that_of_all_timings(make, rail, seeds):
    """No plan passes that can collide, and none is refused that cannot."""
    verdicts = []
    for seed in range(seeds):
        document = random_plan(make, np.random.default_rng(seed), rail=rail)
        all_actions = all_actions_of(document)
        legs = legs_of(all_actions)
        order = order_of(legs.all_actions)
        assert isinstance(order, PartialOrder)
        check = check_rail if rail else check_heads
        found = bool(check(document, legs, order))
        assert found == meets(all_actions, rail=rail), seed
        verdicts.append(found)
    assert seeds // 4 < sum(verdicts) < 3 * seeds // 4 + 1  # enough of both kinds
