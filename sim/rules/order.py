"""The partial order of a joint plan: what precedes what, for every timing.

Each head executes its actions in sequence, so a head is a chain. For each action one number
per head suffices: how many of that head's actions have ended before this one begins. These
are vector clocks. Actions that others wait for midway come here as
legs (`sim.content.legs`). Lags only delay, so no timing is lost by leaving them out.

References
----------
Fidge 1988, "Timestamps in message-passing systems that preserve the partial
ordering"; Mattern 1988, "Virtual time and global states of distributed systems".
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.print.plan import ACTION_END, HeadActions


@dataclass(frozen=True, slots=True)
class PartialOrder:
    """Vector clocks of every action, and one sequence all orders agree with."""

    clocks: tuple[NDArray[np.int64], ...]  # per head (k, n_heads); own column: own index
    sequence: NDArray[np.int64]  # (n_actions, 2) rows (head, action), a linear extension

    def preceding(self, head: int, other: int) -> NDArray[np.int64]:
        """Return how many actions of `other` have ended before each action of `head` begins."""
        return self.clocks[head][:, other]

    def following(self, head: int, other: int) -> NDArray[np.int64]:
        """Return the first action of `other` that begins after each action of `head` ended.

        It is the number of actions of `other` where none does.
        """
        own = np.arange(1, len(self.clocks[head]) + 1)
        return np.searchsorted(self.clocks[other][:, head], own, side="left").astype(np.int64)


def order_of(heads: tuple[HeadActions, ...]) -> PartialOrder | list[tuple[int, int]]:
    """Return the partial order, or the actions that can never begin (a deadlock).

    Complexity O(actions + after edges), times the number of heads.

    Raises
    ------
    ValueError
        When an action waits for a point within another: cut them into legs first.
    """
    if any((head.after_point != ACTION_END).any() for head in heads):
        raise ValueError("actions that are waited for midway have to be cut into legs")
    clocks = [np.zeros((len(h), len(heads)), np.int64) for h in heads]
    done = [0] * len(heads)
    sequence: list[tuple[int, int]] = []
    waiting: dict[tuple[int, int], list[int]] = {}
    ready = deque(range(len(heads)))
    while ready:
        head = ready.popleft()
        while done[head] < len(heads[head]):
            action = done[head]
            blocker = _first_unmet(heads[head], action, done)
            if blocker is not None:
                waiting.setdefault(blocker, []).append(head)
                break
            _stamp(clocks, heads[head], head, action)
            sequence.append((head, action))
            done[head] += 1
            ready.extend(waiting.pop((head, action), ()))
    stuck = [(h, done[h]) for h in range(len(heads)) if done[h] < len(heads[h])]
    return stuck or PartialOrder(tuple(clocks), np.array(sequence, np.int64).reshape(-1, 2))


def _first_unmet(head: HeadActions, action: int, done: list[int]) -> tuple[int, int] | None:
    """Return an `after` of the action that has not ended yet."""
    for other, index in head.after(action):
        if index >= done[other]:
            return other, index
    return None


def _stamp(clocks: list[NDArray[np.int64]], actions: HeadActions, head: int, action: int) -> None:
    """Write the clock of one action: the maximum over all it waits for."""
    clock = clocks[head][action]
    if action:
        clock[:] = clocks[head][action - 1]
    for other, index in actions.after(action):
        np.maximum(clock, clocks[other][index], out=clock)
        clock[other] = max(clock[other], index + 1)
    clock[head] = action
