"""When the launcher last heard of each agent, and what its silence means.

Two things are heard: **words**, from the thread that plans, and **pulses**, from a thread
beside it that does nothing else. A stopped process says neither. A long round, or a planner
that is stuck, has a pulse and no words. No processes here, and no clock.
"""

from __future__ import annotations

from agents.launching.limits import GRACE_S, HUNG_S


class Hearing:
    """Times at which agents were heard."""

    def __init__(self) -> None:
        self._heard_at: dict[int, float] = {}
        self._word_at: dict[int, float] = {}
        self._gaps: dict[int, list[float]] = {}  # the two longest between words, ascending

    def hear(self, head: int, now: float, *, plans: bool) -> None:
        """Take in a word; gaps between words count while an agent plans."""
        if plans and head in self._word_at:
            self._gaps[head] = sorted([*self._gaps.get(head, []), now - self._word_at[head]])[-2:]
        self._heard_at[head] = self._word_at[head] = now

    def feel(self, head: int, now: float) -> None:
        """Take in a pulse."""
        self._heard_at[head] = now

    def forget(self, head: int) -> None:
        """Drop what was heard of an agent: another process is in its place."""
        self._heard_at.pop(head, None)
        self._word_at.pop(head, None)

    def speaks(self, head: int, now: float) -> bool:
        """Whether an agent was heard just now."""
        return now - self._heard_at.get(head, -float("inf")) <= GRACE_S

    def heard_since(self, head: int, then: float) -> bool:
        """Whether an agent said a word after some time."""
        return self._word_at.get(head, -float("inf")) > then

    def was_heard(self, head: int) -> bool:
        """Whether an agent ever showed a sign of life."""
        return head in self._heard_at

    def is_hung(self, head: int, now: float) -> bool:
        """Whether an agent that was heard before is silent for too long."""
        return head in self._heard_at and now - self._heard_at[head] > HUNG_S

    def longest_round_s(self) -> float:
        """Return how long any agent needs from word to word: its second longest gap.

        The longest may be a pause: the process was stopped, or the machine slept.
        """
        return max((gaps[0] for gaps in self._gaps.values() if len(gaps) > 1), default=0.0)
