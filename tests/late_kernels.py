"""Which kernels a fresh process compiles, or loads, late: within the time of a search."""

from __future__ import annotations

import subprocess
import sys

RECORD = """
late, usual = [], Kernel.compile

def recorded(self, signature):
    if self.overloads.get(tuple(signature)) is None:
        late.append(self.py_func.__name__)
    return usual(self, signature)

Kernel.compile = recorded
"""


def late_kernels(ahead: str, search: str, *arguments: str) -> list[str]:
    """Name the kernels compiled, or loaded, while `search` runs, after `ahead` has run.

    Both are Python text, run in one process with these arguments.
    """
    text = f"from decmcts.jit import Kernel\n{ahead}\n{RECORD}\n{search}\nprint(*late)\n"
    command = [sys.executable, "-c", text, *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
