"""Reads a print and a machine for an agent that was started by hand.

A launcher hands its agents a pack instead (`agents.planners.pack`): one reading, one
dependency graph. Either way the agents compare digests before they talk.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from agents.planners.pack import Pack
from decmcts.errors import InputError
from decmcts.feasibility.rules import contacts_between, order_rules, with_contacts
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh import SliceOptions, is_mesh, slice_mesh
from decmcts.print.machine_fit import check_fits


def load_source(
    path: Path, machine: str, process_order: Literal["keep", "free"], *, quality: bool = True
) -> Pack:
    """Read G-code or slice a mesh, and build its dependency graph.

    With `quality` shells and what is anchored in them keep their order, but for
    the paper's machine, which knows of no beads.

    Raises
    ------
    InputError
        If the input or the machine cannot be used.
    """
    if not path.exists():
        raise InputError("no such file", path=path)
    chosen = load_machine(machine)
    if is_mesh(path):
        job, _ = slice_mesh(path, SliceOptions().for_machine(chosen))
    else:
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
