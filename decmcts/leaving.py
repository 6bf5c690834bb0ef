"""How a process ends while threads are at work that nobody waits for any more."""

from __future__ import annotations

import atexit
import os
import sys
import threading
from typing import NoReturn


def leave(code: int) -> NoReturn:
    """End the process, at once where such threads are left.

    While the interpreter is taken down, a thread that comes back from a library in C++ or Rust
    ends the process by `abort`, whatever the exit code: a solver's, or zenoh's.
    """
    sys.stdout.flush()
    if any(thread.daemon for thread in threading.enumerate()):
        atexit._run_exitfuncs()  # temporary folders go; there is no public name for it
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
