"""The partial order against reachability found the slow way."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.plan import ActionKind
from sim.rules.order import order_of


def random_actions(make, rng, sizes, edges):
    """Actions with random `after` edges that follow a random interleaving, so they are acyclic."""
    slots = [h for h, n in enumerate(sizes) for _ in range(n)]
    rng.shuffle(slots)
    seen, sequence = [0] * len(sizes), []
    for h in slots:
        sequence.append((h, seen[h]))
        seen[h] += 1
    waits = {key: [] for key in sequence}
    for _ in range(edges):
        i, j = sorted(rng.choice(len(sequence), 2, replace=False))
        if sequence[i][0] != sequence[j][0]:
            waits[sequence[j]].append(sequence[i])
    stay = np.zeros((1, 3))
    return tuple(
        make.actions_of_rows(
            f"h{h}",
            [(ActionKind.WAIT, -1, False)] * n,
            [stay] * n,
            [waits[h, a] for a in range(n)],
        )
        for h, n in enumerate(sizes)
    )


def reachable(all_actions):
    """All (head, action) pairs each action comes after, by plain search."""
    before = {}
    changed = True
    keys = [(h, a) for h in range(len(all_actions)) for a in range(len(all_actions[h]))]
    for key in keys:
        before[key] = set()
    while changed:
        changed = False
        for h, a in keys:
            direct = set(all_actions[h].after(a)) | ({(h, a - 1)} if a else set())
            total = direct | {k for d in direct for k in before[d]}
            if not total <= before[h, a]:
                before[h, a] |= total
                changed = True
    return before


@pytest.mark.parametrize("seed", range(5))
def test_windows_are_the_unordered_actions(make, seed):
    """[preceding, following) of an action is exactly what is ordered neither way."""
    rng = np.random.default_rng(seed)
    sizes = [int(n) for n in rng.integers(1, 8, 3)]
    all_actions = random_actions(make, rng, sizes, edges=6)
    order, before = order_of(all_actions), reachable(all_actions)
    for r in range(3):
        for s in range(3):
            if r == s:
                continue
            low, high = order.preceding(r, s), order.following(r, s)
            for u in range(sizes[r]):
                free = {
                    v for v in range(sizes[s])
                    if (s, v) not in before[r, u] and (r, u) not in before[s, v]
                }  # fmt: skip
                assert free == set(range(low[u], high[u]))


def test_the_sequence_keeps_the_order(make):
    """Replays execute actions in this sequence, so nothing may come before what it waits for."""
    all_actions = random_actions(make, np.random.default_rng(3), [6, 5], edges=8)
    order, before = order_of(all_actions), reachable(all_actions)
    seen = set()
    for h, a in order.sequence.tolist():
        assert before[h, a] <= seen
        seen.add((h, a))


def test_waiting_for_a_later_action_of_oneself_is_a_deadlock(make):
    """The head can never reach what it waits for; the action is named."""
    stay = [np.zeros((1, 3))] * 2
    rows = [(ActionKind.WAIT, -1, False)] * 2
    all_actions = (
        make.actions_of_rows("a", rows, stay, [[(0, 1)], []]),
        make.actions_of_rows("b", rows, stay, [[], []]),
    )
    assert order_of(all_actions) == [(0, 0)]


def test_clocks_say_how_many_of_each_head_have_ended(make):
    """Between two actions that wait the clock stands still, whatever the others do."""
    rng = np.random.default_rng(5)
    for edges in (0, 1, 4, 40):
        all_actions = random_actions(make, rng, [9, 7, 1], edges=edges)
        order, before = order_of(all_actions), reachable(all_actions)
        for h, clocks in enumerate(order.clocks):
            assert clocks.shape == (len(all_actions[h]), 3)
            for a, clock in enumerate(clocks.tolist()):
                ended = [sum(head == s for head, _ in before[h, a]) for s in range(3)]
                assert clock == ended
