"""The report of a plan: one self-contained HTML page that needs no network.

A 3-D view before and after with a slider over the print's progress and a
button that plays it, a Gantt chart, the convergence of the search, and a table
of what was gained. Long prints are thinned for the browser; the page says so.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import plotly.io
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs

from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.pictures import TRAVEL, head_colour

POINTS = 150_000  # of one plan in the 3-D view
FRAMES = 60  # positions of the progress slider
BARS = 4_000  # bars of one head in the Gantt chart

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 1.5rem auto; max-width: 1500px; color: #222;
  padding: 0 1rem; }
table { border-collapse: collapse; margin: 0.5rem 0 1.5rem; }
th, td { padding: 0.25rem 0.9rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child { text-align: left; }
.note { color: #666; }
h2 { margin: 1.6rem 0 0.2rem; font-size: 1.15rem; }
"""


def write_report(
    path: Path | str,
    *,
    before: PlanDocument,
    after: PlanDocument,
    history: Sequence[tuple[float, float]] = (),
    rows: Sequence[Sequence[Any]] | None = None,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : file to write
    before, after : the source's own order and the plan
    history : (seconds, mm) pairs of the search, drawn when there are any
    rows : of the table, (what, before, after, gained); made from the plans when absent
    """
    notes: list[str] = []
    scene = plot_scene(before, after, notes)
    sections = [("What was gained", _table(gained(before, after) if rows is None else rows))]
    sections.append(("Toolpath", _div(scene, 720)))
    sections.append(
        ("Heads over time", _div(plot_gantt(after, notes), 170 + 60 * len(after.plan.heads)))
    )
    if len(history):
        sections.append(("Search", _div(plot_convergence(history), 380)))
    name = html.escape(f"{after.machine.name}: {len(after.contours)} contours")
    body = "".join(f"<h2>{title}</h2>{content}" for title, content in sections)
    remarks = "".join(f"<p class=note>{html.escape(note)}</p>" for note in notes)
    page = (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{name}</title>"
        f"<style>{STYLE}</style><script>{get_plotlyjs()}</script>"
        f"<h1>{name}</h1>{body}{remarks}</html>"
    )
    Path(path).write_text(page, encoding="utf-8")


def _div(figure: go.Figure, height: int) -> str:
    figure.update_layout(height=height)
    return str(plotly.io.to_html(figure, include_plotlyjs=False, full_html=False, auto_play=False))


def _table(rows: Sequence[Sequence[Any]]) -> str:
    head = "<tr><th></th><th>before</th><th>after</th><th>change</th></tr>"
    cells = (
        "<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) + "</tr>"
        for row in rows
    )
    return f"<table>{head}{''.join(cells)}</table>"


def gained(before: PlanDocument, after: PlanDocument) -> list[tuple[str, str, str, str]]:
    """Return the rows of the table from the metrics both plans carry."""
    names = {
        "travel_mm": ("travel between contours (the paper's metric), mm", 0),
        "emitted_travel_mm": ("travel as emitted, lifts included, mm", 0),
        "print_time_s": ("print time, s", 0),
        "makespan_s": ("makespan, s", 0),
    }
    rows = []
    for key, (text, digits) in names.items():
        was, now = before.metrics.get(key), after.metrics.get(key)
        if isinstance(was, int | float) and isinstance(now, int | float):
            change = f"{100 * (now / was - 1):+.1f} %" if was else ""
            rows.append((text, f"{was:,.{digits}f}", f"{now:,.{digits}f}", change))
    rows.append(("contours", str(len(before.contours)), str(len(after.contours)), ""))
    chosen = [key for key in ("planner", "freedom", "seed") if key in after.metrics]
    rows += [(k, str(before.metrics.get(k, "")), str(after.metrics[k]), "") for k in chosen]
    return rows


def lane_polyline(lane: HeadActions, *, printing: bool, step: int) -> NDArray[np.float64]:
    """Return one kind of a head's paths with rows of NaN between them, (k, 4): x, y, z, time.

    Of every `step` points of a path one is kept, and always both ends.
    """
    owner = np.repeat(np.arange(len(lane)), np.diff(lane.path_offsets))
    within = np.arange(len(owner)) - lane.path_offsets[owner]
    size = np.diff(lane.path_offsets)[owner]
    kept = (within % step == 0) | (within == size - 1)
    kept &= (lane.kind[owner] == ActionKind.PRINT) == printing
    share = within / np.maximum(size - 1, 1)
    time = lane.begin_s[owner] + share * (lane.end_s - lane.begin_s)[owner]
    rows = np.column_stack([lane.path, time])[kept]
    owner = owner[kept]
    cuts = np.nonzero(np.diff(owner))[0] + 1
    gaps = np.full((len(cuts), 4), np.nan)
    gaps[:, 3] = rows[cuts, 3]
    return np.insert(rows, cuts, gaps, axis=0)


def plot_scene(before: PlanDocument, after: PlanDocument, notes: list[str]) -> go.Figure:
    """Return both plans in 3-D side by side, with a slider over the progress; adds to notes."""
    figure = go.Figure()
    curves: list[NDArray[np.float64]] = []
    for column, document in enumerate((before, after)):
        points = sum(len(lane.path) for lane in document.plan.heads)
        step = max(1, -(-points // POINTS))
        if step > 1:
            notes.append(
                f"{'before' if column == 0 else 'after'}: drawn with every {step}th point "
                f"of {points:,}; the files have them all."
            )
        for index, lane in enumerate(document.plan.heads):
            for printing in (True, False):
                rows = lane_polyline(lane, printing=printing, step=step)
                curves.append(rows)
                figure.add_trace(_curve(rows, lane, index, document, column, printing))
    _lay_out_scenes(figure)
    return figure


def _curve(
    rows: NDArray[np.float64],
    lane: HeadActions,
    index: int,
    document: PlanDocument,
    column: int,
    printing: bool,
) -> go.Scatter3d:
    heads = len(document.plan.heads)
    return go.Scatter3d(
        x=rows[:, 0].round(2),
        y=rows[:, 1].round(2),
        z=rows[:, 2].round(2),
        mode="lines",
        line={"color": head_colour(index, heads) if printing else TRAVEL, "width": 2},
        opacity=0.8 if printing else 1.0,
        name=f"{lane.head} prints" if printing else f"{lane.head} travels",
        legendgroup=f"{lane.head}{printing}",
        showlegend=column == 1,
        scene="scene" if column == 0 else "scene2",
        hoverinfo="skip",
    )


def _lay_out_scenes(figure: go.Figure) -> None:
    view = {
        "aspectmode": "data",
        "xaxis_title": "x, mm",
        "yaxis_title": "y, mm",
        "zaxis_title": "z, mm",
    }
    figure.update_layout(
        scene={**view, "domain": {"x": [0.0, 0.49]}},
        scene2={**view, "domain": {"x": [0.51, 1.0]}},
        margin={"l": 0, "r": 0, "t": 30, "b": 0},
        legend={"orientation": "h", "x": 0.5, "xanchor": "center", "y": 1.06},
        annotations=[
            {"text": text, "x": x, "y": 1.0, "xref": "paper", "yref": "paper", "showarrow": False}
            for text, x in (("before", 0.24), ("after", 0.76))
        ],
    )


def plot_gantt(document: PlanDocument, notes: list[str]) -> go.Figure:
    """Return what each head does over time; blank is waiting; adds to notes."""
    figure = go.Figure()
    lanes = document.plan.heads
    for index, lane in enumerate(lanes):
        for kind in (ActionKind.PRINT, ActionKind.TRAVEL):
            prints = lane.kind == ActionKind.PRINT
            rows = prints if kind == ActionKind.PRINT else ~prints & (lane.kind != ActionKind.WAIT)
            begin, end = merged_spans(lane.begin_s[rows], lane.end_s[rows], BARS)
            if len(begin) < rows.sum() and kind == ActionKind.PRINT:
                notes.append(f"Gantt chart, {lane.head}: neighbouring bars are drawn as one.")
            figure.add_trace(
                go.Bar(
                    x=end - begin,
                    base=begin,
                    y=[lane.head] * len(begin),
                    orientation="h",
                    marker={
                        "color": head_colour(index, len(lanes)) if kind == 0 else TRAVEL,
                        "line": {"width": 0},
                    },
                    name=f"{lane.head} {'prints' if kind == 0 else 'travels'}",
                    hovertemplate="from %{base:.1f} s, %{x:.1f} s long",
                )
            )
    figure.update_layout(
        barmode="overlay",
        xaxis_title="seconds",
        yaxis={"autorange": "reversed"},
        margin={"l": 60, "r": 10, "t": 30, "b": 45},
        legend={"orientation": "h", "y": 1.25},
    )
    return figure


def merged_spans(
    begin: NDArray[np.float64], end: NDArray[np.float64], most: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return at most `most` spans, joining those with the smallest gaps between them."""
    if len(begin) <= most:
        return begin, end
    gap = begin[1:] - end[:-1]
    cuts = np.sort(np.argsort(gap, kind="stable")[-(most - 1) :])
    return begin[np.concatenate([[0], cuts + 1])], end[np.concatenate([cuts, [len(end) - 1]])]


def plot_convergence(history: Sequence[tuple[float, float]]) -> go.Figure:
    """Return the best length over the time of the search."""
    points = np.array(history, np.float64).reshape(-1, 2)
    figure = go.Figure(go.Scatter(x=points[:, 0], y=points[:, 1], line={"shape": "hv"}))
    figure.update_layout(
        xaxis_title="seconds of search",
        yaxis_title="travel of the best order, mm",
        yaxis_rangemode="tozero",
        margin={"l": 60, "r": 10, "t": 20, "b": 45},
    )
    return figure
