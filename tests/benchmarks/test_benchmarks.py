"""The benchmarks run, resume and write what they promise, on a print that ships with us.

Their long runs are made by hand; here each makes its smallest run, in this process: what it
imports, and the kernels it loads, are there for the next one. Most are marked `long`: they
serve whoever measures, not whoever prints.
"""

from __future__ import annotations

import csv
import importlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
ONE = ["--models", "four_nuts", "--time-limit", "0.2"]
SMALLEST = {  # script: (options, rows, files)
    "planners": (
        [*ONE, "--settings", "paper-fixed", "--process", "free", "--planners", "hybrid,local"],
        2,
        ("planners.md", "planners_0.2s.png"),
    ),
    "models": (
        [*ONE, "--machines", "paper", "--freedoms", "reversible"],
        1,
        ("models.md", "models.png", "reductions.png"),
    ),
    "convergence": (
        [*ONE, "--planners", "greedy,hybrid"],
        2,
        ("convergence.md", "convergence.png", "convergence_history.csv"),
    ),
    "scale": ([*ONE, "--stop-at", "0.1"], 1, ("scale.md", "scale.png")),
    "ablation": (
        [*ONE, "--settings", "paper-reversible", "--variants", "hybrid,twin,bare"],
        3,
        ("ablation.md", "ablation.png"),
    ),
    "certificates": (ONE, 1, ("certificates.md", "certificates.png")),
    "quality": (ONE, 4, ("quality.md", "quality.png")),
    "ledger": (ONE, 1, ("ledger.md",)),
    "simulated": ([*ONE, "--trials", "1"], 1, ("simulated.md",)),
    "shared_parts": ([*ONE, "--cuts", "inside"], 1, ("shared_parts.md",)),
}
RESUMED = ("planners", "certificates")  # all go on by the same code


Runner = Callable[[str, list[str], Path], None]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Runner:
    """Run a benchmark as its command line would; processes it starts find the project too."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("DECMCTS_CORPUS", "/nowhere")

    def run(script: str, options: list[str], results: Path) -> None:
        monkeypatch.setattr("sys.argv", [script, *options, "--results", str(results)])
        importlib.import_module(script).main()

    return run


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let what runs in a process of its own, to be measured alone, run in this one."""

    def in_this_process(command: list[str], **_: Any) -> dict[str, Any]:
        row = importlib.import_module(Path(command[1]).stem).run(json.loads(command[2]))
        return {**json.loads(json.dumps(row)), "exit": 0, "wall_s": 0.0, "peak_mib": 0.0}

    for script in ("team_growth", "team_run"):
        monkeypatch.setattr(f"{script}.own_process", in_this_process)


@pytest.mark.long
@pytest.mark.parametrize("script", SMALLEST)
def test_runs_once_and_resumes(run, script, tmp_path):
    """A long table is made in several sittings; what is there must not be run again."""
    options, rows, files = SMALLEST[script]
    run(script, options, tmp_path)
    written = (tmp_path / f"{script}.csv").read_text()
    assert len(written.splitlines()) == 1 + rows
    assert "error" in written.splitlines()[0]
    assert all((tmp_path / name).stat().st_size > 0 for name in files)
    assert "## Failed" not in (tmp_path / files[0]).read_text()
    assert "four_nuts" in (tmp_path / files[0]).read_text()
    if script in RESUMED:
        run(script, options, tmp_path)
        assert (tmp_path / f"{script}.csv").read_text() == written


@pytest.mark.long
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium: apt-get install it")
def test_a_report_is_measured_in_a_browser(tmp_path):
    """Size, and seconds until it is there, of one that ships with us.

    In a process of its own: Playwright runs once in each, and the tests have theirs.
    """
    options = ["--models", "four_nuts", "--repeats", "1", "--machine", "mk4s"]
    subprocess.run(
        [sys.executable, ROOT / "benchmarks/report.py", *options, "--results", tmp_path],
        env={**os.environ, "PYTHONPATH": str(ROOT), "DECMCTS_CORPUS": "/nowhere"},
        check=True,
    )
    (row,) = csv.DictReader((tmp_path / "report.csv").read_text().splitlines())
    assert 0.1 < float(row["mb"]) < 1.0 and float(row["pictures_a_s"]) > 0.0
    assert "four_nuts" in (tmp_path / "report.md").read_text()


@pytest.mark.long
def test_a_part_is_shared_by_several_heads(run, tmp_path):
    """The part is made by the benchmark itself; two heads are nearly twice as fast."""
    run("shared_by_many", ["--heads", "2", "--cuts", "all", "--time-limit", "0.5"], tmp_path)
    (row,) = csv.DictReader((tmp_path / "shared_by_many.csv").read_text().splitlines())
    assert float(row["speedup"]) > 1.8 and not row["error"]
    assert "| 2 | all |" in (tmp_path / "shared_by_many.md").read_text()


@pytest.mark.long
def test_faulty_cut_plans_are_refused(run, tmp_path):
    """Of each family some kinds, on the smallest slab; the long run has thousands."""
    kinds = "a piece twice,a cut in skirt,at a corner,lines of a piece dropped,a piece of no"
    options = ["--slabs", "1", "--count", "5", "--mutants", kinds, "--time-limit", "0.1"]
    run("cut_plans", options, tmp_path)
    assert "5 kinds, 5 mutants" in (page := (tmp_path / "cut_plans.md").read_text())
    assert "4 refused, 1 valid" in page


@pytest.mark.long
def test_parts_of_the_search_for_bare_sequences_are_left_out(run, tmp_path):
    """A twin tells the noise; done once, not run again."""
    options = ["--kinds", "sparse", "--variants", "all,twin,no-elites", "--seeds", "0"]
    run("sop_ablation", [*options, "--time-limit", "0.1"], tmp_path)
    written = (tmp_path / "sop_ablation.csv").read_text()
    rows = list(csv.DictReader(written.splitlines()))
    assert len(rows) == 3 * len({row["problem"] for row in rows}) > 3
    assert all(row["error"] == "" and float(row["cost"]) >= float(row["bound"]) for row in rows)
    assert "| without elites |" in (tmp_path / "sop_ablation.md").read_text()
    run("sop_ablation", [*options, "--time-limit", "0.1"], tmp_path)
    assert (tmp_path / "sop_ablation.csv").read_text() == written


@pytest.mark.long
def test_teams_are_compared_once(run, tmp_path):
    """Ours and a baseline on a few contours; done once, not run again."""
    options = ["--models", "plate:60", "--heads", "2", "--time-limit", "0.5"]
    options += ["--methods", "processes,greedy-dispatch"]
    run("teams", options, tmp_path)
    written = (tmp_path / "teams.csv").read_text()
    rows = list(csv.DictReader(written.splitlines()))
    assert [row["method"] for row in rows] == ["processes", "greedy-dispatch"]
    assert all(row["faults"] == "0" and row["error"] == "" for row in rows)
    assert "| greedy-dispatch | 1 |" in (tmp_path / "teams.md").read_text()
    run("teams", options, tmp_path)
    assert (tmp_path / "teams.csv").read_text() == written


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_a_part_left_out_is_compared_with_the_whole_search(run, tmp_path):
    """On a few contours, half a second each."""
    options = ["--models", "plate:60", "--time-limit", "0.5", "--methods", "all,no_windows"]
    run("team_ablation", options, tmp_path)
    written = (tmp_path / "team_ablation.csv").read_text()
    rows = list(csv.DictReader(written.splitlines()))
    assert [row["method"] for row in rows] == ["all", "no windows"]
    assert all(row["faults"] == "0" and row["error"] == "" for row in rows)
    page = (tmp_path / "team_ablation.md").read_text()
    assert "| all | 1 |" in page and "## Entropy" in page


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_growth_is_measured_and_fitted(run, tmp_path):
    """Two sizes of the example, costs and a short search; done once, not run again."""
    options = ["--models", "four_nuts", "--contours", "30,60", "--heads", "2"]
    options += ["--time-limit", "0.1", "--reference", "0.2"]
    run("team_growth", options, tmp_path)
    written = (tmp_path / "team_growth.csv").read_text()
    rows = list(csv.DictReader(written.splitlines()))
    assert [row["part"] for row in rows] == ["cost", "cost"] + ["search"] * 4
    assert all(row["error"] == "" and row["faults"] in ("", "0") for row in rows)
    page = (tmp_path / "team_growth.md").read_text()
    assert "## Exponents" in page and "## Seconds to within 2 %" in page
    assert (tmp_path / "team_growth.png").stat().st_size > 0
    run("team_growth", options, tmp_path)
    assert (tmp_path / "team_growth.csv").read_text() == written


@pytest.mark.long
def test_random_teams_are_judged_and_counted(run, tmp_path):
    """Every preset and one machine made at random, a plan each; done once, not run again."""
    options = ["--machines", "1", "--plans", "1", "--presets", "1"]
    run("random_teams", options, tmp_path)
    written = (tmp_path / "random_teams.csv").read_text()
    page = (tmp_path / "random_teams.md").read_text()
    assert f"**{len(written.splitlines()) - 1} plans on" in page
    assert "0 not accepted, 0 serial" in page
    run("random_teams", options, tmp_path)
    assert (tmp_path / "random_teams.csv").read_text() == written


@pytest.mark.slow
def test_small_teams_are_held_against_brute_force(tmp_path):
    """One print of four contours; ours is never below the least.

    As plain Python: compiling the brute force takes longer than all of this.
    """
    code = "import small_teams; small_teams.SHAPES = ((2, 2, 1),); small_teams.main()"
    command = [sys.executable, "-W", "ignore::RuntimeWarning", "-c", code, "--results"]  # overflow
    command += [str(tmp_path), "--instances", "1", "--time-limit", "0.1"]
    where = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'benchmarks'}", "NUMBA_DISABLE_JIT": "1"}
    subprocess.run(command, check=True, env=where)
    written = (tmp_path / "small_teams.csv").read_text()
    (row,) = csv.DictReader(written.splitlines())
    assert row["error"] == "" and row["complete"] == "1"
    assert float(row["first_s"]) >= float(row["ours_s"]) >= float(row["least_s"]) > 0.0
    assert f"Reached in {row['reached']} of 1 runs" in (tmp_path / "small_teams.md").read_text()


def test_rows_of_a_newer_benchmark_may_have_more_columns(tmp_path):
    """A figure under another column's name would be worse than none."""
    path = tmp_path / "rows.csv"
    path.write_text("model,verified\nold,True\n")
    code = (
        "from pathlib import Path; from common import Rows; "
        f"rows = Rows(Path({str(path)!r}), ('model',)); "
        "rows.append({'model': 'new', 'retractions': 3, 'verified': False})"
    )
    where = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'benchmarks'}"}
    subprocess.run([sys.executable, "-c", code], check=True, env=where)
    assert path.read_text().split() == ["model,verified,retractions", "old,True,", "new,False,3"]


def test_tables_come_from_rows_alone(run, tmp_path):
    """A table is made anew, with a note, without a single run."""
    head = "model,limit_s,cache,repeat,contours,wall_s,first_word_s,error"
    runs = ["four_nuts,1.0,empty,0,964,61.5,1.0,", "four_nuts,1.0,warm,1,964,6.5,0.4,"]
    (tmp_path / "startup.csv").write_text("\n".join([head, *runs, ""]))
    run("startup", ["--table-only", "--note", "a busy machine"], tmp_path)
    table = (tmp_path / "startup.md").read_text()
    assert "a busy machine" in table
    assert "| four_nuts | 964 | warm | 1 | 6.50 | 6.50 | 0.40 | NO |" in table


def test_steps_around_the_search_are_held_to_their_limit(run, tmp_path):
    """What the search takes does not count; a step that takes too long must show."""
    head = "command,model,limit_s,place,step,wall_s,cpu_s,contours,silence_s,peak_mib,error"
    steps = ["0,reading,9.0,4.0", "1,heads plan,10.0,20.0", "2,verifying,40.0,27.0"]
    runs = [f"launch,x,10.0,{step},15490,7.5,900," for step in steps]
    (tmp_path / "steps.csv").write_text("\n".join([head, *runs, ""]))
    run("steps", ["--table-only"], tmp_path)
    table = (tmp_path / "steps.md").read_text()
    assert "| launch | x | 15490 | 59.0 | 51.0 | 49.0 | 31.0 | NO | 7.5 | 900 |" in table
    assert "| launch | x | verifying | 40.0 | 27.0 |" in table


def test_hybrid_is_judged_against_every_other_planner(run, tmp_path):
    """One planner that is better, or the yardstick not reached, must show."""
    head = "model,machine,process,freedom,planner,limit_s,seed,travel_after_mm,less_percent,error"
    rows = [head]
    found = {"hybrid": 90.0, "local": 91.0, "mcts": 95.0, "greedy": 99.0, "layerwise": 98.0}
    for model, freedom in (("won", "seam"), ("lost", "seam"), ("pillars_5x5", "fixed")):
        for planner, travel in found.items():
            mm = 80.0 if (model, planner) == ("lost", "mcts") else travel
            rows.append(f"{model},paper,free,{freedom},{planner},60.0,0,{mm},{100 - mm},")
    (tmp_path / "planners.csv").write_text("\n".join([*rows, ""]))
    run("planners", ["--table-only"], tmp_path)
    text = (tmp_path / "planners.md").read_text()
    assert "reached by `hybrid` in 0 of 1, `local` in 0 of 1" in text
    assert "no worse than all others in 1 of 3 complete rows" in text
    lines = {line.split(" | ")[0].strip("| "): line for line in text.splitlines()}
    assert lines["won"].endswith("| yes |")
    assert lines["lost"].endswith("| NO: mcts by 12.50 % |")
    assert lines["pillars_5x5"].endswith("| NO: annealing |")


def test_a_model_of_several_seeds_counts_once(run, tmp_path):
    """Else medians over models lean towards the one that was run again."""
    head = "model,machine,process,freedom,planner,limit_s,seed,travel_after_mm,less_percent,error"
    gains = {"hybrid": [("a", 0, 10), ("b", 0, 50), ("b", 1, 50), ("b", 2, 50), ("c", 0, 20)]}
    gains["local"] = [("a", 0, 10), ("b", 0, 40), ("c", 0, 20)]
    rows = [
        f"{model},mk4s,keep,seam,{planner},60.0,{seed},{100 - gain},{gain},"
        for planner, runs in gains.items()
        for model, seed, gain in runs
    ]
    (tmp_path / "planners.csv").write_text("\n".join([head, *rows, ""]))
    run("planners", ["--table-only", "--planners", "hybrid,local"], tmp_path)
    text = (tmp_path / "planners.md").read_text()
    assert "| mk4s seam | keep | 3 | 20.0 (15.0 to 35.0) | 20.0 (15.0 to 30.0) |" in text


@pytest.mark.long
def test_a_failure_and_a_lossy_run_are_carried_out(run, tmp_path):
    """Real processes on a print made by the benchmark; all is printed once, and nothing touches."""
    options = ["--prints", "towers:2", "--failures", "1", "--two", "1", "--lossy", "1"]
    run("runs", [*options, "--time-limit", "0.5"], tmp_path)
    rows = list(csv.DictReader((tmp_path / "runs.csv").read_text().splitlines()))
    clog, two, lossy = sorted(
        rows, key=lambda row: ("clog", "two failures", "lossy").index(row["kind"])
    )
    for row in rows:
        assert not row["error"] and row["contacts"] == "0" and row["twice"] == "0"
    for row in (clog, lossy):
        assert row["complete"] == "1" and abs(float(row["lost_mm"])) < 1.0
    assert two["second"]
    assert float(clog["clairvoyant"]) > 0.9 and float(clog["waiting"]) < 1.0
    assert "towers:2" in (tmp_path / "runs.md").read_text()


def test_the_growth_of_a_single_print_is_drawn(monkeypatch, tmp_path):
    """No line to compare with: it lies on the only point but for rounding, and then the
    axis has a height that matplotlib divides by and that is nothing."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    row = {"planner": "hybrid", "contours": "964", "peak_mib": "418", "error": ""}
    row |= {"read_s": "0.4", "graph_s": "0.087", "iterations_per_s": "5797625.0"}
    importlib.import_module("scale").plot([row], tmp_path / "scale.png")
    row = {"heads": "2", "contours": "964", "order_s": "0.487", "agent_mib": "418", "error": ""}
    importlib.import_module("team_growth").plot([row], tmp_path / "growth.png")
    assert all((tmp_path / name).stat().st_size > 0 for name in ("scale.png", "growth.png"))
