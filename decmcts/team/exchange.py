"""Changes of a plan: the moves of the search over a head's plans."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from decmcts.team.plans import POLICIES, decode, encode
from decmcts.team.policy_space import beside
from decmcts.team.problem import TeamProblem


def exchange(
    problem: TeamProblem,
    plan: NDArray[np.int32],
    rng: np.random.Generator,
    *,
    policies: int = len(POLICIES),
) -> NDArray[np.int32]:
    """Return a plan that differs by one random move; a serial plan becomes an ordinary one.

    A new policy is one of the first `policies`, one like the old one as a rule.
    """
    intent = decode(plan, problem.n_macros, len(problem.macro))
    macros, policy = intent.macros, intent.policy
    move = rng.random()
    if move < 0.1 or problem.n_macros == 0:
        policy = beside(policy, rng, policies)
    elif move < 0.6 and len(macros) > 1:
        macros = _shift_part(problem, macros, rng)
    elif move < 0.75 and len(macros) > 1:
        macros = _shift(macros, rng)
    elif move < 0.9 and len(macros) > 1:
        macros = _give_away(macros, rng)
    else:
        macros = _take_over(macros, problem.n_macros, rng)
    return encode(macros, policy, problem.n_macros)


def _run(n: int, rng: np.random.Generator) -> tuple[int, int]:
    """Return a random run [first, last) of n places, short ones more often."""
    length = min(n, 1 + int(rng.exponential(max(1.0, n / 12))))
    first = int(rng.integers(n - length + 1))
    return first, first + length


def _shift(macros: NDArray[np.int32], rng: np.random.Generator) -> NDArray[np.int32]:
    """Move a run to another place."""
    first, last = _run(len(macros), rng)
    rest = np.delete(macros, slice(first, last))
    near = first + round(float(rng.normal(0.0, max(1.0, len(macros) / 8))))
    at = int(np.clip(near, 0, len(rest)))
    return np.insert(rest, at, macros[first:last])


def _shift_part(
    problem: TeamProblem, macros: NDArray[np.int32], rng: np.random.Generator
) -> NDArray[np.int32]:
    """Do all of a few parts earlier or later, by any share of the plan."""
    parts = np.unique(problem.macro_part[macros])
    chosen = rng.choice(parts, size=min(len(parts), 1 + int(rng.random() < 0.3)))
    return _delay(problem, macros, chosen, rng.normal(0.0, 0.5, len(chosen)))


def _delay(
    problem: TeamProblem,
    macros: NDArray[np.int32],
    parts: NDArray[np.int64],
    shares: NDArray[np.float64],
) -> NDArray[np.int32]:
    """Do each of `parts` later by its share of the plan (earlier if negative)."""
    when = np.arange(len(macros), dtype=np.float64)
    for part, share in zip(parts, shares, strict=True):
        when[problem.macro_part[macros] == part] += share * len(macros)
    return macros[np.argsort(when, kind="stable")]


def exchange_jointly(
    problem: TeamProblem,
    plans: Mapping[int, NDArray[np.int32]],
    rng: np.random.Generator,
    *,
    policies: int = len(POLICIES),
) -> dict[int, NDArray[np.int32]]:
    """Return the plans of all heads after one move of one head, or one they make together."""
    move = rng.random()
    if move < 0.4 or problem.n_macros == 0:
        head = sorted(plans)[int(rng.integers(len(plans)))]
        return {**plans, head: exchange(problem, plans[head], rng, policies=policies)}
    intents = {r: decode(p, problem.n_macros, len(problem.macro)) for r, p in plans.items()}
    first = intents[min(intents)].policy
    policy = beside(first, rng, policies) if move < 0.5 else None
    parts = np.unique(problem.macro_part)
    chosen = rng.choice(parts, size=1 + int(rng.random() < 0.3))
    shares = rng.normal(0.0, 0.5, len(chosen)) if policy is None else np.zeros(len(chosen))
    return {
        r: encode(
            _delay(problem, intent.macros, chosen, shares),
            intent.policy if policy is None else policy,
            problem.n_macros,
        )
        for r, intent in intents.items()
    }


def _give_away(macros: NDArray[np.int32], rng: np.random.Generator) -> NDArray[np.int32]:
    """Drop a run; another head or whoever is free will do it."""
    first, last = _run(len(macros), rng)
    return np.delete(macros, slice(first, last))


def _take_over(
    macros: NDArray[np.int32], n_macros: int, rng: np.random.Generator
) -> NDArray[np.int32]:
    """Add a run of macro-actions that are not in the plan, at their usual place."""
    missing = np.setdiff1d(np.arange(n_macros, dtype=np.int32), macros)
    if not len(missing):
        return macros
    first, last = _run(len(missing), rng)
    for macro in missing[first:last]:
        macros = np.insert(macros, int(np.searchsorted(np.sort(macros), macro)), macro)
    return macros
