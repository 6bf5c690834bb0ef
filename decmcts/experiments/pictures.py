"""Figures of experiments: curves with their spread, and boxes."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from decmcts.experiments.rows import Line

DPI = 110


def figure(columns: int, *, width: float = 5.0, height: float = 4.2) -> tuple[Figure, list[Axes]]:
    """Return a figure of so many axes side by side."""
    made = Figure(figsize=(width * columns, height), layout="constrained")
    axes = list(made.subplots(1, columns, squeeze=False)[0])
    for each in axes:
        each.grid(alpha=0.3)
    return made, axes


def curve(
    axis: Axes, rows: Iterable[Line], x: str, y: str, label: str, style: str = "o-",
    middle: Callable[[list[float]], float] = statistics.median,
) -> None:  # fmt: skip
    """Draw the median of a column, or its mean, over another, and from its least to its most."""
    found: dict[float, list[float]] = {}
    for row in rows:
        found.setdefault(float(row[x]), []).append(float(row[y]))
    if not found:
        return
    at = sorted(found)
    (line,) = axis.plot(at, [middle(found[v]) for v in at], style, label=label)
    low, high = [min(found[v]) for v in at], [max(found[v]) for v in at]
    axis.fill_between(at, low, high, color=line.get_color(), alpha=0.15)


def boxes(axis: Axes, values: Sequence[Sequence[float]], labels: Sequence[str]) -> None:
    """Draw a box for each list of values: median, quartiles, and all values as points."""
    axis.boxplot(list(values), showfliers=False)
    for k, each in enumerate(values, 1):
        axis.plot([k] * len(each), list(each), ".", color="C0", alpha=0.5)
    axis.set_xticks(range(1, len(labels) + 1), labels, rotation=20, ha="right")
