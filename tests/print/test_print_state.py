"""How far a print has come: what events say, and what no execution of a plan comes to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.plan import ActionKind
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from decmcts.print.print_state import rest_of_line, state_of_events, state_of_layers
from tests.planning.replanning.conftest import Made, log_until, made, within_print  # noqa: F401

Change = Callable[[EventLog, Made], EventLog]


def test_all_events_print_all(made: Made) -> None:  # noqa: F811
    """Every action has ended, and nothing was broken off."""
    document = made.document
    state = state_of_events(document, log_until(document, 1e6))
    assert state.done.all() and not state.broken and not state.failed
    assert [head.ended for head in state.heads] == [len(head) for head in document.plan.heads]


def test_no_events_print_nothing(made: Made) -> None:  # noqa: F811
    """A stream that broke off behind its header."""
    state = state_of_events(made.document, log_until(made.document, 0.0))
    assert not state.done.any() and state.heads[0].at is None


def test_a_bead_within_which_a_head_failed_is_broken_off(made: Made) -> None:  # noqa: F811
    """Its place is known; of the head that lives it is not."""
    document = made.document
    time_s, action = within_print(document, 1, 12.0)
    state = state_of_events(document, log_until(document, time_s, failed=1))
    assert state.failed == ("right",) and (1, action) in state.broken
    assert state.done[document.plan.heads[1].contour[action]]
    right = state.heads[1]
    assert right.is_exact and right.at is not None and right.clock_s == time_s
    assert not state.heads[0].is_exact
    assert 0 < state.done.sum() < len(document.contours)


def test_a_head_that_failed_where_a_bead_begins_has_printed_nothing_of_it(
    made: Made,  # noqa: F811
) -> None:
    """So that the bead is printed whole."""
    document = made.document
    _, action = within_print(document, 1, 12.0)
    begin_s = float(document.plan.heads[1].begin_s[action])
    log = log_until(document, begin_s)
    at = tuple(document.plan.heads[1].action_path(action)[0].tolist())
    began = PrintEvent(EventKind.BEGAN, 1, begin_s, action, 0, at)
    failed = PrintEvent(EventKind.FAILED, 1, begin_s, action, 0, at)
    state = state_of_events(document, replace(log, events=(*log.events, began, failed)))
    assert not any(head == 1 for head, _ in state.broken)
    assert not state.done[document.plan.heads[1].contour[action]]


def added(*event: object, **more: object) -> Change:
    return lambda log, _: replace(log, events=(*log.events, PrintEvent(*event, **more)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda log, _: replace(log, problem="f" * 64), "not of this one"),
        (lambda log, _: replace(log, problem=""), "are of no plan"),
        (lambda log, _: replace(log, heads=("left", "middle")), "left, middle"),
        (added(EventKind.BEGAN, 0, 1e6, 10**6), "action 1000000"),
        (added(EventKind.PASSED, 0, 1e6, 3, 10**6), "point 1000000"),
        (added(EventKind.ENDED, 0, 1.0, 3), "before the one at"),
        (added(EventKind.BEGAN, 0, 1e6, 0), "again, which has ended"),
        (
            lambda log, m: replace(
                log, events=tuple(e for e in log.events if (e.head, e.action) != (0, 3))
            ),
            "no event says that action 3, a bead, has ended",
        ),
        (lambda log, m: replace(log, events=log.events[: len(log.events) // 2]), ""),
        (
            lambda log, m: replace(
                log, events=tuple(e for e in log.events if e.head == 1)
            ),
            "for which it waits",
        ),
    ],
)  # fmt: skip
def test_absurd_streams_are_refused(made: Made, change: Change, what: str) -> None:  # noqa: F811
    """In one line; one that was cut short is the state it tells of."""
    log = change(log_until(made.document, 1e6 - 1.0), made)
    if not what:
        assert state_of_events(made.document, log).done.any()
        return
    with pytest.raises(InputError, match=what):
        state_of_events(made.document, log)


def test_an_end_may_stand_behind_the_begin_it_allows(made: Made) -> None:  # noqa: F811
    """Both happen at once, and times are rounded."""
    log = log_until(made.document, 1e6)
    swapped = list(log.events)
    for k in range(len(swapped) - 1):
        a, b = swapped[k : k + 2]
        turns = (a.kind, b.kind) == (EventKind.ENDED, EventKind.BEGAN) and a.head == b.head
        if turns and b.time_s - a.time_s < 1e-6:
            swapped[k : k + 2] = b, a
    assert swapped != list(log.events)
    assert state_of_events(made.document, replace(log, events=tuple(swapped))).done.all()


def test_events_of_a_head_that_failed_are_refused(made: Made) -> None:  # noqa: F811
    """A dead head does nothing more."""
    log = log_until(made.document, 20.0)
    dead = PrintEvent(EventKind.FAILED, 1, 30.0)
    more = PrintEvent(EventKind.BEGAN, 1, 31.0, 5)
    with pytest.raises(InputError, match="has failed"):
        state_of_events(made.document, replace(log, events=(*log.events, dead, more)))


def test_layers_that_are_printed(made: Made) -> None:  # noqa: F811
    """Counted from 1, as everywhere a user counts them."""
    contours = made.document.contours
    state = state_of_layers(made.document, 2)
    assert state.done.tolist() == (contours.layer < 2).tolist()
    assert all(head.at is None for head in state.heads)
    for layers in (0, -1, int(contours.layer.max()) + 2):
        with pytest.raises(InputError, match="the plan has layers 1 to"):
            state_of_layers(made.document, layers)


def test_a_state_the_order_does_not_allow_is_refused(made: Made) -> None:  # noqa: F811
    """Here the order has a contour of the fourth layer before one of the first."""
    contours = made.document.contours
    above = int(np.flatnonzero(contours.layer == 3)[0])
    odd = replace(contours, layer=np.where(np.arange(len(contours)) == above, 0, contours.layer))
    with pytest.raises(InputError, match="which comes before it, is not"):
        state_of_layers(replace(made.document, contours=odd), 1)


def test_a_place_on_a_path() -> None:
    """Beyond its ends it is at its ends."""
    path = np.array([[0.0, 0.0, 0.2], [10.0, 0.0, 0.2]])
    assert rest_of_line(path, 0, (-1.0, 0.0, 0.2)) == (0, 0.0)
    assert rest_of_line(path, 0, (12.0, 3.0, 0.2)) == (0, 1.0)
    assert rest_of_line(path, 1, (10.0, 0.0, 0.2)) == (1, 0.0)


def test_a_made_log_has_prints(made: Made) -> None:  # noqa: F811
    """Else the tests above would look at nothing."""
    assert all((head.kind == ActionKind.PRINT).any() for head in made.document.plan.heads)
