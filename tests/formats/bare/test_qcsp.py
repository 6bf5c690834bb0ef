"""Bare team problems as files: one form, read strictly; schedules counted from 1."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.bare.qcsp import QcspSchedule, is_qcsp, read_qcsp, schedule_text
from tests.team.qcsp.problems import problem_of

TINY: dict[str, Any] = {
    "name": "tiny",
    "n": 3,
    "q": 2,
    "t": 1,
    "s": 1,
    "p": [4, 3, 5],
    "l": [2, 2, 6],
    "r": [0, 0],
    "l0": [1, 4],
    "Phi": [[1, 2]],
}


def test_a_file_says_all_of_it(tmp_path: Path) -> None:
    """Names are the literature's; s free bays are s + 1 from crane to crane."""
    (tmp_path / "tiny.qcsp").write_text(json.dumps(TINY))
    problem = read_qcsp(tmp_path / "tiny.qcsp")
    assert (problem.name, len(problem), problem.cranes) == ("tiny", 3, 2)
    assert problem.duration.tolist() == [4.0, 3.0, 5.0]
    assert problem.bay.tolist() == [2, 2, 6]
    assert (problem.travel, problem.spacing) == (1.0, 2)
    assert problem.precedence.tolist() == [[0, 1]]


def test_one_of_a_collection_is_named_behind_a_colon(tmp_path: Path) -> None:
    """Public instances come many in a file."""
    path = tmp_path / "all.json.gz"
    path.write_bytes(gzip.compress(json.dumps({"a": TINY}).encode()))
    assert read_qcsp(f"{path}:a").name == "tiny"
    assert is_qcsp(Path(f"{path}:a"))
    with pytest.raises(InputError, match="no instance 'b' among its 1"):
        read_qcsp(f"{path}:b")


@pytest.mark.parametrize("name", ["tiny.qcsp", "tiny.qcsp.gz", "TINY.QCSP.GZ", "x.json"])
def test_packed_or_not_it_is_a_problem(tmp_path: Path, name: str) -> None:
    """docs/qcsp.md says so; the names with .gz were taken for G-code."""
    values = {key: value for key, value in TINY.items() if key != "name"}
    text = json.dumps(values).encode()
    packed = name.lower().endswith(".gz")
    (tmp_path / name).write_bytes(gzip.compress(text) if packed else text)
    assert is_qcsp(tmp_path / name)
    assert read_qcsp(tmp_path / name).name == name.split(".")[0]


def test_a_collection_without_a_name_says_what_to_name(tmp_path: Path) -> None:
    """With one instance in it that is meant; what holds none is said too."""
    path = tmp_path / "all.json.gz"
    path.write_bytes(gzip.compress(json.dumps({"a": TINY, "b": TINY}).encode()))
    assert is_qcsp(path)
    with pytest.raises(InputError, match=r"holds 2 instances; name one: all\.json\.gz:a"):
        read_qcsp(path)
    path.write_bytes(gzip.compress(json.dumps({"b": TINY}).encode()))
    assert read_qcsp(path).name == "tiny"
    path.write_bytes(gzip.compress(b'{"format": "decmcts-plan"}'))
    with pytest.raises(InputError, match=r"all\.json\.gz: holds no team problem"):
        read_qcsp(path)


@pytest.mark.parametrize("text", ['{"p": [1], "p": [2]}', '{"a": {"t": 1, "t": 2}}'])
def test_a_key_that_stands_twice_is_refused(tmp_path: Path, text: str) -> None:
    """Which of the two was meant? plan.json is read as strictly."""
    (tmp_path / "x.qcsp").write_text(text)
    with pytest.raises(InputError, match=r"x\.qcsp: the key '.' stands twice"):
        read_qcsp(tmp_path / "x.qcsp")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"p": [4, 3]}, "l: 3 values where p has 2"),
        ({"p": [4, 0, 5]}, "p: task 2 takes no time"),
        ({"p": [4, float("nan"), 5]}, "p: number 1"),
        ({"l": [2, 2, 0]}, r"l\[2\]: expected a bay"),
        ({"l": [2, 2.5, 6]}, r"l\[1\]: expected a bay"),
        ({"n": 4}, "n: is 4, p has 3 values"),
        ({"r": [], "l0": [], "q": 0}, "r: no crane"),
        ({"t": 0}, "t: travel of 0"),
        ({"s": -1}, "s: expected an integer"),
        ({"l0": [4, 4]}, "l0: cranes 1 and 2 begin out of order"),
        ({"l0": [4, 5], "r": [0, 1]}, "l0: cranes 1 and 2 begin 1 bays apart where 2"),
        ({"Phi": [[1, 4]]}, r"Phi\[0\]: expected two tasks in 1..3"),
        ({"Phi": [[1, 2], [2, 1]]}, "Phi: a cycle of precedence before task 1"),
        ({"Phi": [[3, 3]]}, "Phi: a cycle of precedence before task 3"),
        ({"speed": 1}, "speed: unknown key"),
    ],
)
def test_what_is_no_problem_is_refused_by_field(change: dict[str, Any], word: str) -> None:
    """One clear line instead of a wrong schedule."""
    with pytest.raises(InputError, match=word):
        problem_of(TINY | change)


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff\xfe", b"[" * 100_000])
def test_what_is_no_json_is_refused(tmp_path: Path, content: bytes) -> None:
    """Damage is said, with the file."""
    (tmp_path / "x.qcsp").write_bytes(content)
    with pytest.raises(InputError, match=r"x\.qcsp"):
        read_qcsp(tmp_path / "x.qcsp")


def test_cranes_may_begin_too_near_if_all_are_ready() -> None:
    """Published instances with wide safety distances do."""
    assert problem_of(TINY | {"l0": [4, 5]}).start.tolist() == [4, 5]


def test_a_schedule_counts_from_one_and_in_order_of_time() -> None:
    """Readers of the file know the numbers of the problem's file."""
    paths = (np.array([[0.0, 1.0], [1.0, 2.0]]), np.array([[0.0, 4.0], [2.0, 6.0]]))
    schedule = QcspSchedule(np.array([0, 0, 1]), np.array([1.0, 5.0, 2.0]), paths, 8.0)
    told = json.loads(schedule_text(problem_of(TINY), schedule))
    assert told["makespan"] == 8.0
    assert [task["task"] for task in told["cranes"][0]["tasks"]] == [1, 2]
    assert told["cranes"][1]["tasks"] == [{"task": 3, "bay": 6, "begin": 2.0, "end": 7.0}]
    assert told["cranes"][1]["way"] == [[0.0, 4.0], [2.0, 6.0]]
