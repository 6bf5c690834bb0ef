"""Figures of a result in the maker's words, the same on the terminal, in pictures and reports."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from decmcts.print.metrics import Metrics

_IDLE = {"pulled": "pulled back further", "cooled": "cooled to standby", "primed": "primed"}

MAKERS = {
    "emitted_travel_mm": "travel",
    "retractions": "retractions",
    "tool_changes": "changes of tools",
    "travel_over_walls_mm": "travel over outer walls",
}
"""What else than time a maker compares, by its key in `Metrics`; the last two where
there are several tools, and where roles are named."""


def clock_time(seconds: float) -> str:
    """Return a time as people read it: hours, minutes and seconds.

    Examples
    --------
    >>> clock_time(3725.4), clock_time(88.0)
    ('1:02:05', '0:01:28')
    """
    minutes, left = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{left:02d}"


def shown(key: str, value: float) -> str:
    """Return a figure of `Metrics` as it is read: times in h:min:s, lengths in mm, or a count.

    Examples
    --------
    >>> shown("print_time_s", 88.0), shown("emitted_travel_mm", 1234.5), shown("retractions", 7)
    ('0:01:28', '1,234 mm', '7')
    """
    if key.endswith("_s"):
        return clock_time(value)
    return f"{value:,.0f} mm" if key.endswith("_mm") else f"{value:,.0f}"


def change(was: float, now: float) -> str:
    """Return by what share a figure changed, with its sign; nothing where there was none.

    Examples
    --------
    >>> change(200.0, 150.0), change(0.0, 1.0)
    ('−25.0 %', '')
    """
    return f"{100.0 * (now - was) / was:+.1f} %".replace("-", "−") if was else ""


def idle_line(metrics: Metrics) -> str:
    """Return where heads stand idle and what is done there; nothing where they do not.

    Examples
    --------
    >>> idle_line({"idle": {"waits": 2, "waits_s": 88.0, "pulled": 2, "primed": 0, "cooled": 1}})
    '2 long waits, 0:01:28 in all: pulled back further 2 times, cooled to standby 1 time'
    """
    idle: object = metrics.get("idle")  # of a plan that was read it may be anything
    if not isinstance(idle, Mapping) or not _count(idle, "waits"):
        return ""
    done = [
        f"{words} {_times(count, 'time')}"
        for key, words in _IDLE.items()
        if (count := _count(idle, key))
    ]
    stood = clock_time(_count(idle, "waits_s"))
    waits = f"{_times(_count(idle, 'waits'), 'long wait')}, {stood} in all"
    nothing = "heads stay hot, with no more pulled back than for their travels"
    return f"{waits}: {', '.join(done) or nothing}"


def _count(figures: Mapping[Any, Any], key: str) -> int:
    value = figures.get(key)
    return round(value) if isinstance(value, int | float) and math.isfinite(value) else 0


def _times(count: int, word: str) -> str:
    return f"{count:,} {word}{'s' * (count != 1)}"
