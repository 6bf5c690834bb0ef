"""A process ends with its exit code, whatever its threads are at."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import atexit, threading, time
from decmcts.leaving import leave
atexit.register(lambda: print("tidied", flush=True))
threading.Thread(target=time.sleep, args=(60.0,), daemon={daemon}).start() if {busy} else None
print("done")
leave(3)
"""


@pytest.mark.parametrize("busy", [True, False])
def test_what_was_printed_is_there_and_temporary_folders_go(busy: bool) -> None:
    program = PROGRAM.format(daemon=True, busy=busy)
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=30)
    assert (ended.returncode, ended.stdout, ended.stderr) == (3, b"done\ntidied\n", b"")
