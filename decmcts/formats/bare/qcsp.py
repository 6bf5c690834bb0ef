"""Bare team problems: quay cranes on one rail, their schedules, and both as files.

A crane is a head without a print: several in a row that cannot pass each other,
tasks at places on the rail, precedence, least makespan. Nothing is solved here.
Tasks and cranes are numbered from 1 in files and from 0 in memory; docs/qcsp.md
says what stands where.

References
----------
Kim & Park 2004; Meisel & Bierwirth 2011, "A unified approach for the evaluation
of quay crane scheduling models and algorithms" (the names of the fields).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import numpy as np

from decmcts.arguments import checked
from decmcts.arrays import Floats, Int32s
from decmcts.errors import InputError
from decmcts.formats.files.bounds import unpacked
from decmcts.formats.files.fields import Fields, fail, numbers, points, shown
from decmcts.formats.files.reading import once, read_bytes
from decmcts.print.brief import brief

QCSP_SUFFIXES = (".qcsp", ".qcsp.gz")
COLLECTION_SUFFIXES = (".json", ".json.gz")
MOST_TASKS = 2000
MOST_CRANES = 64
MOST_BAYS = 10_000
MOST_TIME = 1e9  # of a duration; sums stay exact far beyond what they need
_KEYS = ("name", "n", "q", "t", "s", "p", "l", "r", "l0", "Phi")


@dataclass(frozen=True, slots=True)
class QcspProblem:
    """Tasks at bays of one rail, and the cranes that share it, from left to right.

    Times are in the file's own unit. Cranes v < w keep `spacing` · (w - v) bays
    between them at all times.
    """

    name: str
    duration: Floats  # (n,) of each task, above 0
    bay: Int32s  # (n,) where it lies, from 1
    ready: Floats  # (q,) until then a crane stands at `start`
    start: Int32s  # (q,) bay at which each crane begins, increasing
    travel: float  # time a crane takes from one bay to the next, above 0
    spacing: int  # bays from one crane to the next at least, s + 1
    precedence: Int32s  # (m, 2) rows (i, j): i ends before j begins

    __repr__ = brief("name", "duration", "cranes", "travel", "spacing", "precedence")

    def __len__(self) -> int:
        return len(self.duration)

    @property
    def cranes(self) -> int:
        """How many cranes there are."""
        return len(self.ready)


@dataclass(frozen=True, slots=True)
class QcspSchedule:
    """Who does which task when, and where every crane is meanwhile."""

    crane: Int32s  # (n,) which crane does each task
    begin: Floats  # (n,)
    paths: tuple[Floats, ...]  # by crane: (k, 2) rows (time, position), k >= 1
    makespan: float  # end of the last task; 0 without tasks

    __repr__ = brief("makespan", "crane", "begin")


def is_qcsp(path: Path) -> bool:
    """Say whether the name is that of a bare team problem, in a collection or by itself."""
    known = path.name.lower().endswith((*QCSP_SUFFIXES, *COLLECTION_SUFFIXES))
    return known or _in_collection(path) is not None


@checked
def read_qcsp(path: Path | str) -> QcspProblem:
    """Read `X.qcsp`, or `COLLECTION.json.gz:NAME`, one of many in a mapping of names.

    All may be gzipped or not. A collection of one needs no name.

    Raises
    ------
    InputError
        With file and field, for what cannot be read or is no such problem.
    """
    source = Path(path)
    if (of := _in_collection(source)) is None:
        return _only_problem(Fields.of(_json(source), "", source), source)
    collection, name = of
    all_of_them = Fields.of(_json(collection), "", collection)
    if name not in all_of_them.values:
        many = len(all_of_them.values)
        raise InputError(f"no instance {name!r} among its {many}", path=collection)
    return _problem(all_of_them.table(name), name)


def _only_problem(fields: Fields, source: Path) -> QcspProblem:
    """Return the problem a file holds, by itself or as a collection's only one."""
    if not source.name.lower().endswith(COLLECTION_SUFFIXES) or "p" in fields.values:
        return _problem(fields, _bare_name(source))
    names = [name for name, one in fields.values.items() if isinstance(one, dict) and "p" in one]
    if not names:
        raise InputError("holds no team problem", path=source, advice="see docs/qcsp.md")
    if len(names) > 1:
        raise InputError(
            f"holds {len(names)} instances",
            path=source,
            advice=f"name one: {source.name}:{names[0]}",
        )
    return _problem(fields.table(names[0]), names[0])


def schedule_text(problem: QcspProblem, schedule: QcspSchedule) -> bytes:
    """Return a schedule as a file, tasks and cranes numbered from 1 (docs/qcsp.md)."""
    cranes = []
    for v, path in enumerate(schedule.paths):
        mine = np.flatnonzero(schedule.crane == v)
        mine = mine[np.argsort(schedule.begin[mine], kind="stable")]
        tasks = [
            {"task": int(j) + 1, "bay": int(problem.bay[j]), "begin": float(schedule.begin[j]),
             "end": float(schedule.begin[j] + problem.duration[j])}
            for j in mine
        ]  # fmt: skip
        cranes.append({"crane": v + 1, "tasks": tasks, "way": path.tolist()})
    whole = {
        "format": "decmcts-qcsp-schedule",
        "version": 1,
        "name": problem.name,
        "makespan": schedule.makespan,
        "cranes": cranes,
    }
    return (json.dumps(whole, indent=1) + "\n").encode()


def _bare_name(path: Path) -> str:
    """Return a file's name without what says its kind."""
    ends = (*QCSP_SUFFIXES, *COLLECTION_SUFFIXES)
    longest = max((len(end) for end in ends if path.name.lower().endswith(end)), default=0)
    return path.name[: len(path.name) - longest] if longest else path.stem


def _in_collection(path: Path) -> tuple[Path, str] | None:
    """Return file and name of `FILE:NAME`, None for any other path."""
    file, colon, name = path.name.rpartition(":")
    if not colon or not file.lower().endswith(COLLECTION_SUFFIXES):
        return None
    return path.with_name(file), name


def _json(source: Path) -> Any:
    """Return what a JSON file holds, unpacked."""
    try:
        return json.loads(unpacked(read_bytes(source), source), object_pairs_hook=once(source))
    except (ValueError, RecursionError) as error:
        what = str(error) if isinstance(error, json.JSONDecodeError) else "bytes that are no text"
        raise InputError(f"no JSON ({what})", path=source) from error


def _problem(fields: Fields, name: str) -> QcspProblem:
    fields.only(*_KEYS)
    duration, bay = _row(fields, "p"), _bays(fields, "l")
    ready, start = _row(fields, "r"), _bays(fields, "l0")
    _check_lengths(fields, "n", {"p": len(duration), "l": len(bay)}, most=MOST_TASKS)
    _check_lengths(fields, "q", {"r": len(ready), "l0": len(start)}, most=MOST_CRANES)
    if not len(ready):
        fields.fail("r", "no crane")
    if (duration <= 0.0).any():
        fields.fail("p", f"task {int(np.argmin(duration)) + 1} takes no time")
    travel = fields.number("t", most=MOST_TIME)
    if travel <= 0.0:
        fields.fail("t", f"travel of {travel:g} a bay, expected more than 0")
    spacing = fields.integer("s", least=0, below=MOST_BAYS) + 1
    _refuse_crowd(fields, ready, start, spacing)
    pairs = _pairs(fields, len(duration))
    return QcspProblem(
        fields.text("name", name), duration, bay, ready, start, travel, spacing, pairs
    )


def _row(fields: Fields, key: str) -> Floats:
    return numbers(fields.items(key), fields.at(key), fields.path, least=0.0, most=MOST_TIME)


def _bays(fields: Fields, key: str) -> Int32s:
    bays = fields.items(key)
    for k, bay in enumerate(bays):
        if type(bay) is not int or not 1 <= bay <= MOST_BAYS:
            fields.fail(f"{key}[{k}]", f"expected a bay in 1..{MOST_BAYS}, found {shown(bay)}")
    return np.array(bays, np.int32)


def _check_lengths(fields: Fields, count: str, sizes: dict[str, int], *, most: int) -> None:
    """Refuse two lists of unlike or undue length, or of another one than `count` says."""
    (key, size), (other, second) = sizes.items()
    if size != second:
        fields.fail(other, f"{second} values where {key} has {size}")
    if size > most:
        fields.fail(key, f"{size} values, at most {most} are taken")
    if count in fields.values and fields.values[count] != size:
        fields.fail(count, f"is {shown(fields.values[count])}, {key} has {size} values")


def _refuse_crowd(fields: Fields, ready: Floats, start: Int32s, spacing: int) -> None:
    """Refuse cranes out of order, and those too near that cannot yet move apart."""
    gaps = np.diff(start)
    if (gaps <= 0).any():
        k = int(np.argmin(gaps))
        fields.fail("l0", f"cranes {k + 1} and {k + 2} begin out of order or in one place")
    if (gaps < spacing).any() and ready.any():
        k = int(np.argmin(gaps))
        fields.fail(
            "l0",
            f"cranes {k + 1} and {k + 2} begin {gaps[k]} bays apart where {spacing} are needed",
            "cranes may begin too near each other only if all are ready at 0",
        )


def _pairs(fields: Fields, n: int) -> Int32s:
    """Return the precedence, counted from 0; raises InputError for a cycle."""
    given = points(fields.items("Phi"), (2,), fields.at("Phi"), fields.path)
    wrong = (given != given.round()) | (given < 1) | (given > n)
    if wrong.any():
        row = int(np.flatnonzero(wrong.any(axis=1))[0])
        fields.fail(f"Phi[{row}]", f"expected two tasks in 1..{n}")
    pairs = given.astype(np.int32) - 1
    before = TopologicalSorter[int]()
    for first, second in pairs.tolist():
        before.add(second, first)
    try:
        before.prepare()
    except CycleError as error:
        task = min(error.args[1]) + 1
        fail(fields.at("Phi"), f"a cycle of precedence before task {task}", fields.path)
    return pairs
