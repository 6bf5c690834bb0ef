"""Events that are kept while they happen: a run that is broken off can be planned anew."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from agents.messages.event_stream import read_events
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.events import Event, Note, unheard
from decmcts.planning.running.recorded import Carried
from decmcts.planning.running.run import Keeping, refuse_earlier
from decmcts.print.print_state import state_of_events
from tests.planning.replanning.conftest import Made, log_until


@pytest.fixture
def keeping(tmp_path: Path) -> Iterator[Keeping]:
    kept = Keeping(tmp_path / "run.events", unheard)
    yield kept
    kept.close()


def carried_until(made: Made, carried: Carried, time_s: float) -> Carried:
    """Take what happens up to a time and was not taken yet."""
    for event in log_until(made.document, time_s).events[len(carried.events) :]:
        carried.take(event.head, event)
    return carried


def test_what_happened_is_on_the_disk_at_any_moment(made: Made, keeping: Keeping) -> None:
    """It was written when the run had ended: behind Ctrl-C, or a cut of power, all was lost."""
    keeping.keep([])
    assert not keeping.is_begun and not keeping.path.exists()
    carried = Carried(0, made.document, (0, 1), True)
    for time_s in (20.0, 40.0, 41.0):
        keeping.keep([carried_until(made, carried, time_s)])
        log = read_events(keeping.path)
        assert log.events == tuple(carried.events)
        assert state_of_events(made.document, log).done.any()
    assert keeping.is_begun


def test_a_rest_is_kept_beside_with_its_plan(made: Made, keeping: Keeping) -> None:
    """As soon as a head has begun it, whatever becomes of the run."""
    first, rest = (Carried(k, made.document, (0, 1), True) for k in (0, 2))
    keeping.keep([carried_until(made, first, 40.0), carried_until(made, rest, 20.0)])
    there = keeping.path.with_name("run-rest1.events")
    assert read_events(there).events == tuple(rest.events)
    assert read_plan(there.with_suffix(".plan.json")).problem == made.document.problem
    keeping.write([first, rest], [first.log(), rest.log()])
    assert read_events(there) == rest.log() and read_events(keeping.path) == first.log()


def test_a_full_disk_ends_no_print(made: Made, tmp_path: Path) -> None:
    """It is said once."""
    said = list[Event]()
    keeping = Keeping(tmp_path / "gone" / "run.events", said.append)
    for time_s in (20.0, 40.0):
        keeping.keep([carried_until(made, Carried(0, made.document, (0, 1), True), time_s)])
    (note,) = said
    assert isinstance(note, Note) and "No such file" in note.text


def test_streams_of_an_earlier_run_are_not_taken_for_those_of_this_one(tmp_path: Path) -> None:
    """A print had been planned anew from what another had printed."""
    path = tmp_path / "run.events"
    path.touch()
    refuse_earlier(path)
    (tmp_path / "run-rest1.events").touch()
    with pytest.raises(InputError, match=r"run-rest1.*earlier run"):
        refuse_earlier(path)
