"""Puts files in place in one step, so that a failure leaves what was there before.

Nothing here knows what is in a file. A link is followed, so that it stays one;
devices and pipes are refused: putting a file in their place would destroy them.

No killed run leaves temporary folders for good. What ends in order removes its own. A kill can't:
so each folder's name says which process made it, and every run removes those a day old whose
process is gone.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from decmcts.errors import InputError

NAME_BYTES = 255  # of a name on most file systems
BEGIN_BYTES = 80  # of a file's name, which that of its draft begins with: it is no longer


def write_whole(path: Path | str, content: bytes) -> None:
    """Write a file wholly or not at all.

    Raises InputError when it cannot be written; what was there before is untouched.
    """
    write_all([(path, content)])


def write_all(files: Sequence[tuple[Path | str, bytes]]) -> None:
    """Write files that belong together: all of them, or none.

    All are staged beside their places and put there then, one right after the other. If one can't
    be put in place, those before it go back to what they were. Only a kill between two renames
    leaves some of either kind.

    Raises InputError when one of them cannot be written, which is named; what was there before is
    untouched.
    """
    staged, replaced = list[_Staged](), list[_Staged]()
    path: Path | str = ""
    try:
        for path, content in files:
            staged.append(_staged(path))
            staged[-1].fill(content)
        for each in staged:
            path = each.path
            each.keep_old(len(files) > 1)
            replaced.append(each)
            os.replace(each.draft, each.target)
    except BaseException as error:
        for each in reversed(replaced):
            each.put_back()
        if isinstance(error, OSError | RuntimeError):
            why = error.strerror if isinstance(error, OSError) else "a link that leads to itself"
            raise InputError(f"cannot be written ({why})", path=path) from error
        raise
    finally:
        for each in staged:
            each.tidy()


@dataclass(slots=True)
class _Staged:
    """A file beside its place, and what stands there."""

    path: Path | str  # as it was named
    target: Path
    draft: Path
    handle: int
    old: Path | None = None  # what stood at its place, by another name

    def fill(self, content: bytes) -> None:
        with os.fdopen(self.handle, "wb") as file:
            file.write(content)
        self.draft.chmod(_mode(self.target))

    def keep_old(self, others: bool) -> None:
        """Keep what stands at its place, if `others` may fail behind it."""
        if others and self.target.exists():
            handle, name = tempfile.mkstemp(prefix=".kept.", dir=self.target.parent)
            os.close(handle)
            self.old = Path(name)
            shutil.copy2(self.target, name)

    def put_back(self) -> None:
        """Undo `os.replace`, if it was done."""
        with contextlib.suppress(OSError):
            if self.draft.exists():
                return
            if self.old is None:
                self.target.unlink(missing_ok=True)
            else:
                os.replace(self.old, self.target)

    def tidy(self) -> None:
        """Remove what is left beside its place."""
        for path in (self.draft, self.old):
            with contextlib.suppress(OSError):
                if path is not None:
                    path.unlink(missing_ok=True)


def _staged(path: Path | str) -> _Staged:
    target = Path(path).resolve()  # of links in a circle RuntimeError, from Python 3.13 on a link
    if target.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    refuse_special(target)
    begin = target.name.encode("utf-8", "replace")[:BEGIN_BYTES].decode("utf-8", "ignore")
    handle, draft = tempfile.mkstemp(prefix=f".{begin}.", dir=target.parent)
    return _Staged(path, target, Path(draft), handle)


def refuse_special(path: Path) -> None:
    """Raise InputError for what exists and is neither a file nor a folder."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError("a device or pipe is no file to write", path=path, advice="name a file")


def refuse_foreign_letters(path: Path) -> None:
    """Raise InputError for a name with letters that names of files cannot have in this locale."""
    try:
        os.fsencode(path)
    except UnicodeEncodeError as error:
        raise InputError(
            f"this locale has no letter {error.object[error.start]!r} for names of files",
            path=path, advice="set LC_ALL=C.UTF-8, or name it otherwise",
        ) from None  # fmt: skip


def refuse_long_name(path: Path) -> None:
    """Raise InputError for a name that is longer than the file system takes."""
    most = NAME_BYTES
    with contextlib.suppress(OSError, ValueError, AttributeError):  # Windows, or no such folder
        most = os.pathconf(path.parent, "PC_NAME_MAX")
    size = len(os.fsencode(path.name))
    if size > most:
        raise InputError(
            f"the name has {size} bytes, at most {most} are possible here", path=path,
            advice="name a shorter one",
        )  # fmt: skip


def _mode(path: Path) -> int:
    """Return the permissions the file has, or would get from an ordinary open."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


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
