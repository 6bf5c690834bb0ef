"""A worker makes calls in a process of its own, and is never what a result hangs on."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import CancelledError

import pytest

from decmcts.errors import InputError
from decmcts.planning.worker import Worker, worker

SOON_S = 60.0  # far more than anything here takes


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
