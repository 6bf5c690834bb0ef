"""All that the report's page is told, as JSON and arrays; docs/report.md has its keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from decmcts.feasibility.clustering import cluster_contours
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.heads.head_dict import head_to_dict
from decmcts.print.machine import Machine
from decmcts.print.metrics import compared_order
from decmcts.print.plan import PlanDocument
from decmcts.version import __version__
from sim.arrays import Floats
from sim.pictures.report.anew import changes_by
from sim.pictures.report.blobs import Blobs
from sim.pictures.report.changes import flags_of
from sim.pictures.report.cuts import cuts_of_page
from sim.pictures.report.facts import CarriedOut, ReportDetails, facts_of
from sim.pictures.report.saving import saving_of
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
    blobs = Blobs()
    drawn = contours_of(after.contours, blobs)
    flags = flags_of(before, after)
    several = len(after.plan.heads) > 1
    waits = waits_of(after, details.graph)
    path = critical_path(after) if several else []
    labels = ("planned", "happened")
    if details.run is None:
        labels = (compared_order(before.metrics), "after")
    page = {
        "title": details.file or after.machine.name,
        "file": details.file or None,
        "made_with": f"decmcts {__version__}",
        "machine": _machine(after.machine),
        "roles": list(ROLES),
        "contours": {**drawn.contours, **_clusters(details.graph, blobs)},
        "thinned": drawn.thinned,
        "plans": [
            plan_of(document, drawn, each, label, blobs)
            for document, each, label in (
                (before, flags[0], labels[0]), (after, flags[1], labels[1]),
            )
        ],
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
        "cuts": cuts_of_page(after, blobs),
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


def _machine(machine: Machine) -> dict[str, Any]:
    return {
        "name": machine.name,
        "bed_min": list(machine.bed_min),
        "bed_max": list(machine.bed_max),
        "heads": [head_to_dict(head) for head in machine.heads],
    }


def _wait(wait: Wait) -> dict[str, Any]:
    row = asdict(wait)
    return {
        key: round(value, 3) if isinstance(value, float) else value for key, value in row.items()
    }


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
