"""Where the agents of one launch meet: Unix sockets in a folder of this user alone, else TCP.

The folder has mode 0700, so nobody else reaches the sockets, and there are no ports. A
path to a socket has about 100 characters at most. Where there are no Unix sockets (Windows,
some file systems) agents meet at ports of this host, behind the launch's password. A
place that cannot be opened is given up for a fresh one (`Places.fresh`).

The launcher holds a lock in its folder. So whoever gets the lock knows that the launcher
is gone, and removes what it left.
"""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import stat
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Self

from agents.networks.meeting import TCP, UNIX, Meeting

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

PORTS = range(10_000, 32_768)  # outgoing connections get 32768 and more on Linux, 49152 elsewhere
LONGEST = 96  # bytes of a socket's path: systems allow 104 or 108
YOUNG_S = 60.0  # a folder without a lock may be so old: its launcher is about to take the lock
_PREFIX = "decmcts-bus-"
_LOCK = "launcher"


class Places:
    """Fresh places for the agents of one launch; use as a context manager.

    Folders are made in one of `bases`, best first; None: where this system keeps temporary ones.
    """

    def __init__(self, heads: int, bases: Iterable[Path] | None = None) -> None:
        self._heads = heads
        self._bases = list(_usual_bases() if bases is None else bases)
        self._made = 0
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Remove what launchers left that are gone."""
        for base in self._bases:
            sweep(base)
        return self

    def __exit__(self, *error: object) -> None:
        """Remove the folders, with all sockets in them."""
        self._stack.close()

    def fresh(self) -> tuple[str, ...]:
        """Return places, one a head, where nobody met yet: sockets and ports in turn.

        OSError if there are neither sockets nor free ports.
        """
        self._made += 1
        folder = self._folder() if self._made % 2 else None
        if folder is None:
            return tuple(f"{TCP}127.0.0.1:{port}" for port in free_ports(self._heads))
        return tuple(f"{UNIX}{folder}/{head}" for head in range(self._heads))

    def _folder(self) -> Path | None:
        """Return a new folder in which sockets can be opened, None if there is none."""
        if fcntl is None or not hasattr(socket, "AF_UNIX"):
            return None
        for base in self._bases:
            with suppress(OSError):
                folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=base))
                self._stack.callback(shutil.rmtree, folder, ignore_errors=True)
                self._stack.enter_context(_locked(folder))
                if _takes_sockets(folder, self._heads):
                    return folder
        return None


def _usual_bases() -> Iterator[Path]:
    """Yield where folders may be made, each once."""
    named = os.environ.get("XDG_RUNTIME_DIR", ""), tempfile.gettempdir(), "/tmp", "/var/tmp"
    for name in dict.fromkeys(named):
        if name and Path(name).is_absolute() and _is_safe(Path(name)):
            yield Path(name)


def _is_safe(base: Path) -> bool:
    """Whether nobody else can put another folder in the place of ours."""
    try:
        mode = base.stat().st_mode
    except OSError:
        return False
    return stat.S_ISDIR(mode) and (not mode & 0o022 or bool(mode & stat.S_ISVTX))


def _takes_sockets(folder: Path, heads: int) -> bool:
    """Whether sockets can be opened in a folder, and zenoh can be told of them."""
    name = f"{folder}/{heads - 1}"
    if len(os.fsencode(name)) > LONGEST or set(name) & set("?#*$;\n") or not name.isascii():
        return False
    trial = folder / "0"
    with socket.socket(socket.AF_UNIX) as each:
        try:
            each.bind(str(trial))
        except OSError:
            return False
    trial.unlink()
    return True


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder; OSError if another process does."""
    with (folder / _LOCK).open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield


def sweep(base: Path) -> None:
    """Remove this user's folders whose launcher is gone."""
    if fcntl is None:
        return
    for folder in base.glob(f"{_PREFIX}*"):
        with suppress(OSError):  # another launch was faster, or it is not ours
            known = folder.lstat()
            old = time.time() - known.st_mtime > YOUNG_S
            if not stat.S_ISDIR(known.st_mode) or known.st_uid != os.getuid():
                continue
            if (folder / _LOCK).exists():
                with _locked(folder):  # raises where the launcher lives
                    shutil.rmtree(folder, ignore_errors=True)
            elif old:
                shutil.rmtree(folder, ignore_errors=True)


def remove_left(meeting: Meeting | None) -> None:
    """Remove the folder where agents met if their launcher is gone."""
    for place in () if meeting is None else meeting.places:
        if place.startswith(UNIX):
            sweep(Path(place.removeprefix(UNIX)).parent.parent)
            return


def free_ports(n: int, ports: range = PORTS) -> tuple[int, ...]:
    """Return `n` loopback ports that are free now and likely stay so; OSError if there are less.

    Systems give higher ones to outgoing connections: those of agents that try to reach a
    peer could take its port before it listens there.
    """
    found: list[int] = []
    with ExitStack() as stack:
        for port in secrets.SystemRandom().sample(ports, len(ports)):
            if len(found) == n:
                break
            each = stack.enter_context(socket.socket())
            with suppress(OSError):
                each.bind(("127.0.0.1", port))
                found.append(port)
    if len(found) < n:
        raise OSError(f"no {n} free ports from {ports.start} to {ports.stop - 1}")
    return tuple(found)
