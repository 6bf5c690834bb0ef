"""The report of a plan: one self-contained HTML page that needs no network.

A table of what was gained, a 3-D view before and after with a slider over time
and a button that plays it, a chart of the heads over time, and the convergence
of the search. Long prints are thinned for the browser, and the page says so.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import plotly.io
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs

from decmcts.formats.files.atomic import write_whole
from decmcts.print.metrics import compared_order
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.search.bounds.certificate import INFORMS_PERCENT
from sim.pictures.activity import activity
from sim.pictures.canvas import TRAVEL, head_colour
from sim.pictures.report_script import SCRIPT
from sim.pictures.round_beads import with_outlines

History = Sequence[Sequence[float]] | NDArray[np.float64]
POINTS = 200_000  # of one plan in the 3-D view

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 1.5rem auto; max-width: 1500px; color: #222;
  padding: 0 1rem; }
table { border-collapse: collapse; margin: 0.5rem 0 1.5rem; }
th, td { padding: 0.25rem 0.9rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
.note { color: #666; margin: 0.2rem 0; }
h1 { font-size: 1.5rem; } h2 { margin: 1.6rem 0 0.2rem; font-size: 1.15rem; }
#scene { height: 680px; }
.bar { display: flex; gap: 0.8rem; align-items: center; }
.bar input { flex: 1; } .bar span { min-width: 11rem; font-variant-numeric: tabular-nums; }
button { font: inherit; min-width: 4.5rem; }
"""
CONTROLS = (
    '<div id="scene"></div><div class="bar"><button id="play">Play</button>'
    '<input id="time" type="range" min="0" max="1000" value="1000" aria-label="time">'
    '<span id="now"></span></div>'
)
COOLED = (
    "<p class=note>The curve is of the search whose order ends first. After it, contours that "
    "would be printed over a spot too soon are moved back, so the plan may travel more than the "
    "curve ends at.</p>"
)


def write_report(
    path: Path | str,
    *,
    before: PlanDocument,
    after: PlanDocument,
    history: History = (),
) -> None:
    """Write the page.

    Parameters
    ----------
    path : file to write
    before, after : the source's own order and the plan
    history : rows of seconds, ..., cost: the search's best so far, drawn when there are any
    """
    page, notes = scene_of(before, after)
    script = json.dumps(page).replace("<", "\\u003c")  # a name must not end the script element
    heads = len(after.plan.heads)
    sections = [
        ("What was gained", _table(gained(before, after), compared_order(before.metrics))),
        ("Toolpath", CONTROLS + "".join(f"<p class=note>{html.escape(n)}</p>" for n in notes)),
        ("Heads over time", _div(plot_gantt(after), 170 + 70 * heads)),
    ]
    if len(history):
        note = COOLED if after.min_layer_time_s else ""
        drawn = _div(plot_convergence(history, _minimised(after, heads), _bound_of(after)), 380)
        sections.append(("Search", note + drawn))
    name = html.escape(f"{len(after.contours):,} contours on machine {after.machine.name}")
    body = "".join(f"<h2>{title}</h2>{content}" for title, content in sections)
    text = (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{name}</title>"
        f"<style>{STYLE}</style><script>{get_plotlyjs()}</script>"
        f"<body><h1>{name}</h1>{body}"
        f"<script>const PAGE = {script};{SCRIPT}</script></body></html>"
    )
    write_whole(path, text.encode())


def _table(rows: Sequence[Sequence[str]], first: str) -> str:
    head = f"<tr><th></th><th>{first}</th><th>after</th><th>change</th></tr>"
    cells = (
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table>{head}{''.join(cells)}</table>"


def gained(before: PlanDocument, after: PlanDocument) -> list[tuple[str, str, str, str]]:
    """Return the rows of the table from the metrics both plans carry."""
    names = {
        "extrusionless_travel_mm": "travel between contours (the paper's metric), mm",
        "emitted_travel_mm": "travel as emitted, lifts included, mm",
        "print_time_s": "print time, s",
        "makespan_s": "makespan, s",
        "file_time_s": "print time of the whole file, s",
        "retractions": "retractions in the whole file",
        "travel_over_walls_mm": "travel over outer walls, mm",
    }
    if after.metrics.get("waits_s"):
        names["waits_s"] = "of which waits for cooling, s"
    rows = [("contours", f"{len(before.contours):,}", f"{len(after.contours):,}", "")]
    for key, text in names.items():
        was, now = before.metrics.get(key), after.metrics.get(key)
        if isinstance(was, int | float) and isinstance(now, int | float):
            change = f"{100 * (now / was - 1):+.1f} %" if was else ""
            rows.append((text, f"{was:,.0f}", f"{now:,.0f}", change))
    if isinstance(spent := after.metrics.get("travel_s"), int | float):
        rows.append(("time of travels, as the search prices it, s", "", f"{spent:,.1f}", ""))
    for unit, text in (("mm", "least travel"), ("s", "shortest travel time")):
        bound, gap = after.metrics.get(f"bound_{unit}"), after.metrics.get("gap_percent")
        if isinstance(bound, int | float) and gap is not None and gap <= INFORMS_PERCENT:
            above = f"at most {gap:.1f} % above"
            rows.append((f"{text} any order can have (proven), {unit}", "", f"{bound:,.1f}", above))
    rows += _of_a_team(after)
    chosen = [key for key in ("planner", "freedom", "seed") if key in after.metrics]
    rows += [(k, str(before.metrics.get(k, "")), str(after.metrics[k]), "") for k in chosen]
    return rows


def _of_a_team(after: PlanDocument) -> list[tuple[str, str, str, str]]:
    """Return the rows for a plan of several heads: against one head, and against the bound."""
    rows, makespan = [], float(after.metrics.get("makespan_s", 0.0))
    alone, bound = after.metrics.get("one_head_s"), _bound_of(after)
    if isinstance(alone, int | float) and makespan > 0.0:
        as_fast = f"{alone / makespan:.2f} times as fast"
        rows.append(("one head alone, s", "", f"{alone:,.0f}", as_fast))
    if bound:
        above = f"at most {100 * (makespan / bound - 1):.0f} % above"
        rows.append(("makespan bound (proven), s", "", f"{bound:,.0f}", above))
    return rows


def _bound_of(document: PlanDocument) -> float:
    """Return the proven bound on the makespan of several heads; 0: none is stated."""
    bound = document.metrics.get("bound")
    return float(bound.get("bound_s", 0.0)) if isinstance(bound, dict) else 0.0


def scene_of(
    before: PlanDocument, after: PlanDocument, *, most: int = POINTS
) -> tuple[dict[str, Any], list[str]]:
    """Return what the page's script draws, and what the reader should know about it.

    Of a plan with more than `most` points some are left out.
    """
    curves: list[dict[str, Any]] = []
    nozzles: list[dict[str, Any]] = []
    notes, compared = list[str](), compared_order(before.metrics)
    if before.metrics.get("made_safe"):
        notes.append("The source's own order would hit the part: its layers are compared with.")
    for scene, name, document in (("scene", compared, before), ("scene2", "after", after)):
        points = sum(len(actions.path) for actions in document.plan.heads)
        step = max(1, -(-points // most))
        if step > 1:
            notes.append(
                f"{name}: of {points:,} points one in {step} is drawn, and both ends of each path."
            )
        heads = len(document.plan.heads)
        for index, actions in enumerate(document.plan.heads):
            first, outlined = len(curves), with_outlines(actions, document.contours)
            for printing in (True, False):
                rows = action_polyline(outlined, printing=printing, step=step)
                colour = head_colour(index, heads) if printing else TRAVEL
                curves.append(_curve(rows, actions.head, colour, scene, printing))
            colour = head_colour(index, max(2, heads))
            nozzles.append(
                {
                    "scene": scene,
                    "name": actions.head,
                    "color": colour,
                    "curves": [first, first + 1],
                }
            )
    end = max(before.plan.makespan_s, after.plan.makespan_s)
    layout = scene_layout([before, after])
    return {"curves": curves, "nozzles": nozzles, "layout": layout, "end": end}, notes


def action_polyline(actions: HeadActions, *, printing: bool, step: int) -> NDArray[np.float64]:
    """Return one kind of a head's paths with a NaN point after each, (k, 4): x, y, z, seconds.

    Of every `step` points of a path one is kept, and always both ends.
    """
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    within = np.arange(len(owner)) - actions.path_offsets[owner]
    size = np.diff(actions.path_offsets)[owner]
    kept = (within % step == 0) | (within == size - 1)
    kept &= (actions.kind[owner] == ActionKind.PRINT) == printing
    share = within / np.maximum(size - 1, 1)
    seconds = actions.begin_s[owner] + share * (actions.end_s - actions.begin_s)[owner]
    rows = np.column_stack([actions.path, seconds])[kept]
    cuts = np.nonzero(np.diff(owner[kept]))[0] + 1
    gaps = np.full((len(cuts), 4), np.nan)
    gaps[:, 3] = rows[cuts - 1, 3]
    return np.insert(rows, cuts, gaps, axis=0)


def _curve(
    rows: NDArray[np.float64], head: str, colour: str, scene: str, printing: bool
) -> dict[str, Any]:
    columns = {
        key: base64.b64encode(rows[:, k].astype("<f4").tobytes()).decode()
        for k, key in enumerate("xyzt")
    }
    return {
        **columns,
        "scene": scene,
        "color": colour,
        "name": f"{head} prints" if printing else f"{head} travels",
        "legend": scene == "scene2",
        "opacity": 0.75 if printing else 0.9,
        "width": 2 if printing else 1,
    }


def scene_layout(documents: Sequence[PlanDocument]) -> dict[str, Any]:
    """Return plotly's layout: two views of the same box around the print."""
    first = compared_order(documents[0].metrics)
    points = np.concatenate([d.contours.points for d in documents])
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = 0.0
    margin = 0.04 * float((high - low).max()) + 1.0
    low[:2] -= margin
    high += margin
    size = (high - low) / float((high - low).max())
    axes = {
        f"{name}axis": {"title": {"text": f"{name}, mm"}, "range": [low[k], high[k]]}
        for k, name in enumerate("xyz")
    }
    view = {
        **axes,
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", size.tolist(), strict=True)),
        "camera": {"eye": {"x": -0.9, "y": -1.35, "z": 1.05}},
    }
    titles = [
        {"text": f"<b>{text}</b>", "x": x, "y": 1.0, "xref": "paper", "yref": "paper"}
        for text, x in ((first, 0.24), ("after", 0.76))
    ]
    return {
        "scene": {**view, "domain": {"x": [0.0, 0.495], "y": [0.0, 1.0]}},
        "scene2": {**view, "domain": {"x": [0.505, 1.0], "y": [0.0, 1.0]}},
        "margin": {"l": 0, "r": 0, "t": 50, "b": 0},
        "legend": {
            "orientation": "h",
            "x": 0.0,  # the buttons are on the right
            "y": 1.02,
            "yanchor": "bottom",
        },
        "annotations": [{**title, "showarrow": False} for title in titles],
        "uirevision": "keep",
    }


def _div(figure: go.Figure, height: int) -> str:
    figure.update_layout(height=height)
    return str(plotly.io.to_html(figure, include_plotlyjs=False, full_html=False))


def plot_gantt(document: PlanDocument) -> go.Figure:
    """Return what each head does over time; blank is waiting.

    A long plan is drawn in intervals, each filled by the shares of its time.
    """
    figure = go.Figure()
    all_actions = document.plan.heads
    for index, actions in enumerate(all_actions):
        edges, shares = activity(actions, document.plan.makespan_s)
        foot = np.full(len(shares), -index - 0.4)
        for column, (word, colour) in enumerate(
            (("prints", head_colour(index, len(all_actions))), ("travels", TRAVEL))
        ):
            height = 0.8 * shares[:, column]
            figure.add_bar(
                x=(edges[:-1] + edges[1:]) / 2,
                width=np.diff(edges),
                y=height,
                base=foot,
                marker={"color": colour, "line": {"width": 0}},
                name=f"{actions.head} {word}",
                customdata=100 * shares[:, column],
                hovertemplate="at %{x:.0f} s: %{customdata:.0f} % of the time",
            )
            foot = foot + height
    names = [actions.head for actions in all_actions]
    figure.update_layout(
        barmode="overlay",
        bargap=0,
        xaxis={"title": {"text": "seconds"}, "range": [0, document.plan.makespan_s]},
        yaxis={
            "tickvals": [-k for k in range(len(all_actions))],
            "ticktext": names,
            "zeroline": False,
        },
        margin={"l": 70, "r": 10, "t": 60, "b": 45},  # room for buttons above the legend
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom"},
    )
    return figure


def _minimised(document: PlanDocument, heads: int) -> str:
    """Return what the search of a plan minimised."""
    if heads > 1:
        return "makespan, s"
    timed = document.metrics.get("objective") == "time"
    priced = (
        " (longer where it crosses outer walls)" if document.metrics.get("walls_priced") else ""
    )
    return f"time of travels{priced}, s" if timed else f"travel{priced}, mm"


def plot_convergence(history: History, minimised: str, bound: float = 0.0) -> go.Figure:
    """Return the best cost over the time of the search, above its bound if there is one."""
    points = np.array(history, np.float64)
    figure = go.Figure(go.Scatter(x=points[:, 0], y=points[:, -1], line={"shape": "hv"}))
    figure.update_layout(
        xaxis_title="seconds of search",
        yaxis_title=f"best {minimised}",
        yaxis_rangemode="tozero",
        margin={"l": 70, "r": 10, "t": 40, "b": 45},
    )
    if bound:
        top = max(bound, float(points[:, -1].max()))
        room = 0.1 * (top - bound) + 1e-3 * top
        figure.update_yaxes(range=[bound - room, top + room])
        figure.add_hline(bound, line_dash="dash", annotation_text=f"proven bound {bound:,.0f} s")
    return figure
