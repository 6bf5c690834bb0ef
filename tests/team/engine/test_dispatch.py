"""The list scheduler's short cuts must not show in what it schedules."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("orders_awake.py")
ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
def test_heads_that_sleep_miss_nothing() -> None:
    """With many heads most looks find what the last one did; left out they change no bit."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, str(PROGRAM)], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    asleep, looks, awake, all_looks = done.stdout.splitlines()
    assert asleep == awake
    assert int(looks) < int(all_looks)
