"""Which kernels a fresh process compiles, or loads, late: within the time of a search."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence

PROGRAM = """
import json, os, sys, traceback
from decmcts.jit import Kernel

loaded, ahead, search, cases = (json.loads(text) for text in sys.argv[1:])
late, usual = [], Kernel.compile

def recorded(self, signature):
    if self.overloads.get(tuple(signature)) is None:
        late.append(self.py_func.__name__)
    return usual(self, signature)

here = {}
exec(loaded, here)
for case in cases:
    if not (child := os.fork()):
        try:
            exec(ahead, here | {"case": case}, (names := {}))
            Kernel.compile = recorded
            exec(search, here | names)
            print(*late, flush=True)
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
    if os.waitpid(child, 0)[1]:
        sys.exit(1)
"""


def late_kernels(
    loaded: str, ahead: str, search: str, cases: Sequence[Sequence[str]]
) -> list[list[str]]:
    """Name the kernels compiled, or loaded, while `search` runs, after `ahead` has: for each case.

    All three are Python text. `loaded` imports, once for all; each `case`, as the other two know
    it, has a process of its own from there on.
    """
    given = [json.dumps(each) for each in (loaded, ahead, search, cases)]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *given], check=True, stdout=subprocess.PIPE, text=True
    )
    return [line.split() for line in done.stdout.splitlines()]
