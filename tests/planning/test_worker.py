"""A worker makes calls in a process of its own, and is never what a result hangs on."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import CancelledError
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.planning.worker import Worker, worker

SOON_S = 60.0  # far more than anything here takes
ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _finds_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker has to find the functions of this module."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)


def whose() -> int:
    """Return the process this runs in."""
    return os.getpid()


def refused(line: int) -> None:
    """Refuse a line."""
    raise InputError("a bead in the air", path="a.gcode", line=line, advice="slice it again")


def end_of_worker(owner: int) -> int:
    """End a worker amid a call; called again by its owner, return the owner's number."""
    if os.getpid() != owner:
        os._exit(3)
    return owner


def test_calls_are_made_elsewhere_one_after_the_other() -> None:
    """Python would make them in turns with everything else."""
    with worker() as beside:
        first, second = beside.call(whose), beside.call(whose)
        assert first.result(SOON_S) == second.result(SOON_S) != os.getpid()


def test_an_error_arrives_as_it_was_raised() -> None:
    """File, line and advice are what a user needs of it."""
    with worker() as beside, pytest.raises(InputError) as error:
        beside.call(refused, 7).result(SOON_S)
    assert str(error.value) == "a.gcode:7: a bead in the air; slice it again"


def test_a_call_whose_worker_is_lost_is_made_here() -> None:
    """A result is worth more than the time it would have saved."""
    with worker() as beside:
        assert beside.call(end_of_worker, os.getpid()).result(SOON_S) == os.getpid()
    assert Worker(None).call(whose).result(SOON_S) == os.getpid()


def test_a_worker_ends_with_the_body_whatever_it_does() -> None:
    """Nobody waits for an answer that is no longer wanted."""
    began = time.monotonic()
    with worker() as beside:
        found = beside.call(time.sleep, 2.0 * SOON_S)
    assert time.monotonic() - began < SOON_S
    with pytest.raises(CancelledError):
        found.result(SOON_S)


OWNER = """
import os, sys, time
from decmcts.planning.worker import worker
with worker() as beside:
    beside.call(os.getpid).result()
    beside.call(time.sleep, 120.0)
    print(beside._process.pid, flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="asks for processes by signal")
def test_no_worker_outlives_its_owner() -> None:
    """Killed by the system, an owner can end nobody."""
    with subprocess.Popen(
        [sys.executable, "-c", OWNER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as owner:
        assert owner.stdout is not None
        process = int(owner.stdout.readline())
        owner.kill()
    until = time.monotonic() + SOON_S
    while _runs(process):
        assert time.monotonic() < until
        time.sleep(0.01)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


class Unpackable:
    """What one side can pack and no other unpack, or what memory does not suffice for."""

    def __init__(self, error: type[Exception], *, packs: bool) -> None:
        self.error, self.packs = error, packs

    def __reduce__(self) -> tuple[object, ...]:
        if not self.packs:
            raise self.error
        return raised, (self.error,)


def raised(error: type[Exception]) -> None:
    raise error


def kind_of(given: object) -> str:
    return type(given).__name__


def unpackable(error: type[Exception]) -> Unpackable:
    return Unpackable(error, packs=True)


@pytest.mark.parametrize("packs", [True, False])
@pytest.mark.parametrize("error", [MemoryError, KeyError, ValueError])
def test_what_cannot_get_there_is_called_here(error: type[Exception], packs: bool) -> None:
    """Nobody may wait for ever for an answer to what never arrived."""
    with worker() as beside:
        given = Unpackable(error, packs=packs)
        assert beside.call(kind_of, given).result(SOON_S) == "Unpackable"


@pytest.mark.parametrize("error", [MemoryError, KeyError, ValueError])
def test_a_result_that_cannot_come_back_is_made_here(error: type[Exception]) -> None:
    """As above."""
    with worker() as beside:
        assert kind_of(beside.call(unpackable, error).result(SOON_S)) == "Unpackable"


def test_what_lies_in_the_current_folder_is_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Prints are downloaded to folders where anything may lie."""
    for name in ("queue", "numpy", "decmcts"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'w'); raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    with worker("decmcts.planning.plan") as beside:
        assert beside.call(whose).result(SOON_S) != os.getpid()
    assert not Path("ran").exists()


def test_no_process_looks_for_modules_in_the_current_folder() -> None:
    """Python does, after `-m` alone."""
    files = [f for room in ("decmcts", "agents", "sim") for f in (ROOT / room).rglob("*.py")]
    starts = [line for f in files for line in f.read_text("utf-8").splitlines() if '"-m"' in line]
    assert len(starts) >= 4
    assert all('"-P", "-m"' in line for line in starts)
