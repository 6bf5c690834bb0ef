"""What an experiment is: the runs it makes, one run, and what its rows say."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from decmcts.experiments.rows import Line
from decmcts.search.sequence.stopping import Stopping

Key = dict[str, Any]  # which run it is: text and numbers, so that any process can make it
Row = dict[str, Any]  # what came of it


class Sizes(NamedTuple):
    """What a small version and a full one have of something."""

    small: float
    full: float


@dataclass(frozen=True, slots=True)
class Asked:
    """What the runs of an experiment are chosen by."""

    full: bool = False
    prints: tuple[str, ...] = ()  # files of G-code of one's own; none: prints made by code


@dataclass(frozen=True, slots=True)
class Experiment:
    """A question, and how it is answered."""

    name: str
    question: str
    key: tuple[str, ...]  # names of what runs differ in, besides time and seed
    runs: Callable[[Asked], Iterator[Key]]
    run: Callable[[Key], Row]
    tables: Callable[[Sequence[Line]], str]  # Markdown
    draw: Callable[[Sequence[Line]], Figure]
    seconds: Sizes  # of processor time for each search
    seeds: Sizes
    compiled: tuple[str, ...]  # parts that are compiled ahead


def stopping_of(key: Key, scale: int = 1) -> Stopping:
    """Return when a search of a run ends: by seconds, or by its iterations times a scale."""
    if key["iterations"]:
        return Stopping(iterations=int(key["iterations"]) * scale)
    return Stopping(float(key["seconds"]))
