"""Machine code on disk is run unseen: a file is whole and of this source, or it is not there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from decmcts.jit.store import UNUSED_S, Store, cache_folder, remove_unused

KEY = ("some.kernel", "int64")


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no test see another's temporary folder."""
    monkeypatch.delenv("DECMCTS_TEMPORARY_CACHE", raising=False)
    monkeypatch.setattr(Store, "unwritable", None)


def test_what_is_written_is_read_by_another_store(tmp_path: Path) -> None:
    """Processes share machine code through nothing but files."""
    Store(tmp_path / "k").write(KEY, {"code": b"abc"})
    assert Store(tmp_path / "k").read(KEY) == {"code": b"abc"}


def test_other_types_are_another_file(tmp_path: Path) -> None:
    """Code for other types would crash."""
    store = Store(tmp_path)
    store.write(KEY, 1)
    assert store.read(("some.kernel", "float64")) is None


@pytest.mark.parametrize("cut", [0, 5, 20, -1])
def test_a_damaged_file_is_as_good_as_none(tmp_path: Path, cut: int) -> None:
    """A full disk or a crash must cost a compilation, not the run."""
    store = Store(tmp_path)
    store.write(KEY, list(range(100)))
    (path,) = tmp_path.glob("*.code")
    path.write_bytes(path.read_bytes()[:cut])
    assert store.read(KEY) is None


def test_a_changed_source_is_another_folder(tmp_path: Path) -> None:
    """Else a kernel would keep the old code of what it calls in other files."""
    (tmp_path / "a.py").write_text("x = 1")
    before = cache_folder(tmp_path)
    (tmp_path / "a.py").write_text("x = 2")
    assert cache_folder(tmp_path) != before


def test_where_a_file_stands_instead_a_temporary_folder_takes_over(tmp_path: Path) -> None:
    """A home that cannot be written costs compilation in each run; it still works."""
    (tmp_path / "home").write_text("not a folder")
    store = Store(tmp_path / "home" / "k")
    store.write(KEY, 7)
    assert store.read(KEY) == 7
    assert Store.unwritable is not None
    assert Path(os.environ["DECMCTS_TEMPORARY_CACHE"]).is_dir()


WAIT = """
import sys
from pathlib import Path
from decmcts.jit.store import Store
print("began", flush=True)
print(Store(Path(sys.argv[1])).read_or_claim(("some.kernel", "int64")), flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such locks there: all compile")
def test_one_process_waits_for_what_another_compiles(tmp_path: Path) -> None:
    """Agents that start together would otherwise compile everything once each."""
    store = Store(tmp_path)
    assert store.read_or_claim(KEY) is None
    command = [sys.executable, "-c", WAIT, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "began\n"
        assert other.poll() is None
        store.write(KEY, "made once")
        store.release()
        assert other.stdout.readline() == "made once\n"


def test_a_claim_given_up_is_free(tmp_path: Path) -> None:
    """What could not be compiled here may be tried again."""
    store = Store(tmp_path)
    store.read_or_claim(KEY)
    store.release()
    assert store.read_or_claim(KEY) is None
    store.release()


def test_folders_unused_for_a_month_go_and_others_stay(tmp_path: Path) -> None:
    """Every version leaves a folder; without this they pile up for ever."""
    old, used = tmp_path / "kernels-1", tmp_path / "kernels-2"
    for folder in (old, used):
        Store(folder).write(KEY, 1)
        os.utime(folder, (0.0, 0.0))
    assert Store(used).read(KEY) == 1
    assert remove_unused(tmp_path) == [old]
    assert [path.name for path in tmp_path.iterdir()] == ["kernels-2"]


def test_a_folder_used_within_the_month_stays(tmp_path: Path) -> None:
    """The limit is the one that is documented."""
    Store(tmp_path / "kernels-1").write(KEY, 1)
    changed = (tmp_path / "kernels-1").stat().st_mtime
    assert remove_unused(tmp_path, now=changed + UNUSED_S - 1.0) == []
    assert remove_unused(tmp_path, now=changed + UNUSED_S + 1.0) != []
