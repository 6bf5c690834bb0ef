"""What a plan says of itself in figures and words, as plan.json and `--json` have it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NotRequired, TypedDict


class TeamMetrics(TypedDict):
    """What became of a launch's agents."""

    agreed: bool
    failed: str | None  # why they came to no plan
    lost: Mapping[str, str]  # heads that the plan does without, each with the reason
    again: Mapping[str, str]  # heads whose agent died and was started again, each with how
    disturbed: Mapping[str, int]  # messages dropped that no agent says, by reason


class CutMetrics(TypedDict):
    """How contours were cut so that heads share them."""

    contours: int  # that were cut
    cuts: int
    outside: int  # cuts in what shows: outer walls and top surfaces
    roles: NotRequired[Mapping[str, int]]  # cuts by what they are in, the most first
    welds: NotRequired[int]  # cuts whose two ends are not printed in one go
    weld_median_s: NotRequired[float]  # time between the two ends of a weld
    weld_most_s: NotRequired[float]


class IdleMetrics(TypedDict):
    """Where heads of several stand idle before a bead, and what is done there."""

    waits: int
    waits_s: float
    pulled: int  # of them, with filament pulled back further than for a travel
    primed: int  # beads before which a head is primed, as it has laid nothing for long
    cooled: NotRequired[int]  # waits in which a hot end is at standby; of written files


class Metrics(TypedDict, total=False):
    """Figures for people, keyed as in plan.json (docs/plan-format.md); none is relied on.

    A plan holds those that apply to it. What was read from a file is as the file says it.
    """

    contours: int
    contours_per_head: Sequence[int]
    extrusionless_travel_mm: float  # from the end of each contour to the next one's start
    emitted_travel_mm: float  # as moved, lifts and detours included
    print_time_s: float  # of the plan; of a written file from its first bead to its last
    makespan_s: float
    busy_s_per_head: Sequence[float]
    printing_s_per_head: Sequence[float]
    travelling_s_per_head: Sequence[float]
    waits: int
    waits_s: float
    cross_head_waits: int
    tool_changes: int  # from contour to contour of a head; of prints with several tools

    planner: str
    objective: str
    freedom: str
    seam: str
    seed: int
    time_limit_s: float
    iterations: int
    as_sliced: bool  # order, directions and entries are the source's
    made_safe: bool  # the source's own order would hit the part; `before` is layer by layer
    kept_source: bool  # the new order would have been longer, crossed more walls or gained nothing
    kept_because: str  # and which of these, in words
    version: str

    walls_priced: float  # share by which the search took travels over walls to be longer
    travel_s: float  # as the search prices it
    bound_mm: float | None  # of one head: no order's travels cost less
    bound_s: float | None
    gap_percent: float | None
    bound_method: str
    bound_skipped: str  # why nothing was proven

    file_time_s: float  # of whole files, start and end G-code included
    retractions: int
    travel_over_walls_mm: float | None
    arcs: int  # G2 and G3 that print

    parameters: Mapping[str, float | str]  # of several heads
    agreed_digest: str
    live_heads: Sequence[int]
    one_head_s: float
    bound: Mapping[str, float]  # fields of `decmcts.team.bounds.makespan.Bound`
    agents: Sequence[Mapping[str, object]]
    decided: Sequence[Sequence[float]]  # rows of seconds and each head's entropy over its plans
    found_by: str | None  # the head that first knew the best joint plan
    team: TeamMetrics
    cut: CutMetrics  # of a cut print
    idle: IdleMetrics  # where heads stand idle


def compared_order(before: Metrics) -> str:
    """Return the words for the order that a plan is compared with."""
    return "layer by layer" if before.get("made_safe") else "before"
