"""Files are put in place in one step, and nothing else is ever replaced by one."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.formats.files.atomic import write_all, write_whole


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


SET = ("plate_left.gcode", "plate_right.gcode", "plate_back.gcode")


def set_in(folder: Path) -> list[tuple[Path | str, bytes]]:
    """Return new contents of three files, of which the first two exist with old ones."""
    for name in SET[:2]:
        (folder / name).write_bytes(b"old")
    return [(folder / name, b"new") for name in SET]


def contents(folder: Path) -> dict[str, bytes]:
    """Return what stands in a folder's files."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_files_that_belong_together_are_all_put_in_place(tmp_path: Path) -> None:
    """And nothing else is left beside them."""
    write_all(set_in(tmp_path))
    assert contents(tmp_path) == dict.fromkeys(SET, b"new")


@pytest.mark.parametrize("name", SET)
def test_of_files_that_belong_together_none_is_written_where_one_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """A new file of one head beside an old one of the other makes heads collide."""
    files, rename = set_in(tmp_path), os.replace

    def refused(draft: Path, target: Path) -> None:
        if Path(target).name == name and Path(draft).read_bytes() == b"new":
            raise PermissionError(1, "Operation not permitted")
        rename(draft, target)

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(InputError, match=rf"{name}: cannot be written \(Operation not permitted"):
        write_all(files)
    assert contents(tmp_path) == dict.fromkeys(SET[:2], b"old")


@pytest.mark.skipif(sys.platform != "linux", reason="a folder of a given size is Linux'")
def test_a_disk_that_is_full_leaves_the_old_files(tmp_path: Path) -> None:
    """The first file would fit, the second does not."""
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "none", tmp_path], check=False,
        capture_output=True,
    ).returncode:  # fmt: skip
        pytest.skip("only root mounts a small disk")
    try:
        files = [(path, content * 10_000) for path, content in set_in(tmp_path)]
        with pytest.raises(InputError, match=r"plate_\w+.gcode: cannot be written \(No space"):
            write_all(files)
        assert contents(tmp_path) == dict.fromkeys(SET[:2], b"old")
    finally:
        subprocess.run(["umount", tmp_path], check=True)


def test_nothing_is_left_where_an_old_file_cannot_be_kept(tmp_path: Path) -> None:
    """A folder stands where the second file should go: it cannot be kept as a file."""
    (tmp_path / "a.gcode").write_bytes(b"old")
    (tmp_path / "b.gcode").mkdir()
    with pytest.raises(InputError, match=r"b.gcode: cannot be written"):
        write_all([(tmp_path / "a.gcode", b"new"), (tmp_path / "b.gcode", b"new")])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gcode", "b.gcode"]
    assert (tmp_path / "a.gcode").read_bytes() == b"old"
