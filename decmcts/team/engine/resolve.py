"""From the heads' plans to one joint order: the function all agents share.

Deterministic: the same problem, plans and live heads give the same joint order
bit for bit, and agents compare its digest. A plan that orders all contours, serial or
stated, holds for all heads, if these can carry it out. Where a plan changes the order heads
begin with, all changes of all heads together make one. Else the heads dispatch: each
takes contours by its own plan's policy and shifts. Conflicts between heads are ordered,
and heads at rest there step aside (`dispatch_kernels`, `aside_kernels`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s
from decmcts.errors import InputError
from decmcts.print.machine_fit import require_printable
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import nearest_first, split
from decmcts.team.engine.carry_out_kernels import OK, carry_out
from decmcts.team.engine.dispatch_kernels import Policy, dispatch, write_keys
from decmcts.team.engine.joint_kernels import Units
from decmcts.team.engine.order import refuse, sequences_of, units_of
from decmcts.team.engine.plans import (
    HUNDREDTHS,
    POLICIES,
    STEP,
    TUNED,
    Intent,
    StatedOrder,
    decode,
    encode,
)
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.space import build_space, fleet_of
from decmcts.team.engine.spaces_kernels import Fleet
from decmcts.team.engine.start import changed_order

FIRST = 100_000  # contours placed for an estimate by the first policies, about half a second's work
LEAST = 4  # policies tried for it at least, the first ones


@dataclass(frozen=True, slots=True)
class Resolved:
    """A joint order; `decmcts.team.schedule.joint_plan` makes the exact plan of it."""

    toolpaths: tuple[Toolpath, ...]  # one per head of the machine
    makespan_s: float  # estimate
    digest: str


def resolve(problem: TeamProblem, plans: Mapping[int, Int32s], live: Sequence[int]) -> Resolved:
    """Merge the plans of the live heads into one joint order.

    Parameters
    ----------
    plans : Mapping[int, Int32s]
        Plan of each head, see `decmcts.team.engine.plans`; plans of heads that are
        not live are ignored. A head without a plan, or with one that means
        nothing, follows policy 0.
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
    fleet, eligible = fleet_for(problem, team)
    require_printable(problem.job.contours, problem.machine, eligible, live=team)
    n = len(problem.job.contours)
    intents = {
        r: decode(np.asarray(plans[r], np.int32), problem.n_macros, n) for r in team if r in plans
    }
    serial = next((i.serial for i in intents.values() if i.serial is not None), None)
    if serial is not None and (order := as_allowed(problem, serial)):
        toolpaths = split(order, eligible, nearest_first(problem.space, team))
        return _resolved(units_of(problem.visits, fleet, problem.machine, toolpaths), heads)
    stated = next((i.stated for i in intents.values() if i.stated is not None), None)
    if stated is not None and (found := as_stated(problem, stated, team)):
        return found
    changes = {r: i.changes for r, i in intents.items() if i.changes is not None}
    if problem.start is not None and changes:
        rearranged = changed_order(problem.start, changes, problem.space.eligible, problem.graph)
        if found := as_stated(problem, rearranged, team):
            return found
    return _dispatched(problem, intents, fleet, eligible)


def first_policies_s(problem: TeamProblem, effort: int = 1) -> float:
    """Return the shortest makespan of the first policies, all heads by the same one, s.

    A quick estimate of what heads can reach; with more `effort` of so many times the policies.
    """
    heads = range(len(problem.machine.heads))
    count = min(effort * TUNED, max(LEAST, effort * FIRST // max(1, len(problem.macro))))
    plans = [encode(policy, problem.n_macros) for policy in range(count)]
    return min(resolve(problem, dict.fromkeys(heads, plan), heads).makespan_s for plan in plans)


def fleet_for(problem: TeamProblem, team: Sequence[int]) -> tuple[Fleet, Flags]:
    """Return the machine where only these heads move, and which of them may print what."""
    if len(team) == len(problem.machine.heads):
        return problem.fleet, problem.space.eligible
    key = tuple(team)
    if key not in problem.fleets:
        space = build_space(problem.job, problem.machine, team)
        problem.fleets[key] = fleet_of(problem.job, problem.machine, team), space.eligible
    return problem.fleets[key]


def _dispatched(
    problem: TeamProblem, intents: Mapping[int, Intent], fleet: Fleet, eligible: Flags
) -> Resolved:
    """Let the heads choose by their plans."""
    heads = range(len(problem.machine.heads))
    weights = POLICIES[[intents[r].policy if r in intents else 0 for r in heads]]
    keys = keys_of(problem, weights)
    for r, intent in intents.items():
        keys[r] += intent.shift[problem.macro] / HUNDREDTHS  # each macro-action later
    policy = policy_of(problem, weights, keys, eligible)
    units, verdict = dispatch(problem.visits, fleet, policy)
    refuse(verdict, problem.machine)
    return _resolved(units, len(heads))


def keys_of(problem: TeamProblem, weights: Floats) -> Floats:
    """Return when each head wants to print each contour, in progress of its part, (heads, n).

    `weights` (heads, 6) are rows of `POLICIES`, or like them.
    """
    everything = np.arange(len(problem.macro))
    keys = np.empty((len(weights), len(everything)))
    for r, row in enumerate(weights):
        write_keys(r, row, everything, problem.key_terms, keys)
    return keys


def policy_of(problem: TeamProblem, weights: Floats, keys: Floats, eligible: Flags) -> Policy:
    """Return the policy of all heads as the kernels take it.

    Parameters
    ----------
    weights : (heads, 6) rows of `POLICIES`, or like them
    keys : (heads, n) least first
    eligible : (n, heads)
    """
    return Policy(
        keys,
        problem.places(),
        eligible,
        np.ascontiguousarray(weights[:, : STEP + 1]),
        problem.column_offsets,
        problem.column,
        problem.graph.succ_offsets,
        problem.graph.succs,
    )


def as_allowed(problem: TeamProblem, order: Toolpath) -> Toolpath | None:
    """Return a serial order that reverses only what may be; None if it breaks the precedence."""
    if not _keeps_precedence(problem, order.order):
        return None
    return Toolpath.of(order.order, order.reversed & problem.visits.reversible[order.order])


def is_allowed(problem: TeamProblem, stated: StatedOrder, eligible: Flags) -> bool:
    """Whether a stated order keeps precedence, directions and who may print what."""
    if stated.head.max(initial=0) >= eligible.shape[1]:
        return False
    is_reversed = stated.reversed & ~problem.visits.reversible[stated.order]
    may = eligible[stated.order, stated.head]
    return bool(may.all() and not is_reversed.any()) and _keeps_precedence(problem, stated.order)


def _keeps_precedence(problem: TeamProblem, order: Int32s) -> bool:
    turn = np.empty(len(order), np.int64)
    turn[order] = np.arange(len(order))
    before, after = problem.graph.pairs().T
    return bool((turn[before] < turn[after]).all())


def as_stated(problem: TeamProblem, stated: StatedOrder, team: Sequence[int]) -> Resolved | None:
    """Let the heads do exactly this; None if these heads can not."""
    units = units_as_stated(problem, stated, team)
    return None if units is None else _resolved(units, len(problem.machine.heads))


def units_as_stated(problem: TeamProblem, stated: StatedOrder, team: Sequence[int]) -> Units | None:
    """Return all that the heads do in a stated order; None if these heads can not."""
    fleet, eligible = fleet_for(problem, team)
    if not is_allowed(problem, stated, eligible):
        return None
    sequences = sequences_of(stated.toolpaths(len(problem.machine.heads)))
    units, verdict = carry_out(sequences, problem.visits, fleet)
    return units if verdict == OK else None


def _resolved(units: Units, heads: int) -> Resolved:
    """Read toolpaths, makespan and digest off the units."""
    used = int(units.used[0])
    makespan = float(units.end[:used].max(initial=0.0))
    state = blake2b(digest_size=32, person=b"decmcts-joint-2")
    printing = np.flatnonzero(units.contour[:used] >= 0)
    placed = StatedOrder(
        units.contour[printing], units.reversed[printing], units.head[printing].astype(np.int64)
    )
    toolpaths = tuple(placed.toolpaths(heads))
    for r, path in enumerate(toolpaths):
        visits = 2 * path.order.astype(np.int64) + path.reversed
        symbols = np.concatenate([[-1, r], visits, np.asarray(path.turn)])
        state.update(np.ascontiguousarray(symbols, "<i8").tobytes())
    return Resolved(toolpaths, makespan, state.hexdigest())
