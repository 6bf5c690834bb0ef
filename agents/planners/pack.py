"""A problem on disk, for the agent processes of one launch.

`problem.npz` holds the arrays of contours and graph, `problem.json` the rest.
Exact: floats keep every bit, so each agent computes the digest again and finds
the same. Plain arrays and JSON only: reading a pack runs nothing.

An agent that was started by hand reads a print and a machine instead. Either way the agents
compare digests before they talk.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal
from zipfile import BadZipFile

import numpy as np

from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.rules import contacts_between, order_rules, with_contacts
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_dict import machine_from_dict, machine_to_dict
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh import is_mesh
from decmcts.print.contours import Contours
from decmcts.print.job import Barrier, PrintJob, ProcessSettings, Retraction
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import check_fits
from decmcts.team.engine.plans import StatedOrder

_ARRAYS = "problem.npz"
_REST = "problem.json"
_ACCELERATION = "acceleration"
_START = "start"


@dataclass(frozen=True, slots=True)
class Pack:
    """One print on one machine, with its dependency graph."""

    job: PrintJob
    machine: Machine
    graph: DependencyGraph
    parameters: Mapping[str, float] = field(default_factory=dict)  # of the search, that were set
    lags: Lags | None = None  # how long what is printed over must cool
    start: StatedOrder | None = None  # a joint order to begin with


def write_pack(pack: Pack, folder: Path) -> None:
    """Write a pack into an existing folder."""
    arrays = {
        f"{room}.{f.name}": getattr(owner, f.name)
        for room, owner in (
            ("contours", pack.job.contours), ("graph", pack.graph), (_START, pack.start),
        )
        if owner is not None
        for f in fields(owner)
        if getattr(owner, f.name) is not None
    }  # fmt: skip
    if pack.lags is not None:
        arrays |= {f"lags.{name}": array for name, array in pack.lags._asdict().items()}
    if pack.job.acceleration is not None:
        arrays[_ACCELERATION] = pack.job.acceleration
    np.savez(folder / _ARRAYS, allow_pickle=False, **arrays)
    rest = {
        "name": pack.job.name,
        "slicer": pack.job.slicer,
        "notes": list(pack.job.notes),
        "settings": asdict(pack.job.settings),
        "barriers": [asdict(barrier) for barrier in pack.job.barriers],
        "refills": list(pack.job.refills),
        "machine": machine_to_dict(pack.machine),
        "parameters": dict(pack.parameters),
    }
    (folder / _REST).write_text(json.dumps(rest))


def read_pack(folder: Path) -> Pack:
    """Read what `write_pack` wrote; InputError if the folder holds no pack or a broken one."""
    try:
        with (folder / _ARRAYS).open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        rest = json.loads((folder / _REST).read_text())
        of_tools = tuple((int(t), Retraction(**one)) for t, one in rest["settings"]["of_tools"])
        job = PrintJob(
            rest["name"],
            Contours(**_room(arrays, "contours")),
            ProcessSettings(**{**rest["settings"], "of_tools": of_tools}),
            tuple(Barrier(**barrier) for barrier in rest["barriers"]),
            rest["slicer"],
            tuple(rest["notes"]),
            acceleration=arrays.get(_ACCELERATION),
            refills=tuple(rest["refills"]),
        )
        graph = DependencyGraph(**_room(arrays, "graph"))
        lags = Lags(**_room(arrays, "lags")) if "lags.below" in arrays else None
        order = _room(arrays, _START)
        start = StatedOrder(**order) if order else None
        machine = machine_from_dict(rest["machine"])
        return Pack(job, machine, graph, rest["parameters"], lags, start)
    except (OSError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise InputError(f"no problem pack: {error}", path=folder) from error


def _room(arrays: dict[str, Any], room: str) -> dict[str, Any]:
    return {k.partition(".")[2]: v for k, v in arrays.items() if k.startswith(room + ".")}


def load_source(
    path: Path, machine: str, process_order: Literal["keep", "free"], *, quality: bool = True
) -> Pack:
    """Read G-code and build its graph; InputError if it or the machine cannot be used.

    With `quality` shells and what is anchored in them keep their order, but for
    the paper's machine, which knows of no beads.
    """
    if not path.exists():
        raise InputError("no such file", path=path)
    if is_mesh(path):
        raise InputError(
            "an agent takes no mesh", path=path,
            advice="slice it, and give all agents the same G-code",
        )  # fmt: skip
    chosen = load_machine(machine)
    job, _ = read_gcode(path)
    chosen = replace(chosen, limits=chosen.limits.under(job.limits))
    check_fits(job.contours, chosen)
    contacts = contacts_between(job, chosen)
    job = with_contacts(job, contacts)
    graph = order_rules(
        job, chosen, process_order=process_order, quality=quality and chosen.bead_width,
        contacts=contacts,
    )  # fmt: skip
    return Pack(job, chosen, graph)
