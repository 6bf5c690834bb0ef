"""How often a reader of the code changes files: one `decmcts plan`, from reader to emitter.

    decmcts warm && python benchmarks/walk.py part.gcode

Follows the calls of the main thread between this project's files, compiled ones too, from
`read_gcode` until the verified G-code is written. A way from one file to another counts
once, however often it is taken, so large prints walk no further than small ones. The first
way into a file *enters* it, each further one *returns* to it; likewise for rooms, the
folders. Calls while a module is imported do not count.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from types import FrameType
from typing import Any

import decmcts
from decmcts.cli import main

ROOT = Path(decmcts.__file__).parents[1]
OWN = tuple(f"{ROOT / package}/" for package in ("decmcts", "agents", "sim"))
FIRST, LAST = "read_gcode", "write_whole"  # functions


class Walk:
    """The ways of one run, in the order in which they are first taken; a profile function."""

    def __init__(self) -> None:
        self.ways: dict[tuple[str, str], None] = {}  # caller, callee
        self.end = 0  # how many there were when the last file was written
        self._inside: list[str] = []  # files of the calls that last
        self._begun, self._importing = False, 0

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        """Note a call."""
        code, step = frame.f_code, {"call": 1, "return": -1}.get(event, 0)
        if code.co_name == "<module>":
            self._importing += step
        elif step and not self._importing and code.co_filename.startswith(OWN):
            if step < 0:
                self._inside.pop()
                return
            self._inside.append(code.co_filename)
            self._begun = self._begun or code.co_name == FIRST
            if self._begun:
                self.ways[self._inside[-2], self._inside[-1]] = None
            if code.co_name == LAST:
                self.end = len(self.ways)


def counted(ways: Iterable[tuple[Path, Path]]) -> tuple[list[Path], int]:
    """Return what is entered, in order, and the returns."""
    apart = [way for way in dict.fromkeys(ways) if way[0] != way[1]]
    entered = list(dict.fromkeys(place for way in apart for place in way))
    return entered, len(apart) - (len(entered) - 1)


def walk(source: str) -> None:
    """Follow one run and print what it crosses."""
    followed = Walk()
    with tempfile.TemporaryDirectory() as folder:
        sys.argv = ["decmcts", "plan", source, "--time-limit", "2", "-o", f"{folder}/out.gcode"]
        sys.setprofile(followed)
        try:
            main()
        except SystemExit:
            sys.setprofile(None)
    ways = [(Path(a), Path(b)) for a, b in followed.ways][: followed.end]
    for name, some in (("files", ways), ("rooms", [(a.parent, b.parent) for a, b in ways])):
        entered, returns = counted(some)
        print(f"{name}: {len(entered)} entered, {returns} returns")
        print("\n".join(f"  {place.relative_to(ROOT)}" for place in entered))


if __name__ == "__main__":
    walk(sys.argv[1])
