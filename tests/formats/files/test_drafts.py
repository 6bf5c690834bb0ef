"""Folders of killed runs go with the next run; nobody else's do."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from decmcts.formats.files.atomic import STALE_S, draft_folder


@pytest.fixture(autouse=True)
def own_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep away from the computer's own."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def dead_process() -> int:
    """Return the number of a process that has ended."""
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        return child.pid


def left(tmp_path: Path, name: str, *, age_s: float) -> Path:
    """Leave a folder with a file in it, as a killed run does."""
    folder = tmp_path / name
    folder.mkdir()
    (folder / "draft.gcode").write_text("G28")
    then = folder.stat().st_mtime - age_s
    os.utime(folder, (then, then))
    return folder


def test_a_folder_goes_with_its_run(tmp_path: Path) -> None:
    """Also where the run fails."""
    with pytest.raises(ValueError), draft_folder() as folder:
        (folder / "draft.gcode").write_text("G28")
        raise ValueError
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_run_left_goes_a_day_later(tmp_path: Path) -> None:
    """Drafts of large prints fill the disk; yesterday's have no owner any more."""
    name = f"decmcts-{dead_process()}-abc_1"
    stale = left(tmp_path, name, age_s=STALE_S + 60.0)
    fresh = left(tmp_path, name + "2", age_s=STALE_S - 60.0)
    running = left(tmp_path, f"decmcts-{os.getpid()}-abc", age_s=10.0 * STALE_S)
    other = left(tmp_path, "decmcts-notes", age_s=10.0 * STALE_S)
    with draft_folder():
        assert not stale.exists()
        assert fresh.exists() and running.exists() and other.exists()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    """Whoever shares the folder must not make us remove what is elsewhere."""
    kept = left(tmp_path, "kept", age_s=0.0)
    link = tmp_path / f"decmcts-{dead_process()}-abc"
    link.symlink_to(kept, target_is_directory=True)
    os.utime(link, (1.0, 1.0), follow_symlinks=False)
    with draft_folder():
        assert (kept / "draft.gcode").exists()
