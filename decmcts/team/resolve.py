"""From the heads' plans to one joint order: the function all agents share.

Deterministic: the same problem, plans and live heads give the same joint
order bit for bit, and its digest is what agents compare. Duplicates go to one
owner, what nobody planned to whoever is free, conflicts are ordered and
deadlocks broken by stepping aside (`decmcts._kernels.dispatch`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.dispatch import Policy, dispatch
from decmcts._kernels.schedule import replay
from decmcts._kernels.units import OK, Units
from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.team.alone import split
from decmcts.team.order import queues_of
from decmcts.team.plans import BY_URGENCY, POLICIES, Intent, decode
from decmcts.team.problem import EITHER, TeamProblem
from decmcts.team.space import require_printable

OTHERS = 0.03  # progress by which a head puts its own work before that of others


@dataclass(frozen=True, slots=True)
class Resolved:
    """A joint order; `decmcts.team.schedule` makes the exact plan of it."""

    toolpaths: tuple[Toolpath, ...]  # one per head of the machine
    makespan_s: float  # estimate
    digest: str


def resolve(
    problem: TeamProblem, plans: Mapping[int, NDArray[np.int32]], live: Sequence[int]
) -> Resolved:
    """Merge the plans of the live heads into one joint order.

    Parameters
    ----------
    plans : Mapping[int, NDArray[np.int32]]
        Plan of each head, see `decmcts.team.plans`; plans of heads that are
        not live, and symbols that mean nothing, are ignored. A head without a
        plan does what is left.
    live : Sequence[int]
        Heads that print; the others stay parked.

    Raises
    ------
    InputError
        If no live head may print some contour.
    """
    team = sorted({int(r) for r in live})
    heads = len(problem.machine.heads)
    if not team or team[0] < 0 or team[-1] >= heads:
        raise InputError(f"live heads {list(live)}, expected some of 0..{heads - 1}")
    eligible = np.zeros_like(problem.space.eligible)
    eligible[:, team] = problem.space.eligible[:, team]
    require_printable(problem.job.contours, problem.machine, eligible)
    n = len(problem.job.contours)
    intents = {
        r: decode(np.asarray(plans[r], np.int32), problem.n_macros, n) for r in team if r in plans
    }
    serial = next((i.serial for i in intents.values() if i.serial is not None), None)
    if serial is None:
        found = _dispatched(problem, intents, eligible)
        if found is not None:
            return found
        serial = Toolpath.as_sliced(n)
    return _one_by_one(problem, serial, eligible, team)


def _dispatched(
    problem: TeamProblem, intents: Mapping[int, Intent], eligible: NDArray[np.bool_]
) -> Resolved | None:
    """Let the heads choose by their plans; None if they got stuck."""
    contours = problem.job.contours
    together = eligible.any(axis=0).sum() > 1
    policy = Policy(
        problem.price if together else np.zeros_like(problem.price),  # alone nothing is wasted
        problem.place,
        _keys(problem, intents, eligible),
        contours.reversible & ~contours.closed,
        POLICIES[[_policy_of(intents, r) for r in range(len(problem.machine.heads))]],
        problem.graph.succ_offsets,
        problem.graph.succs,
    )
    most = (len(contours) + 2) * len(problem.machine.heads) * 3
    units, pool, verdict = dispatch(problem.visits, problem.floor, policy, most)
    return _resolved(units, pool.backwards, len(problem.machine.heads)) if verdict == OK else None


def _policy_of(intents: Mapping[int, Intent], head: int) -> int:
    return intents[head].policy if head in intents else 0


def _keys(
    problem: TeamProblem, intents: Mapping[int, Intent], eligible: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return when each head wants to print each contour, in progress of its part, (heads, n).

    A macro-action moved forwards in a plan comes earlier by as much as those
    it overtook. What another head owns comes a little later.
    """
    heads, m = len(problem.machine.heads), problem.n_macros
    count = np.maximum(np.bincount(problem.macro, minlength=m), 1)
    natural = np.bincount(problem.macro, weights=problem.progress, minlength=m) / count
    shift, rank = np.zeros((heads, m)), np.full((heads, m), np.inf)
    for r, intent in intents.items():
        if len(intent.macros):
            shift[r, intent.macros] = np.sort(natural[intent.macros]) - natural[intent.macros]
            rank[r, intent.macros] = np.arange(len(intent.macros)) / len(intent.macros)
    owner = np.where(np.isfinite(rank).any(axis=0), rank.argmin(axis=0), EITHER)
    moved = shift.max(axis=0) + shift.min(axis=0)
    keys = np.empty((heads, len(problem.macro)))
    for r in range(heads):
        later = shift[r] if r in intents else moved
        later = np.where((owner != r) & np.isfinite(rank).any(axis=0), moved + OTHERS, later)
        base = POLICIES[_policy_of(intents, r), BY_URGENCY]
        keys[r] = problem.progress + base * (problem.urgency - problem.progress)
        keys[r] += later[problem.macro]
        keys[r, ~eligible[:, r]] = np.inf
    return keys


def _one_by_one(
    problem: TeamProblem, order: Toolpath, eligible: NDArray[np.bool_], team: Sequence[int]
) -> Resolved:
    """Print everything in one order, one head at a time where that matters."""
    toolpaths = split(order, eligible, team)
    backwards = np.zeros(len(order), np.bool_)
    backwards[order.order] = order.reversed
    first, last = problem.visits.first, problem.visits.last
    visits = problem.visits._replace(
        first=np.where(backwards[:, None], last, first),
        last=np.where(backwards[:, None], first, last),
    )
    most = (len(order) + 2) * len(toolpaths) * 3
    units, verdict = replay(queues_of(toolpaths), visits, problem.floor, most)
    if verdict != OK:
        raise InputError("the order contradicts the precedence")
    return _resolved(units, backwards, len(toolpaths))


def _resolved(units: Units, backwards: NDArray[np.bool_], heads: int) -> Resolved:
    """Read toolpaths, makespan and digest off the units."""
    used = int(units.used[0])
    contour, head = units.contour[:used], units.head[:used]
    makespan = float(units.end[:used].max(initial=0.0))
    state = blake2b(digest_size=32, person=b"decmcts-joint-1")
    toolpaths = []
    begun = np.flatnonzero(contour >= 0)
    begun = begun[np.argsort(units.begin[begun], kind="stable")]
    for r in range(heads):
        turn = np.flatnonzero(head[begun] == r)
        order = contour[begun[turn]].astype(np.int32)
        entry = np.zeros(len(order), np.int32)
        toolpaths.append(Toolpath(order, backwards[order], entry, turn))
        symbols = np.concatenate([[-1, r], 2 * order.astype(np.int64) + backwards[order], turn])
        state.update(np.ascontiguousarray(symbols, "<i8").tobytes())
    return Resolved(tuple(toolpaths), makespan, state.hexdigest())
