"""Cutting a print so that several heads can share its contours, where that ends it sooner."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import attrgetter

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.feasibility.graph import EdgeKind
from decmcts.feasibility.rules import contacts_between
from decmcts.formats.gcode.document import NO_ARC
from decmcts.formats.gcode.writing.parts import cut_document, has_stiff_arc
from decmcts.planning.compiling import TEAM, is_compiled
from decmcts.planning.events import Note, Report, Step
from decmcts.planning.options import STAGGER_MM, Cut, Freedom
from decmcts.planning.problem.print_problem import PrintProblem, order_graph
from decmcts.print.cut import CutLines, Grid, cut_job
from decmcts.print.kinematics import line_up
from decmcts.print.motion import level_travel, retraction_time, segment_times, travel_feed
from decmcts.print.walls_kernels import Walls
from decmcts.team.cutting.layout import (
    Cuttable,
    Hops,
    Layout,
    cuttable,
    deeper,
    depth_by_layer,
    layer_by_layer,
    layout_of,
    lines_of,
    may_be_cut,
    places_of,
)
from decmcts.team.cutting.sweep import Sweep, sweep_order, times_of, with_less_travel
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import first_policies_s
from decmcts.team.engine.space import relation_of

MOST_SWEPT = 150_000  # contours; of more, sweeps take minutes
MOST_PIECES = 250_000  # of a print that is cut; more take too much memory
ROUNDS = 4  # sweeps that are tried at most
SHORTENED = 0.9  # of a sweep's time: less travel saves no more
LATE = 0.1  # of a sweep's time that heads may wait for what is late: all of them for all of it
GAIN = 0.995  # of the time without cuts: cuts that gain less than the estimates' error are not made
# of the same, where no sweep but the first policies end first: pieces may seem to end so much
# later, as the search finds better orders of them
ESTIMATED = 1.005
EFFORT = 4  # times the policies: what few of them reach is no estimate of so small differences
# of what a cut is taken to cost, and by how much nearer heads come: layouts that are tried too
OTHERS = ((0.6, 0.0), (1.7, 0.0), (1.0, 0.8), (0.8, 0.4))
MOST_TRIED = 200_000  # pieces of all sweeps that are tried; more take too long
TRAVEL_MM = 3.0  # typical travel from piece to piece, to price a cut by


@dataclass(frozen=True, slots=True)
class Swept:
    """A print, cut or not, with an order in which its heads sweep it."""

    problem: PrintProblem
    team: TeamProblem  # the print as heads plan it
    spread: Cuttable
    layout: Layout
    sweep: Sweep
    layer_s: Floats  # (layers,) how long heads take for each
    makespan_s: float  # estimate

    @property
    def order(self) -> StatedOrder:
        """The order of the sweep."""
        return self.sweep.stated


_makespan = attrgetter("makespan_s")


def best_sweep(
    problem: PrintProblem, cut: Cut, report: Report, *, kept: Flags | None = None,
    stagger_mm: float = STAGGER_MM,
) -> Swept | None:  # fmt: skip
    """Return the sweep that ends first, with contours cut as far as `cut` allows, or whole.

    Those that are `kept`, (n,), stay whole. Cuts move by `stagger_mm` from layer to layer.
    None where heads cannot sweep: there is one head, or some contour no sweep can hold. Nor are
    prints of more than `MOST_SWEPT` contours swept.
    """
    if len(problem.machine.heads) < 2 or not len(problem.job.contours):
        return None
    if len(problem.job.contours) > MOST_SWEPT:
        report(Note(f"more than {MOST_SWEPT:,} contours: no sweep is tried, nothing cut"))
        return None
    first = "" if is_compiled(TEAM) else ", which the first time compiles for up to a minute"
    report(Step(f"sweeps in which heads share parts{first}"))
    job, contours = problem.job, problem.job.contours
    seconds = segment_times(contours, problem.machine.limits, job.acceleration)
    whole = _swept(problem, seconds, np.zeros(len(contours), np.bool_), Cut.NONE, stagger_mm)
    may = may_be_cut(contours, cut.value)
    if kept is not None:
        may &= ~kept
    if may.any():
        may &= ~_kept_whole(problem)
    pieces = _swept(problem, seconds, may, cut, stagger_mm) if may.any() else None
    return _better(problem, whole, pieces)


def _better(problem: PrintProblem, whole: Swept | None, pieces: Swept | None) -> Swept | None:
    """Return the sweep of pieces if heads end sooner with them, else that of whole contours.

    Both are given the better of their sweep and the first policies: where there are many parts,
    heads that choose freely among whole contours are often faster than any sweep.
    """
    if pieces is not None:
        pieces = _with_less_travel(pieces)
    if whole is not None and (pieces is None or SHORTENED * whole.makespan_s < pieces.makespan_s):
        whole = _with_less_travel(whole)
    if pieces is None or pieces.problem.whole is None:
        found = [each for each in (whole, pieces) if each is not None]
        return min(found, key=_makespan, default=None)
    if whole is None:
        team = build_team_problem(problem.job, problem.machine, problem.graph)
        uncut = first_policies_s(team, EFFORT)
    else:
        uncut = _reached(whole)
    end_s = _reached(pieces)
    worth = ESTIMATED if end_s < pieces.makespan_s else GAIN
    return pieces if end_s < worth * uncut else whole


def _reached(found: Swept) -> float:
    """Return when heads end by their sweep, or by the first policies where that is sooner, s."""
    return min(found.makespan_s, first_policies_s(found.team, EFFORT))


def _swept(
    problem: PrintProblem, seconds: Floats, may: Flags, cut: Cut, stagger_mm: float,
) -> Swept | None:  # fmt: skip
    """Return a sweep with those contours cut that `may` be; `seconds` are those of segments.

    Several layouts are tried, and of each layer the one is taken in which it took least.
    """
    contours, (axis, _) = problem.job.contours, line_up(problem.machine)
    pairs, hops = problem.graph.pairs(), _hops(problem)
    spread = cuttable(contours, seconds, pairs, may, axis, hops, stagger_mm)
    whole_s = np.add.reduceat(seconds, contours.offsets[:-1])
    tried = _tried_deeper(problem, cut, spread, whole_s)
    if not tried:
        return None
    if may.any():
        spread = min(tried, key=_makespan).spread
        for price, nearer_mm in OTHERS:
            if _enough(tried):
                break
            other = replace(spread, price=price * spread.price)
            tried += _try(problem, cut, spread, _layout(problem, other, nearer_mm))
    if len(tried) > 1:
        choice = np.argmin([each.layer_s for each in tried], axis=0)
        layout = layer_by_layer([each.layout for each in tried], choice)
        chosen = depth_by_layer(contours, [each.spread for each in tried], choice)
        tried += _try(problem, cut, chosen, layout)
    return min(tried, key=_makespan)


def _with_less_travel(swept: Swept) -> Swept:
    """Return the sweep with what a head prints in one go in an order of less travel."""
    less = with_less_travel(swept.team, swept.order, swept.sweep.run)
    times = times_of(swept.team, less)
    if times is None or times[1] >= swept.makespan_s:
        return swept
    return replace(swept, sweep=replace(swept.sweep, stated=less), makespan_s=times[1])


def _enough(tried: list[Swept]) -> bool:
    """Whether another sweep like the last would make more than `MOST_TRIED` pieces of all."""
    pieces = [len(each.team.job.contours) for each in tried]
    return sum(pieces) + pieces[-1] > MOST_TRIED


def _layout(problem: PrintProblem, spread: Cuttable, nearer_mm: float = 0.0) -> Layout:
    """Return the layout in which heads come so much nearer than they surely may."""
    machine, (axis, row) = problem.machine, line_up(problem.machine)
    pairs = pairwise(row)
    clear = max(float(relation_of(machine, r, s)[:, 2 * axis + 1].max()) for r, s in pairs)
    return layout_of(spread, axis=axis, heads=len(machine.heads), apart_mm=clear - nearer_mm)


def _tried_deeper(
    problem: PrintProblem, cut: Cut, spread: Cuttable, whole_s: Floats
) -> list[Swept]:
    """Return the sweeps tried first; `whole_s` is what each contour takes, (n,).

    Where much is printed later than its strip, as it touches what a later strip prints, it is cut
    still earlier in the sweep, and the sweep made anew.
    """
    tried, heads = list[Swept](), len(problem.machine.heads)
    for _ in range(ROUNDS):
        made = _try(problem, cut, spread, _layout(problem, spread))
        tried += made
        if not made or _enough(tried):
            break
        late = made[0].sweep.late & spread.may
        if whole_s[late].sum() * heads < LATE * min(each.makespan_s for each in tried):
            break
        before, spread = spread, deeper(spread, problem.job.contours, late)
        if np.array_equal(before.depth, spread.depth):
            break
    return tried


def _try(problem: PrintProblem, cut: Cut, spread: Cuttable, layout: Layout) -> list[Swept]:
    """Return the sweep of a layout; none if the heads cannot carry it out."""
    contours = problem.job.contours
    places = places_of(contours, layout, spread)
    lines = lines_of(contours, layout, spread, places)
    parted = _cut(problem, lines, spread.walls, cut) if len(lines.at) else problem
    if len(parted.job.contours) > MOST_PIECES:
        return []
    team = build_team_problem(parted.job, problem.machine, parted.graph)
    sweep = sweep_order(team, layout, places, spread)
    times = times_of(team, sweep.stated)
    return [] if times is None else [Swept(parted, team, spread, layout, sweep, *times)]


def _kept_whole(problem: PrintProblem) -> Flags:
    """Tell which contours are never cut, (n,).

    What primes, what touches the head, what begins with filament of its own, what has arcs that
    are no arcs once cut, and what runs one way and is not printed in one state: something may be
    set on it for the first time, which cannot be taken back for a piece that stands above.
    """
    graph, document, contours = problem.graph, problem.document, problem.job.contours
    kept = has_stiff_arc(document, contours) | (document.owed != 0.0)
    low = np.minimum.reduceat(document.point_state, contours.offsets[:-1])
    high = np.maximum.reduceat(document.point_state, contours.offsets[:-1])
    kept |= ~contours.reversible & (low != high)
    pairs, kinds = graph.pairs(), graph.kinds
    kept[pairs[kinds == EdgeKind.PRIMING, 0]] = True
    kept[pairs[kinds == EdgeKind.CONTACT].reshape(-1)] = True
    return np.asarray(kept)


def _hops(problem: PrintProblem) -> Hops:
    """Return what a travel from one piece to the next costs."""
    settings, limits = problem.job.settings, problem.machine.limits
    _, rate = level_travel(settings, limits)
    least = min(each.retract_min_travel_mm for each in settings.each())
    return Hops(least, rate, 2.0 * math.sqrt(TRAVEL_MM / rate) + retraction_time(settings, limits))


def _cut(problem: PrintProblem, lines: CutLines, walls: Walls, cut: Cut) -> PrintProblem:
    job, document, machine, rules = problem.job, problem.document, problem.machine, problem.rules
    longest = min(each.retract_min_travel_mm for each in job.settings.each())
    digits_xy, digits_e, _ = document.decimals
    pieces, row = cut_job(
        job, lines, walls=walls, hop_mm=0.999 * longest,
        hop_feed=travel_feed(job.settings, machine.limits),
        whole=document.point_arc != NO_ARC,  # chords of arcs are cut at their ends alone
        grid=Grid(10.0**digits_xy, 10.0**digits_e * (document.e_area or 1.0)),
    )  # fmt: skip
    text = cut_document(document, pieces.contours, row)
    contacts = contacts_between(pieces, machine, free_seams=rules.freedom == Freedom.SEAM)
    graph = order_graph(pieces, machine, rules, contacts)
    source = replace(problem.source, job=pieces, document=text)
    return replace(problem, source=source, job=pieces, graph=graph, cut=cut, whole=problem)
