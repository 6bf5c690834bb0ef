"""Joint plans sent while planning: which of them are worth judging, and when.

A plan that was sent binds nobody and may be a lie, and judging one costs as much as a step
of planning. So each peer's latest is kept, the one with the smallest claim is
judged once, and only every so often. No messages, no planner, no clock here.
"""

from __future__ import annotations

from agents.messages.kinds import Joint

JUDGE_S = 0.5  # at most so often such a plan is judged: twice a second

JUDGING = 0.2
"""At most this share of the time goes into judging: of a large print a plan takes a second."""

SEND_S = 1.0  # at most so often our own best is sent
REPEAT_S = 5.0  # so often it is sent again though it is no better: messages may be lost


class Offers:
    """What peers sent last, and what we sent."""

    def __init__(self) -> None:
        self._waiting: dict[int, Joint] = {}
        self._judge_from = self._sent_s = float("-inf")
        self._sent = Joint((0,), {}, 0.0)

    def add(self, head: int, joint: Joint) -> None:
        """Keep a peer's latest."""
        self._waiting[head] = joint

    def next(self, best_s: float, live: tuple[int, ...], now_s: float) -> tuple[int, Joint] | None:
        """Return the plan to judge now, with who sent it, and drop what is no better than ours."""
        if now_s < self._judge_from or not self._waiting:
            return None
        better = {
            h: j for h, j in self._waiting.items() if j.live == live and j.makespan_s < best_s
        }
        self._waiting = {}
        if not better:
            return None
        self._judge_from = now_s + JUDGE_S
        head = min(better, key=lambda h: (better[h].makespan_s, h))
        return head, better[head]

    def judged(self, began_s: float, now_s: float) -> None:
        """Note how long judging the last one took."""
        self._judge_from = max(self._judge_from, began_s + (now_s - began_s) / JUDGING)

    def is_worth_sending(self, joint: Joint, now_s: float) -> bool:
        """Whether to send this plan now; if so it counts as sent."""
        known = self._sent.live == joint.live and self._sent.makespan_s <= joint.makespan_s
        if now_s - self._sent_s < (REPEAT_S if known else SEND_S):
            return False
        self._sent, self._sent_s = joint, now_s
        return True
