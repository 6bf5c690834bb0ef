"""All that the report's page is told, as JSON and arrays; docs/report.md has its keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Ints
from decmcts.feasibility.clustering import cluster_contours
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.heads.head_dict import head_to_dict
from decmcts.print.contours import Contours
from decmcts.print.cut import weld_ages
from decmcts.print.metrics import compared_order
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.team.schedule.metrics import path_lengths
from decmcts.version import __version__
from sim.content.over_walls import crossed_by
from sim.pictures.layer_travels import (
    both_ends,
    by_layer,
    in_no_place_of,
    layers_of,
    most_changed,
    travels_of,
)
from sim.pictures.report.anew import changes_by
from sim.pictures.report.blobs import STEP_S, Blobs
from sim.pictures.report.facts import CarriedOut, ReportDetails, facts_of
from sim.pictures.report.toolpaths import ROLES, contours_of, plan_of
from sim.pictures.report.waits import Wait, critical_path, sums_of, waits_of

History = Sequence[Sequence[float]] | Floats
MOST_CLUSTERED = 50_000  # contours; of more there are no clusters in the page
MOST_EDGES = 300_000  # of the graph; with more the page has none


def page_data(
    before: PlanDocument, after: PlanDocument, history: History, details: ReportDetails
) -> tuple[dict[str, Any], Blobs]:
    """Return the page's JSON, and the arrays it names.

    Parameters
    ----------
    before, after : the source's own order and the plan
    history : rows of seconds, ..., cost: the search's best so far
    details : what else is known
    """
    blobs, machine = Blobs(), after.machine
    contours, thinned, rows = contours_of(after.contours, blobs)
    several = len(after.plan.heads) > 1
    waits = waits_of(after, details.graph)
    path = critical_path(after) if several else []
    labels = ("planned", "happened")
    if details.run is None:
        labels = (compared_order(before.metrics), "after")
    plans = zip((before, after), flags_of(before, after), labels, strict=True)
    page = {
        "title": details.file or after.machine.name,
        "file": details.file or None,
        "made_with": f"decmcts {__version__}",
        "machine": {
            "name": machine.name, "bed_min": list(machine.bed_min),
            "bed_max": list(machine.bed_max), "heads": list(map(head_to_dict, machine.heads)),
        },
        "roles": list(ROLES),
        "contours": {**contours, **_clusters(details.graph, blobs)},
        "thinned": thinned,
        "plans": [plan_of(document, rows, flags, label, blobs) for document, flags, label in plans],
        "facts": facts_of(before, after, details),
        "waits": [_wait(wait) for wait in waits],
        "wait_sums": sums_of(waits),
        "critical": {
            "head": blobs.add(np.array([head for head, _ in path])),
            "action": blobs.add(np.array([action for _, action in path]), delta=True),
        },
        "history": _history(after, history),
        "team": _team(after),
        "saving": saving_of(before, after),
        "graph": _graph(details.graph, blobs),
        "cuts": _cuts(after, blobs),
        "after": _after(after if details.run is None else before, blobs) if several else None,
        "notes": list(details.notes),
        "run": None if details.run is None else _run(details.run, blobs),
    }  # fmt: skip
    return page, blobs


def _run(run: CarriedOut, blobs: Blobs) -> dict[str, Any]:
    failed = [dict(zip(("head", "time_s", "why"), one, strict=True)) for one in run.failed]
    return {
        "printed": run.printed, "beads": run.beads, "failed": failed, "contacts": run.contacts,
        "in_the_end": run.in_the_end, "on_print": list(run.on_print),
        "anew": changes_by(run.plans, blobs), "missing": list(run.missing),
    }  # fmt: skip


def _after(document: PlanDocument, blobs: Blobs) -> list[dict[str, Any]]:
    """Return of each head what it was planned to print, and which actions wait for other heads.

    Rows are `action`, and the `head` and action (`until`) it waits for; `bead` has the contour of
    each action, -1: none.
    """
    found = []
    for actions in document.plan.heads:
        action = np.repeat(np.arange(len(actions)), np.diff(actions.after_offsets))
        found.append(
            {
                "n": len(actions),
                "bead": blobs.add(actions.contour, delta=True),
                "action": blobs.add(action, delta=True),
                "head": blobs.add(actions.after_head),
                "until": blobs.add(actions.after_action, delta=True),
            }
        )
    return found


def _clusters(graph: DependencyGraph | None, blobs: Blobs) -> dict[str, Any]:
    """Return the cluster of each contour (Alg. 1 of Yoo et al. 2020), where there is a graph."""
    if graph is None or not 0 < graph.n <= MOST_CLUSTERED:
        return {}
    return {"cluster": blobs.add(cluster_contours(graph))}


def _wait(wait: Wait) -> dict[str, Any]:
    times = {name: round(getattr(wait, name), 3) for name in ("begin_s", "end_s", "lag_s")}
    return {**asdict(wait), **times}


def _history(after: PlanDocument, history: History) -> dict[str, Any]:
    rows = np.asarray(history, np.float64)
    bound = after.metrics.get("bound")
    proven = bound.get("bound_s") if isinstance(bound, dict) else None
    if len(after.plan.heads) == 1:
        proven = after.metrics.get("bound_s") or after.metrics.get("bound_mm")
    return {
        "minimised": minimised(after),
        "s": rows[:, 0].round(3).tolist() if len(rows) else [],
        "cost": rows[:, -1].round(3).tolist() if len(rows) else [],
        "bound": proven or None,
        "cooled": bool(after.min_layer_time_s),
    }


def minimised(document: PlanDocument) -> str:
    """Return what the search of a plan minimised, with its unit."""
    if len(document.plan.heads) > 1:
        return "time of the whole print, s"
    timed = document.metrics.get("objective") == "time"
    priced = (
        " (longer where it crosses outer walls)" if document.metrics.get("walls_priced") else ""
    )
    return f"time of travels{priced}, s" if timed else f"travel{priced}, mm"


def _team(after: PlanDocument) -> dict[str, Any] | None:
    """Return what agents did; times and entropies of rows as `rounds_s` and one list a head."""
    metrics = after.metrics
    agents = metrics.get("agents")
    if not agents:
        return None
    rows = np.asarray(metrics.get("decided") or np.zeros((0, 1)), np.float64)
    return {
        "rounds_s": rows[:, 0].tolist(),
        "entropy": rows[:, 1:].T.tolist(),
        "found_by": metrics.get("found_by"),
        "agents": list(agents),
        **metrics.get("team", {}),
    }


def _graph(graph: DependencyGraph | None, blobs: Blobs) -> dict[str, Any] | None:
    if graph is None or graph.n_edges > MOST_EDGES:
        return None
    owner = np.repeat(np.arange(graph.n), np.diff(graph.pred_offsets))
    return {
        "counts": blobs.add(np.diff(graph.pred_offsets)),
        "back": blobs.add(owner - graph.preds),  # how far before each contour
        "kinds": blobs.add(graph.kinds),
    }


def _cuts(after: PlanDocument, blobs: Blobs) -> dict[str, Any] | None:
    """Return the cuts of a plan, by contour and along it; None where nothing is cut.

    `before` and `after` are the pieces that meet at each cut, `age` the seconds between the
    printing of its two ends.
    """
    pieces = after.contours
    if pieces.of is None:
        return None
    age, cuts = weld_ages(pieces, after.plan)
    owner = np.repeat(np.arange(len(pieces)), np.diff(pieces.offsets))
    return {
        "of": blobs.add(pieces.of, delta=True),
        "before": blobs.add(owner[cuts.before], delta=True),
        "after": blobs.add(owner[cuts.after], delta=True),
        **blobs.places(pieces.points[cuts.before]),
        "age": blobs.add(age, step=STEP_S),
    }


EDGES_MM = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)  # and above


def saving_of(before: PlanDocument, after: PlanDocument) -> dict[str, Any]:
    """Return travel in mm before and after, by layer and by length; and where it changed most."""
    numbers = layers_of(before)[0]
    layers = int(numbers[-1]) + 1 if len(numbers) else 1
    edges = np.array([*EDGES_MM, np.inf])
    by_length: dict[str, Any] = {"edges_mm": list(EDGES_MM)}
    each = [by_layer(travels_of(document), len(numbers)) for document in (before, after)]
    of_layers: dict[str, Any] = {"layer": list(range(layers))}
    for name, document, made in (("before", before, each[0]), ("after", after, each[1])):
        mm = np.zeros(layers)
        mm[numbers] = made
        of_layers[name] = np.round(mm, 1).tolist()
        mm = np.concatenate(list(map(travel_lengths, document.plan.heads)))
        by_length[name] = np.histogram(mm, edges)[0].tolist()
        by_length[f"{name}_mm"] = np.round(np.histogram(mm, edges, weights=mm)[0], 1).tolist()
    most = int(numbers[most_changed(*each)]) if len(numbers) else 0
    return {"unit": "mm", "by_layer": of_layers, "by_length": by_length, "most_changed": most}


def travel_lengths(actions: HeadActions) -> Floats:
    """Return the length of each action of a head that does not print, mm."""
    return np.asarray(path_lengths(actions)[actions.kind != ActionKind.PRINT])


OTHER = np.uint8(1)  # a travel between places that the other plan has no travel between
OVER_WALL = np.uint8(2)  # a travel that crosses an outer wall
MOVED = np.uint8(4)  # a contour printed by another head, or much earlier or later in the order
CROSSED = np.uint8(8)  # an outer wall that a travel of this plan crosses
MUCH = 0.01  # of the order, by which a contour has moved

OfHeads = tuple[NDArray[np.uint8], ...]  # flags of the actions of each head


def flags_of(before: PlanDocument, after: PlanDocument) -> tuple[OfHeads, OfHeads]:
    """Return for each head of both plans the flags of its actions, (k,) each."""
    plans = [document.plan.heads for document in (before, after)]
    found = [[np.zeros(len(actions), np.uint8) for actions in plan] for plan in plans]
    (was, place_was), (now, place_now) = (_places(each) for each in (before, after))
    moved = (was != now) | (np.abs(place_was - place_now) > MUCH)
    ends = [[_travels(actions) for actions in plan] for plan in plans]
    for k, plan in enumerate(plans):
        others = np.concatenate([there for _, there in ends[1 - k]])
        over, walls = over_walls(before.contours, plan)
        of_contours = moved * MOVED
        of_contours[walls] |= CROSSED
        for flags, (rows, mine), crossing, actions in zip(
            found[k], ends[k], over, plan, strict=True
        ):
            flags[rows[in_no_place_of(mine, others)]] |= OTHER
            flags[crossing] |= OVER_WALL
            printing = actions.kind == ActionKind.PRINT
            flags[printing] |= of_contours[actions.contour[printing]]
    return tuple(found[0]), tuple(found[1])


def _travels(actions: HeadActions) -> tuple[Ints, Ints]:
    """Return the actions that travel, (k,), and where both ends of each are, (k, 2)."""
    rows = np.flatnonzero((actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK))
    first, last = actions.path_offsets[rows], actions.path_offsets[rows + 1] - 1
    return rows, both_ends(actions, first, last)


def _places(document: PlanDocument) -> tuple[Ints, Floats]:
    """Return the head that prints each contour, and its place in the order of all, 0 to 1."""
    n = len(document.contours)
    head, begin = np.zeros(n, np.int64), np.zeros(n)
    for index, actions in enumerate(document.plan.heads):
        printing = actions.kind == ActionKind.PRINT
        head[actions.contour[printing]] = index
        begin[actions.contour[printing]] = actions.begin_s[printing]
    place = np.empty(n)
    place[np.argsort(begin, kind="stable")] = np.arange(n) / max(n - 1, 1)
    return head, place


def over_walls(contours: Contours, heads: Sequence[HeadActions]) -> tuple[list[Ints], Ints]:
    """Return of each head the actions that cross outer walls without printing, and those walls.

    Walls of the layers of both ends of an action count: lifts are looked at from above.
    """
    legs = [_legs(actions) for actions in heads]
    head = np.repeat(np.arange(len(heads)), [len(action) for action, *_ in legs])
    action, *ends = (np.concatenate(column) for column in zip(*legs, strict=True))
    leg, wall = crossed_by(contours, *ends)
    return [action[leg[head[leg] == h]] for h in range(len(heads))], wall


def _legs(actions: HeadActions) -> tuple[Ints, Floats, Floats, Floats, Floats]:
    """Return straight parts of travels: action, both ends from above, heights of its ends."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    legs = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] != ActionKind.PRINT))
    flat, z, action = actions.path[:, :2], actions.path[:, 2], owner[legs]
    begins, ends = actions.path_offsets[action], actions.path_offsets[action + 1] - 1
    return action, flat[legs], flat[legs + 1], z[begins], z[ends]
