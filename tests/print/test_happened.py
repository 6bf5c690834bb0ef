"""Plans as they were carried out: the times of events, up to where each head came."""

from __future__ import annotations

from dataclasses import replace

import pytest

from decmcts.print.print_state import happened
from tests.planning.replanning.conftest import Made, log_until, made, within_print  # noqa: F401


def test_a_plan_that_ran_on_time_is_itself(made: Made) -> None:  # noqa: F811
    """Action by action."""
    document = made.document
    found = happened(document, log_until(document, document.plan.makespan_s))
    for due, head in zip(document.plan.heads, found.plan.heads, strict=True):
        assert len(head) == len(due)
        assert head.begin_s == pytest.approx(due.begin_s, abs=1e-6)
        assert head.end_s == pytest.approx(due.end_s, abs=1e-6)
        assert (head.after_action == due.after_action).all()
    assert found.metrics["makespan_s"] == pytest.approx(document.plan.makespan_s)


def test_what_did_not_end_is_left_out(made: Made) -> None:  # noqa: F811
    """The head that failed has less, the other goes on; nothing waits for what there is not."""
    document = made.document
    stops, _ = within_print(document, 1, 12.0)
    log = log_until(document, stops, failed=1)
    later = tuple(
        event for event in log_until(document, 2.0 * stops).events
        if event.head == 0 and event.time_s > stops
    )  # fmt: skip
    found = happened(document, replace(log, events=(*log.events, *later)))
    left, right = found.plan.heads
    assert right.end_s[-1] <= stops < left.end_s[-1]
    assert len(right) == int((document.plan.heads[1].end_s <= stops).sum())
    for head in found.plan.heads:
        counts = [len(other) for other in found.plan.heads]
        assert all(
            action < counts[other]
            for other, action in zip(head.after_head, head.after_action, strict=True)
        )
    late = tuple(replace(event, time_s=event.time_s * 1.5) for event in log.events)
    slow = happened(document, replace(log, events=late)).plan.heads[1]
    assert slow.end_s == pytest.approx(right.end_s * 1.5)
