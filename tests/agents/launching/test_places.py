"""Where agents meet: a folder of this user alone, short, and gone afterwards."""

from __future__ import annotations

import os
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from agents.launching import places as module
from agents.launching.places import LONGEST, YOUNG_S, Places, remove_left, sweep
from agents.networks.meeting import Meeting


def folder_of(place: str) -> Path:
    assert place.startswith("unixsock-stream//")
    return Path(place.removeprefix("unixsock-stream/")).parent


@pytest.fixture
def base() -> Iterator[Path]:
    """A folder with a short name, as pytest's own is not."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name)


def test_places_are_sockets_in_a_folder_nobody_else_enters(base: Path) -> None:
    """Any user of the host could join at a port."""
    with Places(3, [base]) as places:
        found = places.fresh()
        folder = folder_of(found[0])
        assert found == tuple(f"unixsock-stream/{folder}/{head}" for head in range(3))
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert list(base.iterdir()) == []


def test_fresh_places_are_others_and_of_the_other_kind(base: Path) -> None:
    """What cannot be opened here may be opened there."""
    with Places(2, [base]) as places:
        first, second, third = (places.fresh() for _ in range(3))
    assert second[0].startswith("tcp/127.0.0.1:") and len(set(second)) == 2
    assert folder_of(first[0]) != folder_of(third[0])


def test_a_temporary_folder_with_a_long_name_is_left_for_another(base: Path) -> None:
    """A path to a socket has about 100 characters; zenoh only says that it cannot."""
    long = base / ("x" * LONGEST)
    long.mkdir()
    with Places(2, [long, base]) as places:
        assert folder_of(places.fresh()[0]).parent == base
    with Places(2, [long, base / "missing"]) as places:
        assert places.fresh()[0].startswith("tcp/127.0.0.1:")
    assert list(long.iterdir()) == []


def test_without_unix_sockets_there_are_ports(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows, and file systems that take none."""
    monkeypatch.delattr(socket, "AF_UNIX")
    with Places(2, [base]) as places:
        assert all(place.startswith("tcp/127.0.0.1:") for place in places.fresh())


def test_a_folder_that_others_may_change_is_not_used(
    base: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They could put a folder of their own in the place of ours."""
    base.chmod(0o777)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    assert base not in list(module._usual_bases())
    base.chmod(0o1777)
    assert base in list(module._usual_bases())


@pytest.mark.slow
def test_what_a_killed_launcher_left_is_removed(base: Path) -> None:
    """By its agents, or by the next launch; never while the launcher lives."""
    script = "import sys, pathlib; from agents.launching.places import Places\n"
    script += "with Places(2, [pathlib.Path(sys.argv[1])]) as places:\n"
    script += "    print(places.fresh()[0], flush=True); sys.stdin.read()"
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, "-c", script, str(base)], stdin=pipe, stdout=pipe, text=True
    ) as launcher:
        assert launcher.stdout is not None
        place = launcher.stdout.readline().strip()
        meeting = Meeting((place, place), bytes(32))
        remove_left(meeting)
        assert folder_of(place).exists()
        launcher.kill()
    remove_left(meeting)
    assert not folder_of(place).exists()


def test_a_folder_whose_launcher_is_about_to_lock_it_stays(base: Path) -> None:
    """Two launches at once: one sweeps while the other begins."""
    young, old = base / "decmcts-bus-young", base / "decmcts-bus-old"
    for folder in (young, old):
        folder.mkdir()
    before = folder.stat().st_mtime - 2 * YOUNG_S
    os.utime(old, (before, before))
    sweep(base)
    assert young.exists() and not old.exists()
