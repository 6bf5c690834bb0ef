"""The judge of bare team problems finds every kind of fault."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from decmcts.formats.bare.qcsp import QcspProblem, QcspSchedule
from sim.qcsp import faults_of
from tests.team.qcsp.problems import problem_of

PROBLEM: QcspProblem = problem_of(
    {"t": 1, "s": 1, "p": [4, 3, 5], "l": [2, 2, 6], "r": [0, 1], "l0": [1, 4], "Phi": [[1, 2]]}
)
LEFT = [[0.0, 1.0], [1.0, 2.0], [8.0, 2.0]]
RIGHT = [[0.0, 4.0], [1.0, 4.0], [3.0, 6.0], [8.0, 6.0]]


def schedule(
    *, crane: Any = (0, 0, 1), begin: Any = (1, 5, 3), paths: Any = (LEFT, RIGHT), end: float = 8.0
) -> QcspSchedule:
    """Return a sound schedule but for what is given."""
    return QcspSchedule(
        np.array(crane, np.int32),
        np.array(begin, np.float64),
        tuple(np.array(path, np.float64) for path in paths),
        end,
    )


def test_a_sound_schedule_has_no_fault() -> None:
    """Else nothing below means anything."""
    assert faults_of(PROBLEM, schedule()) == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"crane": (0, 0)}, "not 3 tasks"),
        ({"crane": (0, 0, 2)}, "done by crane 3"),
        ({"begin": (1, float("nan"), 3)}, "task 2 begins at nan"),
        ({"begin": (5, 1, 3)}, "task 2 begins before task 1 ends"),
        ({"begin": (1, 4, 3)}, "does tasks 1 and 2 at once"),
        ({"begin": (1, 5, 2)}, "crane 2 is not at task 3 at 2"),
        ({"end": 7.0}, "ends at 8, not at 7"),
        ({"paths": (LEFT, RIGHT[1:])}, "begins at 1, not at 0"),
        ({"paths": (LEFT[:1], RIGHT)}, "crane 1 is not at task 1"),
        ({"paths": (LEFT, [[0, 4], [2, 6], [8, 6]])}, "crane 2 is not at bay 4 at 1"),
        ({"paths": (LEFT, [[0, 4], [1, 4], [2, 6], [8, 6]])}, "moves from 4 to 6 in 1"),
        ({"paths": ([[0, 1], [1, 2], [3, 1], [8, 2]], RIGHT)}, "crane 1 is not at task 1 at 3"),
        ({"paths": ([[0, 1], [0, 2], [8, 2]], RIGHT)}, "does not go forward in time"),
    ],
)
def test_each_fault_is_found(change: dict[str, Any], word: str) -> None:
    """A judge that misses one is no judge."""
    assert any(word in fault for fault in faults_of(PROBLEM, schedule(**change)))


def test_distance_is_kept_while_idle_and_between_rows_of_a_path() -> None:
    """Crane 2 has nothing to do and stands where crane 1 comes by."""
    problem = problem_of({"t": 1, "s": 1, "p": [1], "l": [8], "r": [0, 0], "l0": [1, 5], "Phi": []})
    come, stay = [[0, 1], [7, 8], [8, 8]], [[0, 5]]
    near = QcspSchedule(np.array([0]), np.array([7.0]), (np.array(come), np.array(stay)), 8.0)
    assert "bays apart" in faults_of(problem, near)[0]
    aside = [[0, 5], [5, 10]]
    fine = QcspSchedule(np.array([0]), np.array([7.0]), (np.array(come), np.array(aside)), 8.0)
    assert faults_of(problem, fine) == []


def test_cranes_too_near_at_first_may_not_come_nearer() -> None:
    """They part, and once apart they stay so."""
    problem = problem_of({"t": 1, "s": 4, "p": [1], "l": [1], "r": [0, 0], "l0": [1, 3], "Phi": []})
    one = QcspSchedule(
        np.array([0]), np.array([0.0]), (np.array([[0, 1]]), np.array([[0, 3]])), 1.0
    )
    assert faults_of(problem, one) == []
    nearer = dataclasses.replace(one, paths=(one.paths[0], np.array([[0, 3], [1, 2]])))
    assert "2 are needed" in faults_of(problem, nearer)[0]
    back = np.array([[0, 3], [5, 8], [8, 5]])
    assert (
        "5 are needed"
        in faults_of(problem, dataclasses.replace(one, paths=(one.paths[0], back)))[0]
    )


def test_what_rounding_moves_is_no_fault() -> None:
    """A crane that goes 1000 bays a second is a little away where it leaves a hair too early."""
    problem = problem_of({"t": 1e-3, "s": 1, "p": [4], "l": [2], "r": [1], "l0": [1], "Phi": []})
    hair = 1e-8
    path = np.array([[0.0, 1.0], [1.0 - hair, 1.0], [1.001 - hair, 2.0], [5.001, 2.0]])
    left = QcspSchedule(np.array([0]), np.array([1.001]), (path,), 5.001)
    assert faults_of(problem, left) == []
    path[1:3, 0] -= 1e-4
    assert "crane 1 is not at bay 1 at 1" in faults_of(problem, left)[0]
