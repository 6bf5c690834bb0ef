"""The planning problem a team of heads shares: contours, precedence, room and guidance.

Everything here is computed alike by every agent from the same input; the
digest says that they have the same input. No plan and no progress here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.bound import work_behind
from decmcts._kernels.units import Floor, Visits
from decmcts.errors import InputError
from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.team.macros import cut_macros, part_of, part_progress
from decmcts.team.order import floor_of, visits_of
from decmcts.team.pairing import Pairing, pair_work
from decmcts.team.space import Space, build_space, require_printable

EITHER = 2  # side of a contour that no head should prefer


@dataclass(frozen=True, slots=True)
class TeamProblem:
    """What agents plan; build it with `build_team_problem`."""

    job: PrintJob
    machine: Machine
    graph: DependencyGraph
    space: Space
    visits: Visits  # as sliced
    floor: Floor
    price: NDArray[np.float64]  # (n,) how scarce partners are, see decmcts.team.pairing
    place: NDArray[np.float64]  # (heads, n) where in a head's sweep along the rail, 0..1
    side: NDArray[np.int64]  # (n,) head that should print it; EITHER
    progress: NDArray[np.float64]  # (n,) share of its part's work before it
    urgency: NDArray[np.float64]  # (n,) 0: most work must come after it, 1: none
    part: NDArray[np.int64]  # (n,) connected footprint
    macro: NDArray[np.int32]  # (n,) macro-action of each contour, numbered by progress
    macro_part: NDArray[np.int64]  # (n_macros,)
    n_macros: int
    digest: str

    @property
    def head_names(self) -> tuple[str, ...]:
        """Names of the heads, in the machine's order."""
        return tuple(head.name for head in self.machine.heads)

    def sides_of(self, head: int) -> NDArray[np.int32]:
        """Return the macro-actions a head does by default, in order."""
        mine = (self.side == head) | ((self.side == EITHER) & self._half(head))
        return np.unique(self.macro[mine]).astype(np.int32)

    def _half(self, head: int) -> NDArray[np.bool_]:
        """Whose half of the machine each contour lies in."""
        heads = len(self.machine.heads)
        return np.asarray(np.minimum((self.place[0] * heads).astype(np.int64), heads - 1) == head)


def build_team_problem(job: PrintJob, machine: Machine, graph: DependencyGraph) -> TeamProblem:
    """Return the problem of printing `job` with all heads of `machine`.

    Raises
    ------
    InputError
        If no head may print some contour.
    """
    if graph.n != len(job.contours):
        raise InputError(f"the graph has {graph.n} contours, the print {len(job.contours)}")
    space = build_space(job.contours, machine)
    require_printable(job.contours, machine, space.eligible)
    visits = visits_of(job, machine, graph, space, ())
    pairing = _pairing(visits.seconds, space, len(machine.heads))
    side = _sides(pairing, space)
    part = part_of(job.contours)
    progress = part_progress(visits.seconds, part)
    macro = cut_macros(visits.seconds, part, progress, side)
    return TeamProblem(
        job,
        machine,
        graph,
        space,
        visits,
        floor_of(job, machine, space),
        pairing.price,
        _places(visits.seconds, space, pairing),
        side,
        progress,
        _urgency(visits.seconds, graph),
        part,
        macro,
        _first_of(macro, part),
        int(macro.max(initial=-1)) + 1,
        problem_digest(job.contours, graph, machine),
    )


def _first_of(macro: NDArray[np.int32], part: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the part of each macro-action, which lies within one part."""
    return part[np.unique(macro, return_index=True)[1]]


def _urgency(seconds: NDArray[np.float64], graph: DependencyGraph) -> NDArray[np.float64]:
    behind = work_behind(seconds, graph.succ_offsets, graph.succs)
    return np.asarray(1.0 - behind / max(float(behind.max(initial=0.0)), 1e-12))


def _pairing(seconds: NDArray[np.float64], space: Space, heads: int) -> Pairing:
    """Match two heads; others have no matching and go by availability alone."""
    if heads == 2:
        return pair_work(seconds, space)
    n = len(seconds)
    return Pairing(0.0, np.full(n, 0.5), np.full((heads, n), 1.0 / heads))


def _sides(pairing: Pairing, space: Space) -> NDArray[np.int64]:
    """Return the head that should print each contour, (n,); EITHER where that is open."""
    share = pairing.share + 1e-9
    part = share / share.sum(axis=0)
    side = np.where(part.max(axis=0) > 0.75, part.argmax(axis=0), EITHER)
    only = space.eligible.sum(axis=1) == 1
    side[only] = space.eligible[only].argmax(axis=1)
    return side.astype(np.int64)


def _places(seconds: NDArray[np.float64], space: Space, pairing: Pairing) -> NDArray[np.float64]:
    """Return where each contour comes in each head's sweep: in step means equal places.

    Sorted by the side towards the other head, i-th pairs with i-th: for work
    nested along a rail that is a largest matching.
    """
    heads, n = pairing.share.shape
    rail = np.isfinite(space.gaps[0, min(1, heads - 1)]) if heads > 1 else np.ones(4, np.bool_)
    axis = 0 if rail[:2].any() else 2
    places = np.full((heads, n), 0.5)
    for r in range(heads):
        towards = space.boxes[:, axis + (1 if r < heads - 1 else 0)]
        order = np.argsort(towards, kind="stable")
        work = (pairing.share[r] * seconds)[order]
        total = float(work.sum())
        if total > 0.0:
            places[r, order] = (np.cumsum(work) - work / 2) / total
    return places
