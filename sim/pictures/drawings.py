"""PNG pictures of plans: before and after, and what each head does over time (a Gantt chart).

Only drawing lives here; nothing is judged.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from decmcts.print.metrics import compared_order
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.pictures.activity import activity
from sim.pictures.canvas import TRAVEL, head_colour, save
from sim.pictures.round_beads import draw_from_above, draw_from_the_side, round_beads_of

SEGMENTS = 100_000  # of one head drawn in one view; with more, whole paths are left out


def action_segments(
    actions: HeadActions, *, printing: bool, most: int | None = None
) -> NDArray[np.float64]:
    """Return the printing or the other segments of a head, (m, 2, 3).

    With `most`, only every k-th path is taken, so that about `most` segments are left.
    """
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    wanted = (owner[1:] == owner[:-1]) & ((actions.kind[owner[1:]] == ActionKind.PRINT) == printing)
    if most is not None:
        step = max(1, -(-int(wanted.sum()) // most))
        number = np.cumsum((actions.kind == ActionKind.PRINT) == printing)
        wanted &= (number % step == 0)[owner[1:]]
    rows = np.nonzero(wanted)[0]
    return np.stack([actions.path[rows], actions.path[rows + 1]], axis=1)


def draw_plan(path: Path | str, before: PlanDocument, after: PlanDocument) -> None:
    """Draw two plans side by side, from above and from the side; travel in red."""
    extent, first = _extent([before, after]), compared_order(before.metrics)
    wide, deep, high = extent[1] - extent[0]
    views, size = _view_sizes(wide, deep, high)
    figure = Figure(figsize=size)
    axes = figure.subplots(2, 2, squeeze=False)
    for column, (name, document) in enumerate(((first, before), ("after", after))):
        axes[0, column].set_title(f"{name}\n{_caption(document)}", fontsize=10)
        for row, (i, j) in enumerate(((0, 1), (0, 2))):
            axes[row, column].set_position(views[row][column])
            _draw_view(axes[row, column], document, i, j, extent)
    axes[0, 0].set_ylabel("y, mm")
    axes[1, 0].set_ylabel("z, mm")
    figure.legend(handles=_legend(after), loc="lower center", ncols=6, frameon=False)
    save(figure, path)


def _view_sizes(
    wide: float, deep: float, high: float
) -> tuple[list[list[tuple[float, float, float, float]]], tuple[float, float]]:
    """Return where each view stands, in parts of the figure, and the figure's size in inches.

    All four views have one scale, so each view is exactly as large as what it shows.
    """
    scale = min(6.0 / wide, 7.0 / deep, 6.0 / high)  # inches a mm
    w, d, h = scale * wide, scale * deep, scale * high
    left, gap, bottom, middle, top = 0.7, max(0.7, 4.2 - w), 1.0, 0.45, 0.8
    size = (left + 2 * w + gap + 0.25, bottom + h + middle + d + top)
    columns = (left, left + w + gap)
    rows = ((bottom + h + middle, d), (bottom, h))
    views = [
        [(x / size[0], y / size[1], w / size[0], t / size[1]) for x in columns] for y, t in rows
    ]
    return views, size


def _caption(document: PlanDocument) -> str:
    """Return the figures of one plan in a few words."""
    travel = sum(
        float(
            np.linalg.norm(np.diff(action_segments(actions, printing=False), axis=1), axis=2).sum()
        )
        for actions in document.plan.heads
    )
    minutes = document.plan.makespan_s / 60
    text = f"{len(document.contours):,} contours, travel {travel:,.0f} mm, {minutes:,.1f} min"
    laid = max(len(document.contours.points) - len(document.contours), 1)
    share = max(1, -(-laid // (SEGMENTS * max(1, len(document.plan.heads)))))
    return text + (f"\none in {share} contours drawn" if share > 1 else "")


def _extent(documents: Sequence[PlanDocument]) -> NDArray[np.float64]:
    """Return the box all printing fits in, with a margin, (2, 3)."""
    points = np.concatenate([d.contours.points for d in documents])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float((high - low)[:2].max()) + 1.0
    low[2] = min(low[2], 0.0)
    return np.array([low - margin, high + margin])


def _draw_view(
    axis: Any, document: PlanDocument, i: int, j: int, extent: NDArray[np.float64]
) -> None:
    """Draw the projection on coordinates i and j."""
    all_actions = document.plan.heads
    for printing, width in ((True, 0.4), (False, 0.5)):
        for index, actions in enumerate(all_actions):
            segments = action_segments(actions, printing=printing, most=SEGMENTS)[:, :, [i, j]]
            colour = head_colour(index, len(all_actions)) if printing else TRAVEL
            alpha = 0.6 if printing else float(np.clip(2500 / max(len(segments), 1), 0.06, 0.6))
            axis.add_collection(
                LineCollection(list(segments), colors=colour, linewidths=width, alpha=alpha)
            )
            if printing:
                draw = draw_from_above if j == 1 else draw_from_the_side
                draw(axis, round_beads_of(actions, document.contours), colour)
    axis.set_xlim(extent[:, i])
    axis.set_ylim(extent[:, j])
    axis.set_aspect("equal", adjustable="box")
    axis.tick_params(labelsize=8, labelbottom=j == 2)
    if j == 2:
        axis.set_xlabel("x, mm")


def _legend(document: PlanDocument) -> list[Line2D]:
    all_actions = document.plan.heads
    handles = [
        Line2D(
            [], [], color=head_colour(k, len(all_actions)), lw=2, label=f"extrusion, {actions.head}"
        )
        for k, actions in enumerate(all_actions)
    ]
    handles.append(Line2D([], [], color=TRAVEL, lw=2, label="travel"))
    beads = [round_beads_of(actions, document.contours).is_dot for actions in all_actions]
    dots = np.concatenate([np.zeros(0, np.bool_), *beads])
    colour = head_colour(0, len(all_actions))
    for there, name, face in (
        (dots.any(), "dot", colour), ((~dots).any(), "vertical bead", "none"),
    ):  # fmt: skip
        if there:
            mark = Line2D([], [], marker="o", ls="", mec=colour, mfc=face, label=name)
            handles.append(mark)
    return handles


def draw_gantt(path: Path | str, document: PlanDocument) -> None:
    """Draw what each head does over time; white is waiting.

    A long plan is drawn in intervals, each filled by the shares of its time.
    """
    all_actions = document.plan.heads
    figure = Figure(figsize=(12, 1.6 + 0.7 * len(all_actions)))
    figure.set_layout_engine("constrained")
    axis = figure.subplots()
    for row, actions in enumerate(all_actions):
        edges, shares = activity(actions, document.plan.makespan_s)
        left, width = edges[:-1] / 60, np.diff(edges) / 60
        prints, travels = 0.8 * shares.T
        foot = np.full(len(left), row + 0.4)
        colour = head_colour(row, len(all_actions))
        axis.bar(left, -prints, width, foot, align="edge", color=colour, linewidth=0)
        axis.bar(left, -travels, width, foot - prints, align="edge", color=TRAVEL, linewidth=0)
    axis.set_yticks(range(len(all_actions)), [actions.head for actions in all_actions])
    axis.set_ylim(len(all_actions) - 0.4, -0.6)
    axis.set_xlim(0, max(document.plan.makespan_s / 60, 1e-9))
    axis.set_xlabel("minutes")
    handles = [
        Patch(color=head_colour(k, len(all_actions)), label=f"{actions.head} prints")
        for k, actions in enumerate(all_actions)
    ]
    handles += [Patch(color=TRAVEL, label="travels"), Patch(fc="white", ec="grey", label="waits")]
    figure.legend(handles=handles, loc="outside upper center", ncols=6, frameon=False)
    save(figure, path)
