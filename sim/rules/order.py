"""The partial order of a joint plan: what precedes what, for every timing.

Each head executes its actions in sequence, so a head is a chain. For each action one number
per head suffices: how many of that head's actions have ended before this one begins. These
are vector clocks. Actions that others wait for midway come here as
legs (`sim.content.paths`). Lags only delay, so no timing is lost by leaving them out.

References
----------
Fidge 1988, "Timestamps in message-passing systems that preserve the partial
ordering"; Mattern 1988, "Virtual time and global states of distributed systems".
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Ints
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions


@dataclass(frozen=True, slots=True)
class PartialOrder:
    """Vector clocks of every action, and one sequence all orders agree with."""

    clocks: tuple[Ints, ...]  # per head (k, n_heads); own column: own index
    sequence: Ints  # (n_actions, 2) rows (head, action), a linear extension

    def preceding(self, head: int, other: int) -> Ints:
        """Return how many actions of `other` have ended before each action of `head` begins."""
        return self.clocks[head][:, other]

    def following(self, head: int, other: int) -> Ints:
        """Return the first action of `other` that begins after each action of `head` ended.

        It is the number of actions of `other` where none does.
        """
        own = np.arange(1, len(self.clocks[head]) + 1)
        return np.searchsorted(self.clocks[other][:, head], own, side="left").astype(np.int64)


def early(
    all_actions: tuple[HeadActions, ...], order: PartialOrder,
    due: Callable[[HeadActions, Ints], Ints],
) -> Ints:  # fmt: skip
    """Return the contours that may begin before what they must follow has ended, ascending.

    `due` has of a head's actions the last that each of some contours must follow; -1: none.
    """
    found = [np.empty(0, np.int64)]
    for r, actions in enumerate(all_actions):
        prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
        contour = actions.contour[prints].astype(np.int64)
        for s, other in enumerate(all_actions):
            found.append(contour[order.preceding(r, s)[prints] <= due(other, contour)])
    return np.unique(np.concatenate(found))


def order_of(heads: tuple[HeadActions, ...]) -> PartialOrder | list[tuple[int, int]]:
    """Return the partial order, or the actions that can never begin (a deadlock).

    Between two actions that wait for others a head's clock stands still, so only the
    actions that wait are looked at one by one.

    Complexity O(actions + after edges * log(actions)), times the number of heads.

    Raises
    ------
    ValueError
        When an action waits for a point within another: cut them into legs first.
    """
    if any((head.after_point != ACTION_END).any() for head in heads):
        raise ValueError("actions that are waited for midway have to be cut into legs")
    chains = [_Chain(head, h, len(heads)) for h, head in enumerate(heads)]
    runs: list[Ints] = [np.empty((0, 2), np.int64)]  # (head, action) in order
    waiting: dict[tuple[int, int], list[int]] = {}
    ready = deque(range(len(heads)))
    while ready:
        chain = chains[ready.popleft()]
        begun = chain.done
        blocker = chain.advance(chains)
        if blocker is not None:
            waiting.setdefault(blocker, []).append(chain.head)
        run = np.arange(begun, chain.done)
        runs.append(np.stack([np.full_like(run, chain.head), run], axis=1))
        for key in sorted(k for k in waiting if k[0] == chain.head and k[1] < chain.done):
            ready.extend(waiting.pop(key))
    stuck = [(chain.head, chain.done) for chain in chains if chain.done < chain.size]
    return stuck or PartialOrder(
        tuple(chain.clocks() for chain in chains), np.concatenate(runs).astype(np.int64)
    )


class _Chain:
    """One head's actions while their clocks are found, and how many have one."""

    def __init__(self, actions: HeadActions, head: int, n_heads: int) -> None:
        self.head, self.size, self.done = head, len(actions), 0
        self.waits: list[int] = np.flatnonzero(np.diff(actions.after_offsets)).tolist()
        self.edges = [actions.after(k) for k in self.waits]
        self.stamped = [[0] * n_heads]  # clocks: before the first wait, and from each on

    def advance(self, chains: list[_Chain]) -> tuple[int, int] | None:
        """Do what can be done; return what the next action still waits for, or None at the end."""
        while len(self.stamped) <= len(self.waits):
            nth = len(self.stamped) - 1
            self.done = self.waits[nth]
            for other, index in self.edges[nth]:
                if index >= chains[other].done:
                    return other, index
            clock = self.stamped[-1]
            for other, index in self.edges[nth]:  # the maximum over all it waits for
                clock = list(map(max, clock, chains[other].clock(index)))
                clock[other] = max(clock[other], index + 1)
            self.stamped.append(clock)
            self.done += 1
        self.done = self.size
        return None

    def clock(self, action: int) -> list[int]:
        """Return the clock of one action that has one."""
        clock = list(self.stamped[bisect_right(self.waits, action)])
        clock[self.head] = action
        return clock

    def clocks(self) -> Ints:
        """Return the clocks of all actions, (k, n_heads)."""
        lasts = np.diff([0, *self.waits, self.size])
        clocks = np.repeat(np.array(self.stamped, np.int64), lasts, axis=0)
        clocks[:, self.head] = np.arange(self.size)
        return clocks
