"""Machine code that others may have written is not run."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from decmcts.jit import store as stores
from decmcts.jit.store import Store, cache_home, is_ours, only_ours_beneath

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no such modes there")
KEY = ("some.kernel", "int64")


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no test see another's folders."""
    monkeypatch.delenv("DECMCTS_TEMPORARY_CACHE", raising=False)
    monkeypatch.setattr(Store, "unwritable", None)
    stores._trusted.cache_clear()


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o757, 0o702])
def test_a_folder_that_others_write_is_not_read(tmp_path: Path, mode: int) -> None:
    """Whoever shares it would run code as this user."""
    folder = tmp_path / "kernels-1"
    Store(folder).write(KEY, "planted")
    folder.chmod(mode)
    stores._trusted.cache_clear()
    store = Store(folder)
    assert store.read(KEY) is None
    store.write(KEY, "own")
    assert store.read(KEY) == "own"
    assert "others may put files there" in str(Store.unwritable)
    private = Path(os.environ["DECMCTS_TEMPORARY_CACHE"])
    assert private.stat().st_mode & 0o777 == 0o700
    assert len(list(folder.glob("*.code"))) == 1


def test_a_folder_that_others_may_replace_is_not_read(tmp_path: Path) -> None:
    """Who may rename it puts another in its place; the sticky bit of /tmp forbids that."""
    folder = tmp_path / "shared" / "kernels-1"
    Store(folder).write(KEY, 1)
    for mode, trusted in ((0o700, True), (0o777, False), (0o1777, True)):
        folder.parent.chmod(mode)
        assert only_ours_beneath(folder) == trusted


def test_a_link_counts_as_what_it_leads_to(tmp_path: Path) -> None:
    """Else a private link to a public folder would pass."""
    (tmp_path / "public").mkdir(mode=0o777)
    (tmp_path / "public").chmod(0o777)
    (tmp_path / "link").symlink_to("public")
    assert not only_ours_beneath(tmp_path / "link")


def test_what_another_user_owns_is_not_ours(tmp_path: Path, monkeypatch) -> None:
    """Nor a file of theirs in a folder of ours; the system's own is."""
    state = os.stat(tmp_path)
    assert is_ours(state)
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    other = [*state[:4], 54321, *state[5:]]
    assert not is_ours(os.stat_result(other))


def test_folders_are_made_for_this_user_only(tmp_path: Path) -> None:
    """Whatever the umask says."""
    before = os.umask(0)
    try:
        Store(tmp_path / "a" / "b").write(KEY, 1)
    finally:
        os.umask(before)
    modes = [(tmp_path / name).stat().st_mode & 0o777 for name in ("a", "a/b")]
    assert modes == [0o700, 0o700]


@pytest.mark.parametrize("said", ["", "relative/cache"])
def test_without_a_home_nothing_is_made_in_a_folder_called_tilde(monkeypatch, said: str) -> None:
    """It landed in `./~`, wherever the program was started."""
    monkeypatch.setenv("XDG_CACHE_HOME", said)
    monkeypatch.setattr(stores._config, "CACHE_DIR", "")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    home = cache_home()
    assert home.is_absolute() and "~" not in str(home)
    assert home == Path(os.environ["DECMCTS_TEMPORARY_CACHE"])
