"""Charts of a plan: travel by layer, what heads do over time, and the words above them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from decmcts.arrays import Floats
from decmcts.formats.files.names import in_one_line
from decmcts.print.figures import change, clock_time, shown
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.pictures.canvas import head_colour

BEFORE, AFTER, MOVES = "#d62728", "#1f77b4", "#1a1a1a"
STEPS_S = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 28800, 86400)
UNITS = "; lengths in mm, times in h:min:s"
NAME = 14  # letters of a head's name
EXACT = 400  # actions drawn one by one; with more, shares of equal intervals are drawn
INTERVALS = 800
TICKS = 12  # of time, at the most


def title_lines(name: str, before: PlanDocument, after: PlanDocument) -> tuple[str, str]:
    """Return the title of a picture, and the figures under it."""
    was, now = before.metrics, after.metrics
    on = f"on {after.machine.name}"
    heads = len(after.plan.heads)
    title = f"{in_one_line(name)} {on}" if name else f"{len(after.contours):,} contours {on}"
    whole = "file_time_s" in was and "file_time_s" in now and heads == 1
    figures = [
        "no better order was found, the source is kept" if now.get("kept_source") else "",
        _change("print time of the whole file" if whole else "print time",
                was, now, "file_time_s" if whole else "makespan_s"),
        _change("travel", was, now, "emitted_travel_mm"),
    ]  # fmt: skip
    if heads > 1:
        title += f", {heads} heads"
    return title, "; ".join(part for part in figures if part) + UNITS


def _change(what: str, was: Metrics, now: Metrics, key: str) -> str:
    """Return one figure before and after, in words, once if equal; '' where one is not known."""
    a, b = was.get(key), now.get(key)
    if not isinstance(a, int | float) or not isinstance(b, int | float):
        return ""
    if a == b:
        return f"{what} {shown(key, a)}"
    share = f" ({change(a, b)})" if a else ""
    return f"{what} {shown(key, a)} → {shown(key, b)}{share}"


def draw_layers(axis: Any, lengths: tuple[Floats, ...], row: int, first: str) -> None:
    """Draw the travel that leads to each layer, before and after; mark the layer drawn above."""
    n = len(lengths[0])
    edges = np.arange(n + 1) + 0.5
    axis.stairs(lengths[0], edges, color=BEFORE, lw=1.0, label=f"{first} (line)")
    axis.stairs(lengths[1], edges, color=AFTER, fill=True, alpha=0.75, lw=0, label="after (filled)")
    axis.axvline(row + 1, color="black", lw=1.0, ls=":", label="layer drawn above")
    axis.set_xlim(0.5, n + 0.5)
    axis.set_ylim(0.0, 1.08 * max(float(max(part.max() for part in lengths)), 1e-9))
    axis.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=14, min_n_ticks=1))
    axis.yaxis.set_major_locator(MaxNLocator(nbins=4))
    axis.set_xlabel("layer")
    axis.set_ylabel("travel, mm")
    axis.set_title("travel to each layer")
    axis.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)


def draw_times(axis: Any, document: PlanDocument) -> None:
    """Draw what each head does over time; a long plan as shares of short intervals."""
    all_actions, end_s = document.plan.heads, max(document.plan.makespan_s, 1e-9)
    for row, actions in enumerate(all_actions):
        edges, shares = activity(actions, end_s)
        prints, travels = 0.8 * shares.T
        foot, colour = row + 0.4, head_colour(row, len(all_actions))
        axis.fill_between([0.0, end_s], row - 0.4, foot, facecolor="white", edgecolor="#9a9a9a",
                          hatch="////", linewidth=0.0, zorder=1)  # fmt: skip
        axis.stairs(foot - prints, edges, baseline=np.full(len(prints), foot), fill=True,
                    color=colour, lw=0, zorder=2)  # fmt: skip
        axis.stairs(foot - prints - travels, edges, baseline=foot - prints, fill=True,
                    color=MOVES, lw=0, zorder=2)  # fmt: skip
    axis.set_yticks(range(len(all_actions)), [_row_label(a, end_s) for a in all_actions])
    axis.set_ylim(len(all_actions) - 0.45, -0.55)
    axis.set_xlim(0, end_s)
    step = next((s for s in STEPS_S if end_s / s <= TICKS), STEPS_S[-1])
    axis.xaxis.set_major_locator(MultipleLocator(step))
    shown_letters = None if step < 60 else -3  # without the seconds
    axis.xaxis.set_major_formatter(FuncFormatter(lambda t, _: clock_time(t)[:shown_letters]))
    axis.set_xlabel("time, h:min" if step >= 60 else "time, h:min:s")
    axis.set_title("what each head does")
    legend = [
        Patch(color=head_colour(0, 2), label="prints (each head its colour)"),
        Patch(color=MOVES, label="travels"),
        Patch(fc="white", ec="#9a9a9a", hatch="////", label="waits"),
    ]
    axis.legend(
        handles=legend, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2
    )


def activity(actions: HeadActions, makespan_s: float) -> tuple[Floats, Floats]:
    """Return the edges of intervals and the shares of them spent printing and travelling.

    Returns
    -------
    edges : (k + 1,) seconds
    shares : (k, 2) printing, travelling; the rest is waiting
    """
    if len(actions) <= EXACT:
        edges = np.unique(np.concatenate([[0.0, makespan_s], actions.begin_s, actions.end_s]))
    else:
        edges = np.linspace(0.0, makespan_s, INTERVALS + 1)
    printing = actions.kind == ActionKind.PRINT
    travelling = ~printing & (actions.kind != ActionKind.WAIT)
    width = np.maximum(np.diff(edges), 1e-12)
    columns = [
        np.diff(time_spent(actions.begin_s[rows], actions.end_s[rows], edges)) / width
        for rows in (printing, travelling)
    ]
    return edges, np.clip(np.stack(columns, axis=1), 0.0, 1.0)


def time_spent(begin: Floats, end: Floats, at: Floats) -> Floats:
    """Return the seconds that intervals, in their order, cover up to each time."""
    if not len(begin):
        return np.zeros(len(at))
    done = np.cumsum(end - begin)
    times = np.stack([begin, end], axis=1).ravel()
    spent = np.stack([done - (end - begin), done], axis=1).ravel()
    return np.interp(at, times, spent)


def _row_label(actions: HeadActions, end_s: float) -> str:
    """Return the name of a head, and how much of the time it prints."""
    spent = (actions.end_s - actions.begin_s)[actions.kind == ActionKind.PRINT].sum() / end_s
    name = actions.head if len(actions.head) <= NAME else f"{actions.head[: NAME - 1]}…"
    return f"{name}\nprints {100 * float(spent):.0f} %"
