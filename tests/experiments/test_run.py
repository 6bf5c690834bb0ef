"""Runs are made once, by whatever executor, and what they show is kept."""

from __future__ import annotations

import csv
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from decmcts import experiment
from decmcts.errors import InputError
from decmcts.experiments.kinds import Asked, Rows
from decmcts.experiments.made_print import made_gcode
from decmcts.experiments.prints import shown
from decmcts.experiments.run import EXPERIMENTS, cluster_at, compute
from decmcts.version import __version__
from tests.cli.test_bad_input import SQUARE, gcode

MEASURED = ("cpu_s", "thought_s", "improved_s")  # what a clock says


class Counting(ThreadPoolExecutor):
    """One thread that counts what it is given, and may fail."""

    def __init__(self, fails_at: int = -1) -> None:
        super().__init__(1)
        self.given, self._fails_at = 0, fails_at

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.given += 1
        return super().submit(_broken if self.given == self._fails_at else fn, *args, **kwargs)


def _broken(*_: Any) -> None:
    raise RuntimeError("a worker ended")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A folder with a small print of one's own."""
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "towers.gcode").write_text(made_gcode([(60, 100), (240, 100)], layers=2))
    return folder


def rows_by(executor: Executor, own: Path, out: Path) -> list[dict[str, str]]:
    """Return the rows of the quickest experiment, without what was measured by a clock."""
    found = experiment("two-heads", out, prints=own, iterations=1, seeds=2, executor=executor)
    assert not found.failed
    return [{k: v for k, v in row.items() if k not in MEASURED} for row in found.rows]


def test_names_of_prints_may_be_no_text(tmp_path: Path) -> None:
    """They are written and read back the same, whatever the locale."""
    rows = Rows(tmp_path / "rows.csv", ("print",))
    for name in ("teil\udcfc.gcode", "größe.gcode"):
        rows.append({"print": name, "error": ""})
    again = Rows(tmp_path / "rows.csv", ("print",))
    assert [row["print"] for row in again.rows] == ["teil\udcfc.gcode", "größe.gcode"]


@pytest.mark.parametrize("left", ["b,2,", "b", "", "b,2,3.5,"])
def test_a_row_that_was_broken_off_is_made_again(tmp_path: Path, left: str) -> None:
    """A power failure left half a row: it counted as made, and the table was an internal error."""
    path = tmp_path / "rows.csv"
    rows = Rows(path, ("print",))
    rows.append({"print": "a", "cost": 1, "error": ""})
    path.write_bytes(path.read_bytes() + left.encode())
    again = Rows(path, ("print",))
    assert again.missing([{"print": "a"}, {"print": "b"}]) == [{"print": "b"}]
    again.append({"print": "b", "cost": 2, "error": ""})
    assert path.read_text().split() == ["print,cost,error", "a,1,", "b,2,"]
    assert [row["cost"] for row in Rows(path, ("print",)).rows] == ["1", "2"]


@pytest.mark.slow
def test_rows_are_kept_and_not_made_again(own: Path, tmp_path: Path) -> None:
    """An experiment takes hours: one that was stopped goes on where it was."""
    out = tmp_path / "out"
    with Counting(fails_at=3) as by, pytest.raises(RuntimeError):
        experiment("two-heads", out, prints=own, iterations=1, seeds=2, executor=by)
    kept = list(csv.DictReader((out / "two-heads.csv").read_text().splitlines()))
    assert len(kept) == 2
    with Counting() as by:
        rows = rows_by(by, own, out)
        assert by.given == 2
    assert [row["seed"] for row in rows] == ["0", "1", "0", "1"]
    with Counting() as by:
        assert rows_by(by, own, out) == rows
        assert by.given == 0
        again = experiment("two-heads", out, prints=own, iterations=2, seeds=1, executor=by)
        assert by.given == len(again.rows) == 2  # other settings are other runs
    assert all(row["version"] == __version__ and row["numpy"] for row in rows)
    assert [path.name for path in again.paths] == ["two-heads.csv", "two-heads.md", "two-heads.png"]
    assert all(path.stat().st_size > 100 for path in again.paths)
    assert "| towers | none |" in again.page


@pytest.mark.long
def test_rows_are_equal_whoever_computes_them(own: Path, tmp_path: Path) -> None:
    """By one thread, by a process and by a Dask cluster of two workers, at equal iterations."""
    from distributed import LocalCluster

    with ThreadPoolExecutor(1) as serial:
        rows = rows_by(serial, own, tmp_path / "serial")
    processes = experiment("two-heads", tmp_path / "p", prints=own, iterations=1, seeds=2, jobs=1)
    assert [{k: v for k, v in row.items() if k not in MEASURED} for row in processes.rows] == rows
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as dask, cluster_at(dask.scheduler_address) as cluster:  # fmt: skip
        assert rows_by(cluster, own, tmp_path / "dask") == rows


def test_a_refused_print_is_a_row_that_says_why(tmp_path: Path) -> None:
    """One bad file among many must not end the others."""
    key = {"print": "none.gcode", "folder": str(tmp_path), "cut": "none", "seconds": 0.0,
           "iterations": 1, "seed": 0, "version": __version__}  # fmt: skip
    row = compute("two-heads", key)
    assert "no such file" in row["error"]
    assert "not 0.0.0" in compute("two-heads", {**key, "version": "0.0.0"})["error"]


def test_what_is_asked_for_wrongly_is_refused(tmp_path: Path) -> None:
    """Before anything is made."""
    for refused in (
        {"name": "two-hats"}, {"seeds": 0}, {"iterations": 0}, {"jobs": 0},
        {"time_limit_s": -1.0}, {"prints": tmp_path}, {"prints": tmp_path / "none"},
    ):  # fmt: skip
        with pytest.raises(InputError):
            experiment(**{"name": "paper", "folder": tmp_path / "out", **refused})
    assert not (tmp_path / "out").exists()
    (tmp_path / "paper.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="no table of the experiment"):
        experiment("paper", tmp_path)
    with pytest.raises(InputError, match="no folder"):
        experiment("paper", tmp_path / "paper.csv")


def test_no_cluster_is_said_in_one_line() -> None:
    """Nobody reads a stack of Dask's."""
    with pytest.raises(InputError, match="no cluster at"), cluster_at("nowhere://x"):
        pass


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_run_has_a_key_of_its_own(name: str) -> None:
    """Else a row would stand for two runs."""
    chosen = EXPERIMENTS[name]
    for full in (False, True):
        keys = [tuple(str(key[n]) for n in chosen.key) for key in chosen.keys(Asked(full))]
        assert len(keys) == len(set(keys)) > 0
    assert all(set(key) == set(chosen.key) for key in chosen.keys(Asked()))


@pytest.mark.slow
def test_processes_end_with_a_call_that_fails(own: Path, tmp_path: Path) -> None:
    """Ctrl-C must not leave any behind."""
    import multiprocessing

    def stops(_event: object) -> None:
        if multiprocessing.active_children():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        experiment("two-heads", tmp_path, prints=own, iterations=1, jobs=1, report=stops)
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_a_print_of_one_contour_is_a_row_like_others(tmp_path: Path) -> None:
    """No travel is no error: each was an internal one that ended the whole experiment."""
    (tmp_path / "one.gcode").write_text(gcode(SQUARE))
    least = {"print": "one.gcode", "folder": str(tmp_path), "seconds": 0.0, "iterations": 1,
             "seed": 0, "version": __version__}  # fmt: skip
    paper = {"method": "local", "exploration": "", "gamma": "", "nearest": ""}
    row = compute("paper", {**least, **paper})
    assert not row["error"] and row["less_percent"] == 0.0
    printing = {"heads": 2, "phase": "printing", "loss": 0.0, "delay_s": 0.0, "fails": "stopped"}
    row = compute("loss-and-failure", {**least, **printing, "moment": 0.5})
    assert not row["error"] and row["contours"] == 1


@pytest.mark.parametrize("name", ["row-of-parts.gcode", "row-1.gcode", "row-1-2-3.gcode", "x.y"])
def test_one_s_own_print_may_be_called_like_a_row(name: str) -> None:
    """Where all runs were done, no table and no figure came of them."""
    values = {"cut": "none", "waits": "0.1", "idle": "0.2", "speedup": "1.5", "error": ""}
    EXPERIMENTS["two-heads"].draw([{"print": name, **values}]).draw_without_rendering()


def test_names_of_prints_keep_their_dots() -> None:
    """`v1.2` and `v1.3` were one print in tables and figures."""
    names = ["v1.2.gcode", "v1.3.GCODE.gz", "a.b.gcode.3mf", "row-4-20-30", "plain"]
    assert list(map(shown, names)) == ["v1.2", "v1.3", "a.b", "row-4-20-30", "plain"]


def test_no_more_processes_than_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of very many the operating system made none, and that was an internal error."""
    started = []

    def processes(jobs: int) -> ThreadPoolExecutor:
        started.append(jobs)
        return ThreadPoolExecutor(1)

    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "a.gcode").write_text("")
    monkeypatch.setattr("decmcts.experiments.run._processes", processes)
    monkeypatch.setattr("decmcts.experiments.run._compile", lambda *_: None)
    experiment("two-heads", tmp_path, prints=tmp_path / "none", iterations=1, seeds=1, jobs=10**12)
    assert started == [2]
