"""Temporary folders that no killed run leaves for good.

What ends in order removes its own. A kill can't: so each folder's name says which
process made it, and every run removes those a day old whose process is gone.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STALE_S = 86_400.0  # younger ones may be another computer's, on a folder both share
_NAME = re.compile(r"decmcts-(\d{1,10})-\w+")


@contextmanager
def draft_folder() -> Iterator[Path]:
    """Make a temporary folder for the body of a `with`; removes what killed runs left."""
    with tempfile.TemporaryDirectory(prefix=f"decmcts-{os.getpid()}-") as name:
        folder = Path(name)
        sweep(folder)
        yield folder


def sweep(made: Path) -> None:
    """Remove the stale folders of killed runs beside a folder just made, this user's only."""
    mine = made.stat()
    for found in made.parent.glob("decmcts-*"):
        named = _NAME.fullmatch(found.name)
        try:
            known = found.lstat()
        except OSError:  # another run was faster
            continue
        old = mine.st_mtime - known.st_mtime > STALE_S
        if named and old and known.st_uid == mine.st_uid and not _runs(int(named.group(1))):
            shutil.rmtree(found, ignore_errors=True)  # follows no link


def _runs(process: int) -> bool:
    """Tell whether a process of this number runs; it may be another one by now."""
    if os.name == "nt":
        return False  # no signal asks there, and files in use can't be removed
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
