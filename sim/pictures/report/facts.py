"""What the report says first: verdict, time, travel, heads, in numbers and plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.cut import cut_metrics, weld_ages
from decmcts.print.figures import MAKERS, idle_line
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.search.bounds.certificate import INFORMS_PERCENT
from sim.faults import Verdict
from sim.pictures.report.anew import Anew
from sim.pictures.report.waits import aside_s
from sim.verdict_lines import sentences

SETTINGS = (
    ("planner", "planner"),
    ("objective", "search makes shorter"),
    ("freedom", "what it may change"),
    ("seam", "seams"),
    ("seed", "seed"),
    ("time_limit_s", "search time, s"),
    ("iterations", "steps of the search"),
)
WORDS = {
    "fixed": "the order alone",
    "reversible": "order and direction",
    "seam": "order, direction and where loops begin",
}


@dataclass(frozen=True, slots=True)
class CarriedOut:
    """How the carrying out of a plan ended."""

    printed: int  # beads that were, by this plan
    beads: int  # of the plan
    failed: Sequence[tuple[str, float, str]] = ()  # head, seconds and why
    contacts: int = 0  # of heads
    in_the_end: int | None = None  # beads printed with what was planned anew; None: nothing was
    on_print: Sequence[str] = ()  # contacts of heads with the print, in words
    plans: Sequence[Anew] = ()  # this one, and those that took its place
    missing: Sequence[str] = ()  # what these do not finish, or print with another tool, in words


@dataclass(frozen=True, slots=True)
class ReportDetails:
    """What a report states besides the two plans; all of it may be missing."""

    file: str = ""  # name of the source
    verdict: Verdict | None = None
    graph: DependencyGraph | None = None  # the planner's own, with the kinds of its edges
    notes: Sequence[str] = ()  # on the source
    warnings: Sequence[str] = ()
    run: CarriedOut | None = None  # `after` is what happened of the plan `before`


def facts_of(before: PlanDocument, after: PlanDocument, details: ReportDetails) -> dict[str, Any]:
    """Return the figures and words of the first screen, each once."""
    was, now = before.metrics, after.metrics
    stated = [] if details.verdict is None else sentences(details.verdict)
    return {
        "file": details.file,
        "machine": after.machine.name,
        "ok": details.verdict is None or details.verdict.ok,
        "judged": details.verdict is not None,
        "checked": [[one.about, one.text, one.where] for one in stated],
        "time": _time(before, after),
        "rows": [
            {
                "key": key,
                "label": label,
                "unit": "mm" if key.endswith("_mm") else "",
                "before": was.get(key),
                "after": now.get(key),
            }
            for key, label in MAKERS.items()
            if isinstance(was.get(key), int | float) and isinstance(now.get(key), int | float)
        ],
        "heads": [_head(actions, after.plan.makespan_s) for actions in after.plan.heads],
        "speed_up": _speed_up(after),
        "cut": _cut(after if details.run is None else before),
        "proof": _proof(now),
        "waits_s": float(now.get("waits_s") or 0.0),
        "idle": idle_line(now if details.run is None else was),
        "kept_source": now.get("kept_because"),
        "made_safe": bool(was.get("made_safe")),
        "warnings": [
            *details.warnings,
            *(() if details.verdict is None else details.verdict.warnings),
        ],
        "settings": [
            [label, WORDS.get(str(now.get(key)), now.get(key))]
            for key, label in SETTINGS
            if key in now
        ],
    }


def _time(before: PlanDocument, after: PlanDocument) -> dict[str, Any]:
    """Return the time before and after: of whole files where both are known, else of the plans."""
    was, now = before.metrics.get("file_time_s"), after.metrics.get("file_time_s")
    if isinstance(was, int | float) and isinstance(now, int | float):
        return {"before_s": float(was), "after_s": float(now), "of": "whole file"}
    return {
        "before_s": before.plan.makespan_s, "after_s": after.plan.makespan_s, "of": "plan",
    }  # fmt: skip


def _head(actions: HeadActions, end_s: float) -> dict[str, Any]:
    """Return what a head's time goes to; the four parts fill the time of the plan."""
    lasts = actions.end_s - actions.begin_s
    printing = float(lasts[actions.kind == ActionKind.PRINT].sum())
    moving = (actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK)
    aside = aside_s(actions)
    travelling = float(lasts[moving].sum()) - aside
    return {
        "name": actions.head,
        "contours": int((actions.kind == ActionKind.PRINT).sum()),
        "printing_s": printing,
        "travelling_s": travelling,
        "aside_s": aside,
        "waiting_s": max(0.0, end_s - printing - travelling - aside),
        "share": printing / end_s if end_s > 0.0 else 0.0,
    }


def _speed_up(after: PlanDocument) -> dict[str, Any] | None:
    alone, bound = after.metrics.get("one_head_s"), after.metrics.get("bound")
    if len(after.plan.heads) < 2 or not isinstance(alone, int | float):
        return None
    proven = float(bound.get("bound_s", 0.0)) if isinstance(bound, dict) else 0.0
    return {
        "one_head_s": float(alone),
        "makespan_s": after.plan.makespan_s,
        "bound_s": proven or None,
    }


def _proof(now: Metrics) -> dict[str, Any] | None:
    """Return the bound on the travels of one head, where it tells something."""
    gap = now.get("gap_percent")
    if not isinstance(gap, int | float) or not np.isfinite(gap) or gap > INFORMS_PERCENT:
        return None
    for unit, key in (("mm", "bound_mm"), ("s", "bound_s")):
        if isinstance(bound := now.get(key), int | float):
            value = now.get("travel_s" if unit == "s" else "extrusionless_travel_mm")
            return {"unit": unit, "value": value, "bound": float(bound), "gap_percent": gap}
    return None


def _cut(after: PlanDocument) -> dict[str, Any] | None:
    """Return the figures of a plan's cuts, with how many are in what; None: nothing is cut."""
    pieces = after.contours
    if pieces.of is None:
        return None
    age, _ = weld_ages(pieces, after.plan)
    named = [[role.replace("_", " "), n] for role, n in cut_metrics(pieces)["roles"].items()]
    return {**after.metrics.get("cut", {}), "roles": named, "in_one_go": int((age == 0.0).sum())}
