"""What the judge can find wrong, and the verdict it returns.

Only words and numbers live here; the checks are in the other modules of `sim`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from numpy.typing import NDArray

from decmcts.print.brief import brief


class FaultKind(Enum):
    """The rule that was broken."""

    HEAD_MATERIAL = "head touches material"
    HEAD_HEAD = "heads come too near"
    RAIL = "rail order or separation"
    PRECEDENCE = "precedence"
    PRIMING = "priming"
    OTHER_PRINT = "another print, or the same one moved"
    MISSING = "missing contour"
    DOUBLED = "doubled contour"
    FILE = "missing file"
    WRONG_PATH = "wrong path"
    NOT_PARKED = "not parked"
    OUT_OF_REACH = "out of reach"
    INELIGIBLE = "ineligible head"
    DEADLOCK = "deadlock"
    TIMES = "nominal times"
    COOLING = "printed over too soon"
    WELD = "weld"
    CONTOUR = "contour"
    EXTRUSION = "extrusion"
    ARC = "arc"
    FEED = "feed"
    STATE = "machine state"
    COMMAND = "command"
    E_TOTAL = "extrusion total"
    DIGEST = "digest"
    MACHINE = "machine"


SHOWN = 3  # faults told in one line


@dataclass(frozen=True, slots=True)
class Fault:
    """One broken rule, in one clear line."""

    kind: FaultKind
    text: str

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.text}"


@dataclass(frozen=True, slots=True)
class Gap:
    """The least distance of something from something, over all that may happen."""

    mm: float
    required_mm: float  # what the machine asks for
    heads: tuple[str, ...]  # names of those it is about
    at: tuple[str, ...]  # both sides in words: what a head does, and which bead is there
    at_least: bool = False  # it is no less and may be more: what is further off was not looked at


@dataclass(frozen=True, slots=True)
class Nearest:
    """How near it came at the least; None: not measured, or there is nothing to measure."""

    heads: Gap | None = None  # between the bodies of two heads
    beside: Gap | None = None  # of a head to beads that stand higher than what of it is beside them


@dataclass(frozen=True, slots=True)
class Verdict:
    """All faults found, and how much was checked to find them."""

    faults: tuple[Fault, ...]
    counts: dict[str, float] = field(default_factory=dict)  # what was checked, how often
    checked: tuple[str, ...] = ()  # which rules it was held to, one line each
    warnings: tuple[str, ...] = ()  # what the source does as well and is bad all the same
    nearest: Nearest = Nearest()

    __repr__ = brief("ok", "shown", "counts", "nearest")

    @property
    def ok(self) -> bool:
        """Whether no rule was broken."""
        return not self.faults

    @property
    def shown(self) -> str:
        """The first faults in one line."""
        return "; ".join(map(str, self.faults[:SHOWN]))

    def kinds(self) -> set[FaultKind]:
        """Return the kinds of the faults found."""
        return {fault.kind for fault in self.faults}


LIMIT = 25  # faults of one kind listed one by one; the rest are summed in one line


def listed(kind: FaultKind, lines: list[str], *, total: int | None = None) -> list[Fault]:
    """Return the first `LIMIT` lines as faults and one fault that counts the rest."""
    total = len(lines) if total is None else total
    faults = [Fault(kind, line) for line in lines[:LIMIT]]
    if total > LIMIT:
        faults.append(Fault(kind, f"and {total - LIMIT} more"))
    return faults


def listed_rows(
    kind: FaultKind, rows: Sequence[Any] | NDArray[Any], text_of: Callable[[Any], str]
) -> list[Fault]:
    """Return the faults at these rows likewise; words are found only for those that are listed."""
    return listed(kind, [text_of(row) for row in rows[:LIMIT]], total=len(rows))
