"""Which told joint plans are judged, which are told."""

from __future__ import annotations

from agents.loop.offers import JUDGE_S, JUDGING, REPEAT_S, SEND_S, Offers
from agents.messages.kinds import Joint

LIVE = (0, 1, 2)


def joint(makespan_s: float, live: tuple[int, ...] = LIVE) -> Joint:
    return Joint(live, {}, makespan_s)


def test_the_smallest_claim_is_judged_once() -> None:
    """Every judgement costs a step of planning."""
    offers = Offers()
    offers.add(1, joint(8.0))
    offers.add(2, joint(7.0))
    chosen = offers.next(9.0, LIVE, 0.0)
    assert chosen is not None and (chosen[0], chosen[1].makespan_s) == (2, 7.0)
    assert offers.next(9.0, LIVE, 100.0) is None


def test_what_claims_to_be_no_better_is_not_judged() -> None:
    """All heads tell the same plan again and again."""
    offers = Offers()
    offers.add(1, joint(9.0))
    offers.add(2, joint(1.0, live=(1, 2)))
    assert offers.next(9.0, LIVE, 0.0) is None


def test_judging_is_rate_limited_and_the_latest_wins() -> None:
    """A peer that claims a better plan each time must not stop our planning."""
    offers = Offers()
    offers.add(1, joint(8.0))
    assert offers.next(9.0, LIVE, 0.0) is not None
    offers.add(1, joint(7.0))
    assert offers.next(9.0, LIVE, 0.9 * JUDGE_S) is None
    offers.add(1, joint(6.0))
    chosen = offers.next(9.0, LIVE, JUDGE_S)
    assert chosen is not None and chosen[1].makespan_s == 6.0


def test_a_better_plan_is_told_soon_and_the_same_one_again_later() -> None:
    """What is droppable is said again, but seldom."""
    offers = Offers()
    assert offers.is_worth_sending(joint(9.0), 0.0)
    assert not offers.is_worth_sending(joint(8.0), 0.9 * SEND_S)
    assert offers.is_worth_sending(joint(8.0), SEND_S)
    assert not offers.is_worth_sending(joint(8.0), SEND_S + 0.9 * REPEAT_S)
    assert offers.is_worth_sending(joint(8.0), SEND_S + REPEAT_S)


def test_a_new_live_set_is_news() -> None:
    """A longer makespan of fewer heads is not an older plan."""
    offers = Offers()
    offers.is_worth_sending(joint(5.0), 0.0)
    assert offers.is_worth_sending(joint(9.0, live=(0, 1)), SEND_S)


def test_a_plan_that_took_long_to_judge_puts_off_the_next() -> None:
    offers = Offers()
    offers.add(1, joint(8.0))
    assert offers.next(9.0, LIVE, 0.0) is not None
    offers.judged(0.0, 1.0)
    offers.add(1, joint(7.0))
    assert offers.next(9.0, LIVE, 0.9 / JUDGING) is None
    assert offers.next(9.0, LIVE, 1.0 / JUDGING) is not None
