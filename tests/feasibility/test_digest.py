"""The fingerprint of a problem."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.feasibility import digest
from decmcts.feasibility.build import build_graph
from decmcts.feasibility.digest import code_digest, problem_digest, team_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import Machine, Rail


@pytest.fixture
def problem(oracle: Any) -> tuple[Contours, DependencyGraph, Machine]:
    contours = oracle.make_contours(
        [[(0, 0, 0.2), (1, 0.1, 0.2)], [(0, 0, 0.4), (1, 0, 0.4)]], line=[3, 9]
    )
    machine = Machine("m", (0.0, 0.0), (200.0, 200.0), (oracle.heads["lopsided"],))
    return contours, build_graph(contours, machine.heads, clearance_mm=0.0), machine


def changed(contours: Contours, **fields: Any) -> Contours:
    kept = {name: getattr(contours, name) for name in Contours.__slots__}
    return Contours(**{**kept, **fields})


def test_digest_is_the_same_everywhere(problem: tuple[Any, Any, Any]) -> None:
    """Agents on different machines compare digests: the value itself is a contract."""
    assert problem_digest(*problem) == (
        "2074899e87e89e4a4839bd23be3a47e0f945d53095b812cdcd02cc32879004fd"
    )


def test_rounding_noise_and_text_do_not_count(problem: tuple[Any, Any, Any]) -> None:
    """A coordinate read as 0.1 or 0.30000000000000004 - 0.2 is the same coordinate."""
    contours, graph, machine = problem
    same = changed(contours, points=contours.points + 1e-9, line=contours.line + 5)
    other_name = replace(machine, name="x", source="y")
    assert problem_digest(same, graph, other_name) == problem_digest(*problem)


def test_everything_that_matters_counts(problem: tuple[Any, Any, Any]) -> None:
    """Two agents with different problems must notice before they talk."""
    contours, graph, machine = problem
    n = len(contours)
    variants = [
        (changed(contours, points=contours.points + 1e-3), graph, machine),
        (changed(contours, width=contours.width + 1e-3), graph, machine),
        (changed(contours, reversible=~contours.reversible), graph, machine),
        (contours, DependencyGraph.from_pairs(n, np.empty((0, 2), np.int32)), machine),
        (contours, graph, replace(machine, clearance_mm=0.1)),
        (contours, graph, replace(machine, rails=(Rail(0, ("test",), 70.0),))),
        (contours, graph, replace(machine, heads=machine.heads * 2)),
        (contours, graph, replace(machine, heads=(replace(machine.heads[0], pace=1.2),))),
    ]
    digests = {problem_digest(*problem)} | {problem_digest(*v) for v in variants}
    assert len(digests) == len(variants) + 1


def test_whole_numbers_and_tuples_of_a_file_do_not_count(problem: tuple[Any, Any, Any]) -> None:
    """A machine read from TOML has 200 where a preset has 200.0."""
    contours, graph, machine = problem
    whole = replace(machine, bed_max=(200, 200))
    assert problem_digest(contours, graph, whole) == problem_digest(*problem)


def test_agents_compare_all_that_resolving_depends_on(problem: tuple[Any, Any, Any]) -> None:
    """Hosts that differ in it took each other's plans for lies and released nothing."""
    contours = problem[0]
    job = PrintJob("print", contours)
    unset = np.full(len(contours.points), np.nan)
    variants = [
        replace(job, settings=ProcessSettings(travel_feed=90.0)),
        replace(job, settings=ProcessSettings(firmware_retraction=True)),
        replace(job, acceleration=unset),
        replace(job, acceleration=np.where(np.arange(len(unset)) == 1, 900.0, unset)),
        replace(job, refills=(1,)),
    ]
    digests = {team_digest("ab", each, code="cd") for each in [job, *variants]}
    digests |= {team_digest("ac", job, code="cd"), team_digest("ab", job, code="ce")}
    assert len(digests) == len(variants) + 3
    named = replace(job, name="other", slicer="another", notes=("x",))
    assert team_digest("ab", named, code="cd") == team_digest("ab", job, code="cd")


def test_the_code_of_the_planner_has_a_digest_of_its_own() -> None:
    """Another version resolves plans in another way; nobody has to count versions by hand."""
    assert len(code_digest()) == 64
    assert code_digest() == code_digest.__wrapped__()


def test_the_code_in_all_folders_of_the_planner_counts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Plans are resolved in folders within folders."""
    shutil.copytree(digest._HOME / "team", tmp_path / "team")
    monkeypatch.setattr(digest, "_HOME", tmp_path)
    before = code_digest.__wrapped__()
    with (tmp_path / "team/engine/plans.py").open("a") as file:
        file.write("#")
    assert code_digest.__wrapped__() != before
