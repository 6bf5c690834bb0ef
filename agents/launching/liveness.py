"""When each agent last gave a sign of life, and what its silence means.

There are two: **words**, from the thread that plans, and **pulses**, from a thread
beside it that does nothing else. A stopped process gives neither. A long round, or a planner
that is stuck, has a pulse and no words. No processes here, and no clock.

The longest that agents can take, from when all are ready, is the time for planning and
`AGREE_LIMIT_S`, or `HUNG_S` where all are stopped; `AFTER_FENCE_S` more where a head is given
up at the end of that. Only rounds of more than `AGREE_LIMIT_S / AGREE_ROUNDS` make it longer.
"""

from __future__ import annotations


class Liveness:
    """Times at which agents gave a sign of life."""

    def __init__(self) -> None:
        self._alive_at: dict[int, float] = {}
        self._word_at: dict[int, float] = {}
        self._gaps: dict[int, list[float]] = {}  # the two longest between words, ascending

    def take_word(self, head: int, now: float, *, plans: bool) -> None:
        """Take in a word; gaps between words count while an agent plans."""
        if plans and head in self._word_at:
            self._gaps[head] = sorted([*self._gaps.get(head, []), now - self._word_at[head]])[-2:]
        self._alive_at[head] = self._word_at[head] = now

    def take_pulse(self, head: int, now: float) -> None:
        """Take in a pulse."""
        self._alive_at[head] = now

    def forget(self, head: int) -> None:
        """Drop the times of an agent: another process is in its place."""
        self._alive_at.pop(head, None)
        self._word_at.pop(head, None)

    def is_alive(self, head: int, now: float) -> bool:
        """Whether an agent gave a sign of life just now."""
        return now - self._alive_at.get(head, -float("inf")) <= GRACE_S

    def has_word_since(self, head: int, then: float) -> bool:
        """Whether a word of an agent came after some time."""
        return self._word_at.get(head, -float("inf")) > then

    def was_alive(self, head: int) -> bool:
        """Whether an agent ever gave a sign of life."""
        return head in self._alive_at

    def is_hung(self, head: int, now: float) -> bool:
        """Whether an agent that was alive before is silent for too long."""
        return head in self._alive_at and now - self._alive_at[head] > HUNG_S

    def longest_round_s(self) -> float:
        """Return how long any agent needs from word to word: its second longest gap.

        The longest may be a pause: the process was stopped, or the machine slept.
        """
        return max((gaps[0] for gaps in self._gaps.values() if len(gaps) > 1), default=0.0)


GRACE_S = 2.0  # who was heard since so long ago speaks: four pulses, and twice the lease of links

HUNG_S = 8.0
"""Who is not heard for so long is stopped, and counts as dead: longer than any pause that
people make by accident, and short beside a print."""

START_LIMIT_S = 180.0  # to load the problem and compile; a head that takes longer is fenced

UNHEARD_S = 12.0
"""Until the first sign of life of a process, and a second more for each head. Once another
agent is ready, `HUNG_S` and half a second for each head: all begin at the same time."""

AGREE_LIMIT_S = 10.0
"""From the first agent that ends planning to the release, and `AGREE_HEAD_S` for each head
above two. Where rounds are long, so many of them: an agent is told of the others' end only
after its round, and then resolves their plans."""

AGREE_HEAD_S = 2.0

AGREE_ROUNDS = 8.0

RETURN_S = 15.0
"""The others wait so long, from the end of planning, for an agent that was started again: it
loads for seconds, and with its head a print may take half the time."""

LATE_LIMIT_S = 120.0
"""From the end of the time for planning until some agent says that it ended: a last resort,
for rounds that take very long."""

FOLLOW_LIMIT_S = 5.0
"""From the first release to the last: by then every live head has agreed, so one
that says nothing any more is dead or stopped."""

AFTER_FENCE_S = 3.0  # what is left to agree on after a head was given up, at least

MEET_S = 3.0
"""Agents that speak but miss each other for so long meet elsewhere, at most `MOST_MOVES` times."""

MEET_HEAD_S = 1.0
"""So much longer for each head above two: many need longer to find each other, and on a
host with few processors they lose each other for a moment now and then."""

MOST_MOVES = 2
