"""Files of machine code: one for each kernel and combination of types.

The folder is named by a digest of all sources that are compiled together: a kernel
that calls one in another file must not outlive a change there. So files are never
changed, only made, whole or not at all, by any number of processes at a time. One that
wants what another is compiling waits for it. Where the folder cannot be written, or others
may put files there, a temporary one takes what is missing for as long as this
process and its children live.

Machine code is run unseen, so nobody else may have written it. As secure shells ask it of their
keys: a folder and all above it belong to this user or to the system's, and others can put nothing
there. Where others may write, as in `/tmp`, but can neither rename nor remove what is not theirs
(the sticky bit), what lies below is asked.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import pickle
import shutil
import stat
import sys
import tempfile
import time
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numba
from numba.core.serialize import dumps

if sys.platform != "win32":
    import fcntl

UNUSED_S = 30 * 86400.0  # a folder nobody has used for so long is removed
SPILL = "DECMCTS_TEMPORARY_CACHE"  # environment variable: the temporary folder, for children
MARK = "complete"  # begins the names of files that say that something is
_DIGEST = 16  # bytes at the beginning of a file: what the rest must be

CodeKey = tuple[str, ...]

_config: Any = numba.config  # its options are made at run time
_dumps: Any = dumps


def cache_home() -> Path:
    """Return the folder of all versions' machine code; `NUMBA_CACHE_DIR` overrides it."""
    if _config.CACHE_DIR:
        return Path(_config.CACHE_DIR)
    home = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(home):  # then it is to be ignored, says the XDG specification
        home = os.path.expanduser("~/.cache")
    if sys.platform == "win32":
        home = os.environ.get("LOCALAPPDATA", home)
    if not os.path.isabs(home):  # no home: `~` stands there still
        return temporary_folder() or _maketemporary_folder()
    return Path(home) / "decmcts"


def cache_folder(sources: Path, files: str = "*.py") -> str:
    """Return where the machine code of all files of this pattern in `sources` is kept."""
    state = blake2b(digest_size=8)
    for folder, pattern in ((Path(__file__).parent, "*.py"), (sources, files)):
        for path in sorted(folder.rglob(pattern)):
            state.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return str(cache_home() / f"{sources.name}-{state.hexdigest()}")


class Store:
    """The files of one folder, made when the first of them is written."""

    unwritable: OSError | None = None  # of any store: why the temporary folder is used

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._claim: Any = None
        self._used = False

    def read(self, key: CodeKey) -> Any:
        """Return what was kept under a key, None if nothing was or the file is damaged."""
        for folder in (self.folder, temporary_folder()):
            if folder is None or not _trusted(folder):
                continue
            try:
                with (folder / _name(key)).open("rb") as file:
                    content = file.read() if is_ours(os.fstat(file.fileno())) else b""
            except OSError:
                continue
            if blake2b(content[_DIGEST:], digest_size=_DIGEST).digest() == content[:_DIGEST]:
                self._mark_used()
                return pickle.loads(content[_DIGEST:])
        return None

    def read_or_claim(self, key: CodeKey) -> Any:
        """Return what is kept under a key; None if nothing is, and this process shall make it.

        Waits while another process that claimed it lives. `release` ends the claim.
        """
        found = self.read(key)
        if found is None:
            self._claim = _locked(self._writable() / _name(key).replace(".code", ".lock"))
            found = self.read(key)
        return found

    def write(self, key: CodeKey, content: Any) -> None:
        """Keep something under a key, whole or not at all."""
        payload = _dumps(content)
        payload = blake2b(payload, digest_size=_DIGEST).digest() + payload
        target = self._writable() / _name(key)
        draft = target.with_suffix(f".{os.getpid()}.draft")
        try:
            draft.write_bytes(payload)
            os.replace(draft, target)
        except OSError as error:  # a full disk, or a folder removed meanwhile: compiled again later
            Store.unwritable = Store.unwritable or error
            draft.unlink(missing_ok=True)

    def release(self) -> None:
        """End the claim, if there is one."""
        claim, self._claim = self._claim, None
        if claim is not None:
            claim.close()

    def prepare(self) -> None:
        """Make the folder, or the temporary one in its place."""
        self._writable()

    def mark(self, name: str) -> None:
        """Say that what goes by this name is complete; lasts as long as the folder."""
        self.write((MARK, name), True)

    def marked(self, name: str) -> bool:
        """Say whether what goes by this name was said to be complete."""
        return self.read((MARK, name)) is not None

    def _writable(self) -> Path:
        """Return the folder, made; the temporary one where that cannot be."""
        try:
            _make_private(self.folder)
            if not os.access(self.folder, os.W_OK):
                raise PermissionError(13, os.strerror(13), str(self.folder))
            if not _trusted(self.folder):
                raise PermissionError(1, "others may put files there", str(self.folder))
            self._mark_used()
            return self.folder
        except OSError as error:
            Store.unwritable = Store.unwritable or error
            return temporary_folder() or _maketemporary_folder()

    def _mark_used(self) -> None:
        if not self._used:
            self._used = True
            with contextlib.suppress(OSError):  # read only, so nobody will remove it
                os.utime(self.folder)


@cache
def _trusted(folder: Path) -> bool:
    """Tell whether nobody else may have put machine code into a folder; asked once a process."""
    return only_ours_beneath(folder)


def _make_private(folder: Path) -> None:
    """Make a folder and those above it that are missing, for this user only."""
    if folder.is_dir():
        return
    _make_private(folder.parent)
    folder.mkdir(mode=0o700, exist_ok=True)


def remove_unused(home: Path, *, now: float | None = None) -> list[Path]:
    """Remove folders of machine code nobody has used for 30 days; return which.

    Each is renamed first, so that no process finds half a folder.
    """
    removed = []
    before = (time.time() if now is None else now) - UNUSED_S
    for folder in sorted(home.glob("*-*")) if home.is_dir() else []:
        try:
            if folder.is_dir() and folder.stat().st_mtime < before:
                gone = folder.with_name(f"removed.{os.getpid()}.{folder.name}")
                folder.rename(gone)
                shutil.rmtree(gone, ignore_errors=True)
                removed.append(folder)
        except OSError:
            continue  # another process was quicker, or it is not ours to remove
    return removed


def size_of(home: Path) -> tuple[int, int]:
    """Return how many files of machine code there are, and their bytes."""
    sizes = [path.stat().st_size for path in home.glob("*/*.code")]
    return len(sizes), sum(sizes)


def _name(key: CodeKey) -> str:
    digest = blake2b("\0".join((*key, sys.version)).encode(), digest_size=12).hexdigest()
    return f"{key[0].rsplit('.', 1)[-1]}-{digest}.code"


def _locked(path: Path) -> Any:
    """Return the file, open and locked; where it cannot be, all may compile at once."""
    try:
        file = path.open("wb")
    except OSError:
        return None
    if sys.platform != "win32":
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
    return file


def temporary_folder() -> Path | None:
    """Return what takes the place of folders that cannot be written, if it was needed."""
    folder = os.environ.get(SPILL)
    return Path(folder) if folder else None


def _maketemporary_folder() -> Path:
    """Make the temporary folder, readable by this user only, and tell children of it."""
    folder = tempfile.mkdtemp(prefix="decmcts-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[SPILL] = folder
    return Path(folder)


if sys.platform != "win32":
    import grp
    import pwd

_SYSTEM = 0  # uid


def only_ours_beneath(folder: Path) -> bool:
    """Tell whether nobody but this user and the system can put a file into a folder.

    One that is not there yet is asked for what it would be made in.
    """
    if sys.platform == "win32":  # a profile's folders are its user's there
        return True
    place = Path(os.path.realpath(folder))
    try:
        if place.exists() and not is_ours(place.stat()):
            return False
        return all(_is_kept(above.stat()) for above in place.parents if above.exists())
    except OSError:
        return False


def is_ours(state: os.stat_result) -> bool:
    """Tell whether a file or folder is this user's or the system's, and others cannot write it."""
    if sys.platform == "win32":
        return True
    if state.st_uid not in (os.geteuid(), _SYSTEM) or state.st_mode & stat.S_IWOTH:
        return False
    return not state.st_mode & stat.S_IWGRP or _is_alone_in(state.st_gid)


def _is_kept(state: os.stat_result) -> bool:
    """Tell whether nobody else can put another folder in the place of one that is in this one."""
    if state.st_mode & stat.S_ISVTX:
        return state.st_uid in (os.geteuid(), _SYSTEM)
    return is_ours(state)


def _is_alone_in(group: int) -> bool:
    """Tell whether a group is this user's own, as many systems make one for each user."""
    try:
        user, known = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return known.gr_name == user.pw_name and set(known.gr_mem) <= {user.pw_name}
