"""Compiling ahead must never disturb the program it runs beside."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.jit import Store
from decmcts.planning import warm
from decmcts.planning.compiling import child, parts
from decmcts.planning.events import Event, Step, unheard
from decmcts.planning.warm import compile_part, smallest_gcode, smallest_job
from decmcts.samples import sample_path

PART = "slicer for travel"  # needs next to nothing


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give this process and its children an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("DECMCTS_TEMPORARY_CACHE", raising=False)
    monkeypatch.setattr(parts, "_store", Store(tmp_path / "decmcts" / parts.FOLDERS[0].name))
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("part", [parts.PRINT, parts.TEAM])
def test_the_smallest_jobs_are_planned_and_judged_without_fault(part: str) -> None:
    """The warm-up takes the same path as a real plan, so it must come to one."""
    compile_part(part)
    assert parts.is_compiled(part)


def test_smallest_job_needs_both_layers_in_order() -> None:
    """Four contours on two layers: enough to make every kernel run."""
    assert smallest_job().contours.layer.tolist() == [0, 0, 1, 1]


@pytest.mark.slow
def test_smallest_gcode_has_loops_and_lines_on_two_layers(tmp_path: Path) -> None:
    """Else kernels for one of them would be compiled in the first real run."""
    path = tmp_path / "smallest.gcode"
    path.write_text(smallest_gcode())
    contours = read_gcode(path)[0].contours
    assert contours.layer.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    assert contours.closed.tolist() == [True, False] * 4


def test_an_unknown_part_is_refused() -> None:
    """A part that is skipped in silence would be compiled in a search's time."""
    with pytest.raises(ValueError, match="no part 'nonsense'"):
        compile_part("nonsense")


def test_a_part_is_complete_once_it_was_said(fresh: Path) -> None:
    """What was compiled before is not compiled again, also by another process."""
    assert not parts.is_compiled(PART)
    parts.mark_compiled(PART)
    assert parts.is_compiled(PART)


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


@pytest.mark.slow
def test_the_child_ends_when_its_parent_is_killed(tmp_path: Path) -> None:
    """A killed program cannot tell its child to end; the end of a pipe does."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-m", "decmcts.planning.warm", "hybrid for travel"]
    child = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment
    )
    assert child.stdin is not None
    child.stdin.close()
    assert child.wait(timeout=60) == 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no signals there")
def test_ctrl_c_while_compiling_ends_at_once(tmp_path: Path) -> None:
    """Compiling takes a minute; nobody waits for it only to see nothing written."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-m", "decmcts.cli", "plan", str(sample_path("four_nuts.gcode.gz"))]
    command += ["-o", str(tmp_path / "out.gcode")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stderr is not None
        for line in child.stderr:
            if "compiling" in line:
                break
        began = time.monotonic()
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=60) == 130
        assert time.monotonic() - began < 30.0
    assert not (tmp_path / "out.gcode").exists()


def test_all_parts_are_made_by_something() -> None:
    """`decmcts warm` names its parts; each must be one that a run asks for."""
    asked = {
        part
        for objective in ("travel", "time")
        for freedom in ("reversible", "seam")
        for walls in (False, True)
        for part in parts.parts_of("hybrid", objective, freedom, walls=walls)
    }
    assert set(parts.all_parts()) == asked | {parts.TEAM}
    assert warm.PLANNERS.keys() >= {"hybrid", "local"}


@pytest.mark.slow
def test_a_child_with_nothing_left_ends_without_a_word():
    """It watches its standard input in a thread; that once made the interpreter's end fatal."""
    command = [sys.executable, "-m", "decmcts.planning.warm"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stderr is not None
        assert (child.stderr.read(), child.wait()) == (b"", 0)
