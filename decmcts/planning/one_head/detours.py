"""How far the travels of one head keep off outer walls: as far as the source's, or further.

Travels over outer walls leave strings and marks on them, so slicers can lead them through the
part. A plan's travels lead over no more of them than its source's do, where a way round is known;
the price of a way over walls is raised until that is so. Where the source goes round walls, or all
travels are to, the search takes travels over them to be longer too.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from decmcts.arrays import Floats
from decmcts.formats.gcode.controller.duration import FileTime
from decmcts.planning.options import AvoidWalls
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.detours import Detours, straight_over_walls_mm
from decmcts.print.toolpath import Toolpath, endpoints
from decmcts.print.walls import has_walls, outer_walls
from decmcts.print.walls_kernels import Walls
from decmcts.search.sequence.problem import OrderProblem, Pace

ALWAYS = 4.0  # mm of travel beyond its own that a mm over walls is worth, where all go round
PRICES = (1.0, ALWAYS, 16.0, 64.0)  # tried in turn
OVER = 1.0  # by so much a search takes a travel over walls to be longer: for a way round, or not
HABIT_SHARE = 0.5  # of what would lead over walls straight: a source below it goes round them


@dataclass(frozen=True, slots=True)
class WallRule:
    """How a print's travels keep off outer walls."""

    walls: Walls | None  # outer ones; None: travels go straight
    always: bool = False
    most_mm: float = np.inf  # of travel over outer walls, if there are ways round
    over: float = 0.0  # share by which a search takes a travel over walls to be longer
    found: list[Detours] = field(default_factory=list)  # ways for no price, found once

    @staticmethod
    def of(problem: PrintProblem, sliced: FileTime | None) -> WallRule:
        """Return what was asked for; `sliced` is the source's file, None if there is none."""
        asked, contours = problem.rules.avoid_walls, problem.job.contours
        if asked == AvoidWalls.NEVER or len(contours) < 2:
            return WallRule(None)
        walls = outer_walls(contours)
        if not has_walls(walls):
            return WallRule(None)
        over_mm = None if sliced is None else sliced.over_walls_mm
        most_mm = np.inf if over_mm is None else over_mm
        if asked == AvoidWalls.ALWAYS:
            return WallRule(walls, True, most_mm, OVER)
        straight = straight_over_walls_mm(walls, *_gaps(problem, Toolpath.as_sliced(len(contours))))
        goes_round = most_mm < HABIT_SHARE * straight
        return WallRule(walls, most_mm=most_mm, over=OVER if goes_round else 0.0)

    def priced(self, problem: OrderProblem) -> OrderProblem:
        """Return the problem with travels over walls priced as longer, where this rule does so."""
        if self.walls is None or self.over == 0.0:
            return problem
        if problem.pace is None:
            return replace(problem, pace=Pace.in_mm(self.walls, self.over))
        return replace(problem, pace=replace(problem.pace, over=self.over, walls=self.walls))

    def detours(self, problem: PrintProblem, toolpath: Toolpath) -> Detours | None:
        """Return the ways round outer walls for an order; None where its travels go straight."""
        if self.walls is None:
            return None
        gaps = _gaps(problem, toolpath)
        if not self.always and straight_over_walls_mm(self.walls, *gaps) <= self.most_mm:
            return None
        if not self.found:
            head = problem.machine.heads[0]
            reach = (*head.reach_min[:2], *head.reach_max[:2])
            ways = Detours.of(problem.job.contours, 0.0, self.walls)
            self.found.append(replace(ways, reach=reach))
        least_mm, ways = problem.job.settings.retract_min_travel_mm, self.found[0]
        for price in PRICES:
            if self.always and price < ALWAYS:
                continue
            short = least_mm if price <= ALWAYS else 0.0  # too short to be retracted, or to string
            ways = replace(ways, price=price, least_mm=short)
            if ways.over_walls_mm(*gaps) <= self.most_mm:
                break
        return ways


def _gaps(problem: PrintProblem, toolpath: Toolpath) -> tuple[Floats, Floats]:
    """Return where the travels of an order begin and end, (k, 3) each.

    Not those between epochs: what the source does there may move the head.
    """
    contours = problem.job.contours
    start, end = endpoints(contours, toolpath)
    within = np.diff(contours.epoch[toolpath.order]) == 0
    return np.ascontiguousarray(end[:-1][within]), np.ascontiguousarray(start[1:][within])
