"""What agents say to each other: frozen messages that validate on construction.

No bytes here (`agents.messages.codec`), no keys (`agents.messages.keys`), no reactions
(`agents.agreeing.protocol`). A value that breaks a limit raises `MessageError`; a
message that exists is well formed, so the protocol never checks fields again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np

from decmcts.arrays import Floats, Int32s

VERSION = 4  # of the messages and their meaning; another version is refused by name
SILENCE_TICKS = 150  # own ticks after which a peer that promised nothing else counts as stuck: 15 s
MAX_HEADS = 64
MAX_SEQUENCES = 256
MAX_SYMBOLS = 4_000_000
MAX_TEXT = 200
MAX_SILENCE_TICKS = 6000
DIGEST_LENGTHS = range(8, 129)
SHOWN = 12  # characters of a digest that are shown

Sequence32 = Int32s  # (k,) a plan of one head, see decmcts.team.engine.plans
Plans = Mapping[int, Sequence32]  # head index -> its plan


class MessageError(ValueError):
    """A field of a message is outside what the protocol allows."""


class Stage(IntEnum):
    """How far a head has gone with one digest; see the theory in `agents.agreeing.protocol`."""

    COMMITTED = 1  # I resolved this plan and it is the best I know
    AGREED = 2  # every live head committed to it
    RELEASED = 3  # every live head agreed and the others are fenced: final


@dataclass(frozen=True, slots=True)
class Presence:
    """The liveliness token of a head's incarnation is there (again), or has vanished.

    It vanishes when the process died or left, or its lease ran out.
    """

    head: int
    epoch: int
    alive: bool


@dataclass(frozen=True, slots=True)
class Hello:
    """I am here and hold this problem; nothing else is heard before it matches."""

    problem: str
    version: int
    name: str  # the head's name, for people
    wants_answer: bool

    def __post_init__(self) -> None:
        check_digest(self.problem)
        _require(0 <= self.version < 2**31, f"version {self.version}")
        _require(0 < len(self.name) <= MAX_TEXT, f"name of {len(self.name)} characters")


@dataclass(frozen=True, slots=True, eq=False)
class Distribution:
    """The sender's plan distribution: candidate sequences and their probabilities."""

    sequences: tuple[Sequence32, ...]
    probabilities: Floats  # (len(sequences),) sums to 1

    def __post_init__(self) -> None:
        n = len(self.sequences)
        _require(0 < n <= MAX_SEQUENCES, f"{n} sequences, allowed 1..{MAX_SEQUENCES}")
        for sequence in self.sequences:
            check_sequence(sequence)
        q = self.probabilities
        _require(q.shape == (n,), f"{q.shape} probabilities for {n} sequences")
        _require(bool(np.isfinite(q).all() and (q >= 0).all()), "a probability is not in [0, 1]")
        _require(abs(float(q.sum()) - 1.0) < 1e-3, f"probabilities sum to {float(q.sum())}")

    @property
    def entropy(self) -> float:
        """How undecided the sender is: 0 for one plan, 1 where all are alike."""
        q = self.probabilities[self.probabilities > 0.0]
        most = np.log(len(self.probabilities))
        return float(-(q * np.log(q)).sum() / most) if most > 0.0 else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """The best joint plan the sender knows for this live set."""

    live: tuple[int, ...]
    plans: Plans
    makespan_s: float
    digest: str  # of the plan resolved from `plans` for `live`
    serial: bool = False  # an explicit order, which each head checks instead of resolving

    def __post_init__(self) -> None:
        check_live(self.live)
        check_digest(self.digest)
        check_joint(self.plans, self.makespan_s)


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """The best joint plan the sender knows while it plans; binds nobody."""

    live: tuple[int, ...]
    plans: Plans
    makespan_s: float

    def __post_init__(self) -> None:
        check_live(self.live)
        check_joint(self.plans, self.makespan_s)


@dataclass(frozen=True, slots=True)
class Beat:
    """I am not stuck, and speak again within so many ticks; said by what plans, not by zenoh."""

    within: int

    def __post_init__(self) -> None:
        _require(0 < self.within <= MAX_SILENCE_TICKS, f"a beat within {self.within} ticks")


@dataclass(frozen=True, slots=True)
class Commit:
    """The sender's stage for one digest and one live set."""

    live: tuple[int, ...]
    digest: str
    stage: Stage
    term: int  # counts the sender's choices of a plan, over all its incarnations
    heard: tuple[int, ...]  # aligned with live: term of that head's commit to this plan; 0: none

    def __post_init__(self) -> None:
        check_live(self.live)
        check_digest(self.digest)
        _require(len(self.heard) == len(self.live), f"heard {len(self.heard)} of {len(self.live)}")
        _require(all(0 <= t < 2**63 for t in (self.term, *self.heard)), "a term outside 0..2^63")


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """Send me the proposal behind this digest; I miss it."""

    target: int
    live: tuple[int, ...]
    digest: str

    def __post_init__(self) -> None:
        check_head(self.target)
        check_live(self.live)
        check_digest(self.digest)


@dataclass(frozen=True, slots=True, eq=False)
class PlanReply:
    """The proposal a `PlanRequest` asked for."""

    target: int
    proposal: Proposal

    def __post_init__(self) -> None:
        check_head(self.target)


@dataclass(frozen=True, slots=True)
class Goodbye:
    """I leave and stay parked; `digest` is the plan I released, empty for none."""

    digest: str
    reason: str

    def __post_init__(self) -> None:
        if self.digest:
            check_digest(self.digest)
        _require(len(self.reason) <= MAX_TEXT, f"reason of {len(self.reason)} characters")


Message = (
    Hello | Distribution | Joint | Proposal | Commit | PlanRequest | PlanReply | Beat | Goodbye
)

DROPPABLE = (Distribution, Joint, Beat)
"""Soon out of date: only the latest waits to be sent, and nothing waits for it."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """A message as it travels: with who sent it and when, in the sender's own order."""

    head: int
    epoch: int  # incarnation of the sender; a restarted head has a larger one
    seq: int  # counts every message of that incarnation
    message: Message

    def __post_init__(self) -> None:
        check_head(self.head)
        _require(0 <= self.epoch < 2**63, f"epoch {self.epoch} outside 0..2^63")
        _require(0 <= self.seq < 2**63, f"seq {self.seq} outside 0..2^63")


def check_head(head: int) -> None:
    """Raise unless `head` is a head index."""
    _require(0 <= head < MAX_HEADS, f"head {head} outside 0..{MAX_HEADS - 1}")


def check_live(live: tuple[int, ...]) -> None:
    """Raise unless `live` is a non-empty ascending tuple of head indices."""
    _require(0 < len(live) <= MAX_HEADS, f"live set of {len(live)}")
    for head in live:
        check_head(head)
    _require(all(a < b for a, b in pairwise(live)), f"live set {live}")


def check_joint(plans: Plans, makespan_s: float) -> None:
    """Raise unless these are sequences of heads with a makespan in seconds."""
    _require(math.isfinite(makespan_s) and makespan_s >= 0, f"{makespan_s} s")
    _require(len(plans) <= MAX_HEADS, f"plans of {len(plans)} heads")
    for head, sequence in plans.items():
        check_head(head)
        check_sequence(sequence)


def check_digest(digest: str) -> None:
    """Raise unless `digest` is lower-case hexadecimal of a sane length."""
    _require(len(digest) in DIGEST_LENGTHS, f"digest of {len(digest)} characters")
    _require(set(digest) <= set("0123456789abcdef"), "digest is not hexadecimal")


def check_sequence(sequence: Sequence32) -> None:
    """Raise unless `sequence` is a flat int32 array of a sane length."""
    _require(sequence.dtype == np.int32 and sequence.ndim == 1, "a sequence is not flat int32")
    _require(len(sequence) <= MAX_SYMBOLS, f"sequence of {len(sequence)}")


def _require(holds: bool, what: str) -> None:
    if not holds:
        raise MessageError(what)


def apart(one: str, other: str) -> tuple[str, str]:
    """Return a part of each of two digests, with the place in it where they first differ.

    Examples
    --------
    >>> apart("ab" * 16, "cd" * 16)
    ('abababababab', 'cdcdcdcdcdcd')
    >>> apart("ab" * 10 + "01", "ab" * 10 + "02")
    ('…babababab01', '…babababab02')
    """
    pairs = zip(one, other, strict=False)
    first = next((at for at, (a, b) in enumerate(pairs) if a != b), min(len(one), len(other)))
    if first < SHOWN:
        return one[:SHOWN], other[:SHOWN]
    end = min(first + 2, max(len(one), len(other)))
    begin = end - SHOWN + 1
    return f"…{one[begin:end]}", f"…{other[begin:end]}"
