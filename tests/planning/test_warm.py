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
from decmcts.planning import compiling as parts
from decmcts.planning import warm
from decmcts.planning.warm import compile_part, smallest_gcode, smallest_job
from decmcts.samples import sample_path


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
        for unit in ("travel", "time")
        for freedom in ("reversible", "seam")
        for part in parts.parts_of("hybrid", unit, freedom)
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
