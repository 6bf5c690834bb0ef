"""Prints and machines for comparisons of teams, of any number of heads.

`wide` is made by code: of each of the corpus' eight plates the 150 mm that hold most work,
whole parts only, side by side on a bed of 1200 mm. `wide:5000` is its first 5000 contours.
`NAME@all` is a print whose contours are cut for a sweep of two heads, as `launch --cut all` does;
`slab` is made by code too.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from common import corpus, print_path

from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.planning.events import unheard
from decmcts.planning.options import Cut, Rules
from decmcts.planning.problem.print_problem import (
    PrintProblem,
    load,
    parked_above,
    problem_of,
)
from decmcts.planning.team.cutting import best_sweep
from decmcts.print.contours import PER_CONTOUR, Contours, taken
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.team.engine.alone import lone_machine
from decmcts.team.engine.problem import TeamProblem, build_team_problem, part_of
from tests.makers.plate import plate

PLATES = ("mix_1", "mix_2", "mix_3", "mix_4", "mix_5", "mix_6", "same_4_far", "same_9")
WIDE_MM, SHARE_MM, MARGIN_MM = 1200.0, 150.0, 2.5
SLAB_MM, SLAB_MIDDLE = (220.0, 110.0, 6.0), (125.0, 105.0)
NO_QUALITY = Rules(quality=False)


def plate_path(name: str) -> Path:
    """Return the file of a plate of the corpus, or of an example or model of that name."""
    if name in PLATES:
        return corpus() / "models" / "plates" / "gcode" / f"{name}.gcode.gz"
    return print_path(name)


@lru_cache(maxsize=1)
def job_named(name: str) -> PrintJob:
    """Return a print by name, `wide` or `wide:CONTOURS`."""
    word, _, most = name.partition(":")
    job = wide_plate() if word == "wide" else read_gcode(plate_path(word))[0]
    return replace(job, contours=taken(job.contours, np.arange(int(most)))) if most else job


def machine_named(name: str, heads: int) -> Machine:
    """Return a machine of so many heads for a print; one head alone reaches everything."""
    wide = WIDE_MM if name.startswith("wide") else None
    pair = load_machine("dual-gantry")
    machine = pair if heads == 2 and wide is None else rail_machine(pair, max(2, heads), wide)
    return lone_machine(machine) if heads == 1 else machine


def team_problem(name: str, heads: int, *, whole: bool = False) -> TeamProblem:
    """Return the problem of a print for so many heads; quality rules are left out.

    With `whole` a head holds a contour's room to its end.
    """
    job, machine = job_named(name), machine_named(name, heads)
    if whole:
        machine = replace(machine, release="action")
    machine = replace(machine, limits=machine.limits.under(job.limits))
    machine = parked_above(machine, job.contours)
    return build_team_problem(job, machine, order_rules(job, machine))


def swept_problem(name: str, *, whole: bool = False) -> tuple[PrintProblem, TeamProblem]:
    """Return a print for two heads and the order they begin with, as `launch` makes both.

    NAME@CUT is cut; without @CUT nothing is. Quality rules are left out. With `whole` a head
    holds a contour's room to its end.
    """
    word, _, cut = name.partition("@")
    problem = slab() if word == "slab" else load(plate_path(word), "dual-gantry", NO_QUALITY)
    found = best_sweep(problem, Cut(cut or "none"), unheard)
    given, start = (problem, None) if found is None else (found.problem, found.order)
    if whole:
        given = replace(given, machine=replace(given.machine, release="action"))
    return given, build_team_problem(given.job, given.machine, given.graph, start=start)


def slab() -> PrintProblem:
    """Return one solid block across the bed."""
    return problem_of(plate(SLAB_MM, SLAB_MIDDLE, "dual-gantry"), NO_QUALITY, unheard)


@lru_cache(maxsize=1)
def wide_plate() -> PrintJob:
    """Return the print made of shares of all eight plates, in source order layer by layer."""
    jobs = [read_gcode(plate_path(name))[0] for name in PLATES]
    shares = [moved_to(share_of(job.contours), SHARE_MM * k) for k, job in enumerate(jobs)]
    together = joined(shares)
    order = np.lexsort((np.arange(len(together)), together.layer, together.epoch))
    contours = taken(together, order)
    numbered = replace(contours, line=np.arange(1, len(contours) + 1, dtype=np.int32))
    return PrintJob("wide", numbered, jobs[0].settings, limits=jobs[0].limits)


def share_of(contours: Contours) -> Contours:
    """Return the parts within the window of 150 mm that holds most extruded length."""
    part = part_of(contours)
    at = contours.offsets[:-1]
    low = np.minimum.reduceat(contours.points[:, 0], at)
    high = np.maximum.reduceat(contours.points[:, 0], at)
    filament = np.add.reduceat(contours.extrusion, at)
    count = int(part.max()) + 1
    left, right = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(left, part, low)
    np.maximum.at(right, part, high)
    work = np.bincount(part, weights=filament, minlength=count)
    within = [(left >= x) & (right <= x + SHARE_MM - 2 * MARGIN_MM) for x in left]
    best = max(within, key=lambda parts: float(work[parts].sum()))
    return taken(contours, np.flatnonzero(best[part]))


def moved_to(contours: Contours, x: float) -> Contours:
    """Return the contours with their low side just right of `x`."""
    by = np.array([x + MARGIN_MM - float(contours.points[:, 0].min()), 0.0, 0.0])
    return replace(contours, points=contours.points + by)


def joined(shares: list[Contours]) -> Contours:
    """Return the contours of several prints as one's."""
    offsets = np.cumsum([0, *np.concatenate([np.diff(c.offsets) for c in shares])])
    together = ("points", "extrusion", "feed", *PER_CONTOUR)
    return Contours(
        offsets=offsets.astype(np.int64),
        **{name: np.concatenate([getattr(c, name) for c in shares]) for name in together},
    )
