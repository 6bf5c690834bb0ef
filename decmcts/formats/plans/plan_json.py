"""plan.json: a joint plan with all that is needed to check or draw it.

The schema is docs/plan-format.md; version 2 is written, of cut prints version 3;
version 1 is read too.
Numbers are written so that reading them back gives the same bits. Reading is
strict: whatever is malformed is refused with its place in the file. Whether a
plan is *safe* is judged in `sim`.
"""

from __future__ import annotations

import gc
import io
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, cast

import numpy as np

from decmcts.arrays import Int32s
from decmcts.errors import InputError
from decmcts.formats.files.bounds import (
    LARGEST_MM,
    LARGEST_SECONDS,
    LAST_TOOL,
    MOST_LAYERS,
    unpacked,
)
from decmcts.formats.files.fields import Fields, points, shown
from decmcts.formats.files.reading import once, one_line, read_bytes
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.machines.machine_dict import machine_from_dict, machine_to_dict
from decmcts.formats.plans.plan_rows import (
    acceleration_from_dicts,
    actions_from_dicts,
    actions_to_dicts,
    check_points,
    contours_from_dicts,
    contours_to_dicts,
)
from decmcts.print.machine import Fenced, Machine, Stands, line_of
from decmcts.print.metrics import Metrics
from decmcts.print.plan import JointPlan, OrderRules, PlanDocument

FORMAT = "decmcts-plan"
SUFFIXES = (".json", ".json.gz")
VERSION, CUT_VERSION = 2, 3
_READ = (1, 2, 3)
_KEYS = ("format", "version", "problem", "machine", "contours", "precedence", "heads", "metrics")
_COOLING = "min_layer_time_s"  # may be left out
_RULES = "rules"  # likewise
_PRINTED = "printed"  # likewise
_FENCED = "fenced"  # likewise
_PRINT_WITH = "print_with"  # likewise
_CUTS = ("none", "inside", "all")
_CHOICES = {"process_order": ("keep", "free"), "freedom": ("fixed", "reversible", "seam")}
_TOOL = re.compile(r"[0-9]{1,5}", re.ASCII)


def write_plan(document: PlanDocument, path: Path | str) -> None:
    """Write a plan, gzipped when the name ends in ``.gz``; all of it or nothing.

    Raises InputError when the file cannot be written, or a number of the plan is not finite.
    """
    text = io.BytesIO()
    try:
        _write(document, text)
    except ValueError as error:
        raise InputError(f"the plan cannot be written: {error}", path=path) from error
    save_text(text.getvalue(), path)


def _write(document: PlanDocument, file: BinaryIO) -> None:
    """Write one contour and one action a line: easy to search, and no copy as objects."""
    head = {
        "format": FORMAT,
        "version": VERSION if document.contours.of is None else CUT_VERSION,
        "problem": document.problem,
        "machine": machine_to_dict(document.machine),
    }
    if document.min_layer_time_s:
        head[_COOLING] = document.min_layer_time_s
    if document.rules is not None:
        rules = asdict(document.rules)
        if document.contours.of is None:
            del rules["cut"]  # versions without it are read without it
        if document.rules.weld_limit_s is None:
            del rules["weld_limit_s"]  # likewise
        head[_RULES] = rules
    if document.fenced is not None:
        whole, at = document.fenced.machine, document.fenced.at
        head[_FENCED] = {
            "machine": machine_to_dict(whole),
            "at": {name: _stated(stands) for name, stands in at.items()},
        }
    if document.print_with:
        head[_PRINT_WITH] = {str(due): has for due, has in document.print_with}
    file.write(_dump(head)[:-1] + b',\n"contours":[')
    rows = contours_to_dicts(document.contours, document.machine, document.acceleration)
    _write_lines(file, rows)
    if document.printed is not None:
        file.write(b'],\n"printed":[')
        _write_lines(file, contours_to_dicts(document.printed, document.machine))
    file.write(b'],\n"precedence":' + _dump(document.precedence.tolist()) + b',\n"heads":[')
    names = [head.head for head in document.plan.heads]
    for number, actions in enumerate(document.plan.heads):
        file.write(b"," if number else b"")
        file.write(b'\n{"name":' + _dump(actions.head) + b',"actions":[')
        _write_lines(file, actions_to_dicts(actions, names))
        file.write(b"]}")
    file.write(b'],\n"metrics":' + _dump(document.metrics) + b"}\n")


def _stated(stands: Stands) -> list[Any]:
    """Return where a head stands as the file has it: a point, or the points of a line."""
    line: list[list[float]] = line_of(stands).tolist()
    return line[0] if len(line) == 1 else line


def _write_lines(file: BinaryIO, rows: Iterator[dict[str, Any]]) -> None:
    separator = b"\n"
    for row in rows:
        file.write(separator + _dump(row))
        separator = b",\n"


def _dump(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False, default=_plain).encode()


def _plain(value: Any) -> Any:
    """Return numpy scalars and arrays of the metrics as plain values."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise ValueError(f"metrics hold a {type(value).__name__}, which JSON cannot")


def read_plan(path: Path | str) -> PlanDocument:
    """Read a plan, gzipped or not.

    Raises InputError naming the place, e.g. ``heads[1].actions[17].after[0]: ...``, for anything
    that is not of the format.
    """
    source = Path(path)
    given = Fields.of(_parse(source), "", source)
    if given.values.get("format") != FORMAT:
        given.fail("format", f"is no {FORMAT!r}", "give a plan.json written by this program")
    version = given.values.get("version")
    if type(version) is not int or version not in _READ:
        known = " or ".join(map(str, _READ))
        given.fail("version", f"{shown(version)} is not {known}")
    given.only(*_KEYS, _COOLING, _RULES, _PRINTED, _FENCED, _PRINT_WITH)
    machine = machine_from_dict(given.need("machine"), where="machine", path=source)
    tables = given.tables("contours")
    contours = contours_from_dicts(tables, machine)
    return PlanDocument(
        given.text("problem"),
        machine,
        contours,
        _precedence(given, len(contours)),
        _plan(given, contours_sizes=np.diff(contours.offsets).tolist(), version=version),
        cast(Metrics, dict(given.table("metrics").values)),  # as it says: none is relied on
        given.number(_COOLING, 0.0, least=0.0, most=LARGEST_SECONDS),
        _rules(given.table(_RULES)) if _RULES in given.values else None,
        acceleration_from_dicts(tables, contours),
        contours_from_dicts(given.tables(_PRINTED), machine) if _PRINTED in given.values else None,
        _fenced(given, machine),
        _print_with(given),
    )


def is_plan(path: Path) -> bool:
    """Tell whether a file is a plan, by its name."""
    return path.name.lower().endswith(SUFFIXES)


def _fenced(given: Fields, machine: Machine) -> Fenced | None:
    """Return the heads that stand in the way; None: the plan says none."""
    if _FENCED not in given.values:
        return None
    table = given.table(_FENCED)
    table.only("machine", "at")
    whole = machine_from_dict(table.need("machine"), where=table.at("machine"), path=given.path)
    places = table.table("at")
    living = {head.name for head in machine.heads}
    known = [head.name for head in whole.heads if head.name not in living]
    for name in places.values:
        if name not in known:
            places.fail(str(name), f"is none of the heads that print no more ({', '.join(known)})")
    return Fenced(whole, {str(name): _stands(places, str(name)) for name in places.values})


def _stands(places: Fields, name: str) -> Stands:
    match places.need(name):
        case [[*_], *_] as line:
            rows = points(line, (3,), places.at(name), places.path, most=LARGEST_MM)
            return tuple((x, y, z) for x, y, z in rows.tolist())
    return places.triple(name)


def _print_with(given: Fields) -> tuple[tuple[int, int], ...]:
    """Return the tools that print for others, as pairs of the other and the one that prints."""
    if _PRINT_WITH not in given.values:
        return ()
    table = given.table(_PRINT_WITH)
    for key in table.values:
        if not _TOOL.fullmatch(str(key)):
            table.fail(str(key), "is no tool", "tools are numbers, as in T0")
    pairs = ((int(key), table.integer(key, least=0, below=LAST_TOOL + 1)) for key in table.values)
    return tuple(sorted(pairs))


def _rules(table: Fields) -> OrderRules:
    """Return the rules a plan says it was made by; each has to be said."""
    table.only(*(field.name for field in fields(OrderRules)))
    for key, choices in _CHOICES.items():
        if table.text(key) not in choices:
            table.fail(key, f"{shown(table.need(key))} is none of {', '.join(choices)}")
    ahead = table.need("max_layers_ahead")
    if ahead is not None:
        ahead = table.integer("max_layers_ahead", least=0, below=MOST_LAYERS + 1)
    cut = table.text("cut") if "cut" in table.values else "none"
    if cut not in _CUTS:
        table.fail("cut", f"{shown(cut)} is none of {', '.join(_CUTS)}")
    limit = None
    if "weld_limit_s" in table.values:
        limit = table.number("weld_limit_s", least=0.0, most=LARGEST_SECONDS)
    return OrderRules(
        table.text("process_order"), table.flag("quality"), ahead, table.text("freedom"), cut, limit
    )


def _parse(path: Path) -> Any:
    def refuse(text: str) -> NoReturn:
        raise InputError(f"the number {text} is not finite", path=path)

    content = unpacked(read_bytes(path), path)
    with one_line(path, "plan"), _uncollected():
        return json.loads(content, parse_constant=refuse, object_pairs_hook=once(path))


@contextmanager
def _uncollected() -> Iterator[None]:
    """Keep the cycle collector from walking millions of new lists again and again."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _precedence(given: Fields, n: int) -> Int32s:
    rows = given.items("precedence")
    flat = [v for row in rows if type(row) is list and len(row) == 2 for v in row]
    if len(flat) != 2 * len(rows) or not set(map(type, flat)) <= {int}:
        bad = next(
            i for i, row in enumerate(rows)
            if type(row) is not list or list(map(type, row)) != [int, int]
        )  # fmt: skip
        given.fail(f"precedence[{bad}]", f"expected two contour ids, found {shown(rows[bad])}")
    wrong = next((i for i, v in enumerate(flat) if not 0 <= v < n), None)
    if wrong is not None:
        given.fail(f"precedence[{wrong // 2}]", f"no contour {shown(flat[wrong])}, there are {n}")
    pairs = np.array(flat, np.int32).reshape(-1, 2)
    backward = np.flatnonzero(pairs[:, 0] >= pairs[:, 1])
    if len(backward):
        a, b = pairs[backward[0]].tolist()
        given.fail(
            f"precedence[{backward[0]}]",
            f"contour {a} before itself" if a == b else f"contour {a} before contour {b}",
            "contours are numbered in the order of the source, which keeps every pair",
        )
    return pairs


def _plan(given: Fields, *, contours_sizes: list[int], version: int) -> JointPlan:
    tables = given.tables("heads")
    names = [table.text("name") for table in tables]
    known = [table.text("name") for table in given.table("machine").tables("heads")]
    for table, name in zip(tables, names, strict=True):
        table.only("name", "actions")
        if name not in known:
            table.fail("name", f"{shown(name)} is no head of the machine ({', '.join(known)})")
        if names.count(name) > 1:
            table.fail("name", f"{shown(name)} stands for more than one head of the plan")
    counts = [len(table.items("actions")) for table in tables]
    all_actions = tuple(
        actions_from_dicts(table, names, counts, contours_sizes, version=version)
        for table in tables
    )
    check_points(tables, all_actions)
    return JointPlan(all_actions)
