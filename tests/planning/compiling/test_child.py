"""What compiles beside a run must never disturb it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from decmcts.planning.compiling import child, parts
from decmcts.planning.events import Event, Step, unheard

PART = "slicer for travel"  # needs next to nothing


def test_child_ends_with_the_body(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finished program leaves no process behind, even when its body fails."""
    children: list[subprocess.Popen[bytes]] = []

    class Recorded(subprocess.Popen):  # type: ignore[type-arg]  # bytes or text, as asked
        def __init__(self, *args: object, **options: object) -> None:
            super().__init__(*args, **options)  # type: ignore[call-overload]  # passed on
            children.append(self)

    monkeypatch.setattr(subprocess, "Popen", Recorded)
    with pytest.raises(ZeroDivisionError), child.compiling_beside([PART], unheard):
        assert child.compiled_beside(PART)
        raise ZeroDivisionError
    assert [child.poll() is not None for child in children] == [True]
    assert not child.compiled_beside(PART)


def test_what_is_compiled_beside_may_change(fresh: Path) -> None:
    """Which price a search has is known once its source was read; the other is not needed."""
    other = "slicer for time"
    with child.compiling_beside([PART], unheard):
        with child.compiling_beside([other], unheard):
            assert child.compiled_beside(other)
            assert not child.compiled_beside(PART)
            assert len(child._children) == 1
        assert child.compiled_beside(other)
    assert not child._children


def test_a_run_may_wait_for_what_is_compiled_beside_it(fresh: Path) -> None:
    """Agents that all begin with a part missing would each load the compiler for it."""
    told: list[Event] = []
    with child.compiling_beside([PART], unheard):
        child.finish_beside(PART, told.append)
        assert parts.is_compiled(PART)
    assert isinstance(told[0], Step)
    assert told[0].text.startswith(f"compiling {PART}, once on this machine")


def test_a_child_that_dies_is_not_waited_for(fresh: Path) -> None:
    """What it would have compiled is then compiled where it is needed."""
    with child.compiling_beside([PART], unheard):
        child._children[-1].kill()
        child.finish_beside(PART, unheard)
    assert not parts.is_compiled(PART)


def test_nothing_is_started_when_all_is_compiled(
    fresh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second process costs a second of start-up each time."""
    parts.mark_compiled(PART)
    monkeypatch.setattr(subprocess, "Popen", None)
    with child.compiling_beside([PART], unheard):
        assert not child.compiled_beside(PART)
