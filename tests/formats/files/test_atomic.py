"""Files are put in place in one step, and nothing else is ever replaced by one."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.formats.files.atomic import write_whole


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    """Slicers and users keep links to the newest print; what they lead to is written."""
    target, link = tmp_path / "target.gcode", tmp_path / "link.gcode"
    target.write_text("old")
    link.symlink_to(target)
    write_whole(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_a_pipe_is_refused_and_stays_one(tmp_path: Path) -> None:
    """As root, renaming a file onto /dev/null would destroy the device for everybody."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="device or pipe"):
        write_whole(pipe, b"new")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    """A broken link must be one line, not a traceback."""
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / "a", b"new")


def test_a_file_keeps_its_permissions(tmp_path: Path) -> None:
    """A slicer that hands over a private file gets a private file back."""
    path = tmp_path / "part.gcode"
    path.write_text("old")
    path.chmod(0o640)
    write_whole(path, b"new")
    assert path.stat().st_mode & 0o777 == 0o640
    assert path.read_bytes() == b"new"
