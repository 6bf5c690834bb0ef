"""The line that has a slicer call this program: its full path, quoted as the system needs it.

PrusaSlicer and its kin hand the line to a shell, on Windows to the system. There the program is
looked for under the name that stands first, so its whole path with `.exe` has to be there.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

FILE_OPTIONS = ("--machine", "--report", "--picture")
WHERE = (
    "PrusaSlicer, SuperSlicer: Print Settings > Output options > Post-processing scripts",
    "OrcaSlicer, Bambu Studio: process settings > Others > Post-processing Scripts",
    "(in the slicer's expert or advanced mode; one script a line)",
)


def script_line(program: Sequence[str], words: Sequence[str], *, windows: bool) -> str:
    r"""Return a program and its arguments as one line for a slicer.

    Examples
    --------
    >>> script_line(["/my tools/decmcts"], ["post"], windows=False)
    "'/my tools/decmcts' post"
    >>> print(script_line([r"C:\my tools\decmcts.exe"], ["post"], windows=True))
    "C:\my tools\decmcts.exe" post
    """
    line = [*program, *words]
    return subprocess.list2cmdline(line) if windows else shlex.join(line)


def own_program() -> list[str]:
    """Return how this program is started from anywhere: the script of its environment, or Python.

    A link in a folder on the path is not used: it may go, and its target stays.
    """
    name = "decmcts.exe" if os.name == "nt" else "decmcts"
    for script in (Path(sys.executable).parent / name, Path(sys.argv[0])):
        if script.name in (name, "decmcts") and script.is_file() and os.access(script, os.X_OK):
            return [str(script.absolute())]
    return [sys.executable, "-P", "-m", "decmcts.cli"]


def wherever_it_runs(words: Sequence[str]) -> list[str]:
    """Return arguments that mean the same in every folder: files that are there, in full."""
    made, before = list[str](), ""
    for word in words:
        name, equals, value = word.partition("=")
        if equals and name in FILE_OPTIONS:
            made.append(f"{name}={_whole(name, value)}")
        else:
            made.append(_whole(before, word) if before in FILE_OPTIONS else word)
        before = word
    return made


def _whole(option: str, value: str) -> str:
    """Return a file's name in full; of a machine only if it is a file."""
    path = Path(value)
    named = option != "--machine" and path.suffix.lower() in (".html", ".htm", ".png", ".svg")
    return str(path.absolute()) if named or path.is_file() else value
