"""When each agent last gave a sign of life, and what its silence means.

There are two: **words**, from the thread that plans, and **pulses**, from a thread
beside it that does nothing else. A stopped process gives neither. A long round, or a planner
that is stuck, has a pulse and no words. No processes here, and no clock.
"""

from __future__ import annotations

from agents.launching.limits import GRACE_S, HUNG_S


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
