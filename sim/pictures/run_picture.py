"""A picture of a simulated run: what heads do over time, and how near they come."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from sim.controllers.program import StopKind
from sim.controllers.simulate import Simulation
from sim.pictures.canvas import head_colour, save, words_as_they_are
from sim.pictures.charts import time_spent

WAITS, TRAVELS, STANDS = "#d62728", "#bbbbbb", "#444444"
SLOTS = 1200  # spans of time of which each shows what a head does most


def draw_run(path: Path | str, simulation: Simulation) -> None:
    """Write the picture of a run without errors of time; .png or .svg."""
    end = simulation.makespan_s
    if not np.isfinite(end):
        finite = [head.end[np.isfinite(head.end)] for head in simulation.run.heads]
        end = max(float(each.max(initial=0.0)) for each in finite) - simulation.begin_s
    names = [head.name for head in simulation.heads]
    with words_as_they_are():
        several = len(names) > 1
        figure = Figure(figsize=(10.0, 1.6 + 0.5 * len(names) + (2.4 if several else 0.0)))
        axes: Any = figure.subplots(
            1 + several, 1, squeeze=False, sharex=True,
            gridspec_kw={"height_ratios": [0.5 * len(names) + 0.4, 2.2][: 1 + several]},
        )[:, 0]  # fmt: skip
        for h in range(len(names)):
            _draw_head(axes[0], simulation, h, end / 60.0)
        for touch in simulation.trials[0].on_print:
            at = (touch.time_s - simulation.begin_s) / 60.0
            axes[0].plot(
                at, touch.head, "x", color="black", markersize=5, label="touches the print"
            )
        axes[0].set_yticks(range(len(names)), names)
        axes[0].set_ylim(len(names) - 0.5, -0.5)
        axes[0].set_title(f"{end / 60.0:,.1f} min", loc="left")
        handles: list[Any] = [
            Patch(color=TRAVELS, label="travels"), Patch(color=WAITS, label="waits"),
            Patch(color=STANDS, label="dwells or is heated"),
        ]  # fmt: skip
        if simulation.trials[0].on_print:
            handles.append(axes[0].lines[0])
        axes[0].legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4,
                       frameon=False)  # fmt: skip
        if several:
            _draw_gaps(axes[1], simulation, names, end / 60.0)
        axes[-1].set_xlabel("minutes since all heads were set up" if several else "minutes")
        axes[-1].set_xlim(0.0, max(end / 60.0, 1e-3))
        figure.tight_layout()
        save(figure, path)


def _draw_head(axis: Any, simulation: Simulation, h: int, minutes: float) -> None:
    """Draw what a head does most in each span of time."""
    program, run = simulation.programs[h], simulation.run.heads[h]
    prints = program.prints
    zero, edges = simulation.begin_s, np.linspace(0.0, minutes * 60.0, SLOTS + 1)
    waits = program.stops.kind == StopKind.WAIT
    stands = np.isin(program.stops.kind, (StopKind.DWELL, StopKind.HEAT))
    spans = [
        (run.begin[prints], run.end[prints], head_colour(h, len(simulation.heads))),
        (run.begin[~prints], run.end[~prints], TRAVELS),
        (run.reached[waits], run.left[waits], WAITS),
        (run.reached[stands], run.left[stands], STANDS),
    ]
    busy = []
    for begin, end, _ in spans:
        known = np.isfinite(begin) & np.isfinite(end)
        busy.append(np.diff(time_spent(begin[known] - zero, end[known] - zero, edges)))
    most = np.where(np.max(busy, axis=0) > 0.0, np.argmax(busy, axis=0), -1)
    for k, (_, _, colour) in enumerate(spans):
        slots = np.flatnonzero(most == k)
        bars = [(edges[s] / 60.0, (edges[1] - edges[0]) / 60.0) for s in slots.tolist()]
        axis.broken_barh(bars, (h - 0.35, 0.7), color=colour, linewidth=0)


def _draw_gaps(axis: Any, simulation: Simulation, names: list[str], minutes: float) -> None:
    """Draw the least distance of each pair in each span of time."""
    for n, near in enumerate(simulation.trials[0].near):
        shown = np.where(np.isfinite(near.bins), near.bins, np.nan)
        times = np.linspace(0.0, minutes, len(shown) + 1)
        a, b = (names[h] for h in near.heads)
        axis.stairs(shown, times, label=f"{a} and {b}", color=f"C{n}", baseline=None)
        for contact in near.contacts:
            axis.axvline((contact.time_s - simulation.begin_s) / 60.0, color=WAITS, linewidth=0.8)
    axis.set_ylabel("least distance, mm")
    axis.set_ylim(bottom=0.0)
    axis.grid(alpha=0.3)
    if len(simulation.trials[0].near) < 8:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=7, frameon=False)
