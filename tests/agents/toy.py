"""A small real planning problem for the agents' tests: jobs of known length shared by heads.

Each head orders the jobs it wants; `resolve` gives a doubled job to the head that wants it
earlier and an orphan to the least loaded head. Makespan: the largest load. A plan that begins
with the symbol after the last job states a serial order. A host with a `quirk` resolves all
other plans to something of its own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from agents.messages.kinds import Distribution, Joint, MessageError, Plans, Proposal
from decmcts.errors import InputError


def load_balance(
    lengths: np.ndarray, plans: Plans, live: Sequence[int]
) -> tuple[dict[int, list[int]], float]:
    """Return who does what and the makespan, each job exactly once."""
    wants = {h: np.asarray(plans.get(h, ()), np.int64).tolist() for h in sorted(live)}
    done: dict[int, list[int]] = {h: [] for h in wants}
    taken: set[int] = set()
    for rank in range(max((len(w) for w in wants.values()), default=0)):
        for head, wanted in wants.items():
            job = wanted[rank] if rank < len(wanted) else -1
            if 0 <= job < len(lengths) and job not in taken:
                taken.add(job)
                done[head].append(job)
    for job in range(len(lengths)):
        if job not in taken:
            least = min(done, key=lambda h: (float(lengths[done[h]].sum()), h))
            done[least].append(job)
    return done, max(float(lengths[jobs].sum()) for jobs in done.values())


class ToyPlanner:
    """Random search for one head's share, given what the others seem to do."""

    def __init__(
        self,
        head: int,
        *,
        names: Sequence[str],
        jobs: int = 40,
        seed: int = 0,
        needed: int | None = None,
        quirk: str = "",
    ) -> None:
        self.head = head
        self.needed = needed  # a head without which the jobs cannot all be done
        self.quirk = quirk  # of the host's arithmetic
        self.offered = 0  # joint plans judged
        self.names = tuple(names)
        self.lengths = np.random.default_rng(jobs).uniform(1.0, 9.0, jobs)
        digest = hashlib.sha256(self.lengths.tobytes() + repr(self.names).encode())
        self.problem = digest.hexdigest()
        self.most_symbols = (len(self.names) + 10) * (jobs + 1)
        self._rng = np.random.default_rng([seed, head])
        self._others: dict[int, Distribution] = {}
        self._best: dict[tuple[int, ...], Proposal] = {}
        self._own: list[np.ndarray] = []

    def iterate(self, live: Sequence[int], spent: float) -> None:
        share = max(1, len(self.lengths) // len(live))
        order = self._rng.permutation(len(self.lengths)).astype(np.int32)
        mine = order[: share + int(self._rng.integers(-1, 2))]
        plans = {self.head: mine}
        for head, told in sorted(self._others.items()):
            pick = self._rng.choice(len(told.sequences), p=told.probabilities)
            plans[head] = told.sequences[pick]
        found = self.resolve(plans, live)
        if found.makespan_s < self.best(live).makespan_s:
            self._best[tuple(live)] = found
        self._own = [mine, *self._own][:10]

    def distribution(self) -> Distribution:
        q = np.full(len(self._own), 1.0 / len(self._own))
        return Distribution(tuple(self._own), q)

    def take(self, head: int, distribution: Distribution) -> None:
        self._check(distribution.sequences)
        self._others[head] = distribution

    def forget(self, head: int) -> None:
        self._others.pop(head, None)

    def best_joint(self, live: Sequence[int]) -> Joint:
        found = self.best(live)
        return Joint(tuple(live), found.plans, found.makespan_s)

    def offer(self, plans: Plans, live: Sequence[int]) -> None:
        self.offered += 1
        found = self.resolve(plans, live)
        if found.makespan_s < self.best(live).makespan_s:
            self._best[tuple(live)] = found

    def serial(self, live: Sequence[int]) -> Proposal:
        jobs = np.arange(len(self.lengths) + 1, dtype=np.int32)
        return replace(self.resolve({min(live): np.roll(jobs, 1)}, live), serial=True)

    def best(self, live: Sequence[int]) -> Proposal:
        key = tuple(live)
        if key not in self._best:
            self._best[key] = self.resolve({}, live)
        return self._best[key]

    def resolve(self, plans: Plans, live: Sequence[int]) -> Proposal:
        self._check(plans.values())
        if self.needed is not None and self.needed not in live:
            raise InputError(f"only {self.names[self.needed]} can do job 0")
        stated = self._serial_of(plans)
        if stated is not None:
            blob = np.array([*sorted(live), *stated], np.int32).tobytes()
            makespan = float(self.lengths.sum())
            return Proposal(tuple(live), plans, makespan, hashlib.sha256(blob).hexdigest()[:32])
        done, makespan = load_balance(self.lengths, plans, live)
        rows = {h: np.array(jobs, np.int32) for h, jobs in done.items()}
        blob = self.quirk.encode() + b"".join(
            np.array([h, len(r)], np.int32).tobytes() + r.tobytes() for h, r in rows.items()
        )
        return Proposal(tuple(live), rows, makespan, hashlib.sha256(blob).hexdigest()[:32])

    def _serial_of(self, plans: Plans) -> list[int] | None:
        for _, plan in sorted(plans.items()):
            if len(plan) and plan[0] == len(self.lengths):
                assert sorted(plan[1:].tolist()) == list(range(len(self.lengths)))
                return [int(job) for job in plan[1:]]
        return None

    def _check(self, sequences: Iterable[np.ndarray]) -> None:
        for sequence in sequences:
            if len(sequence) and not 0 <= sequence.min() <= sequence.max() <= len(self.lengths):
                raise MessageError("unknown job")
