"""What an experiment is: the runs it makes, one run, and what its rows say.

Rows are kept in a CSV file; tables and figures are made of them.
"""

from __future__ import annotations

import csv
import io
import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from decmcts.formats.files.atomic import write_whole
from decmcts.search.sequence.stopping import Stopping

if TYPE_CHECKING:  # matplotlib loads for those who draw
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    runs: Callable[[Asked], Iterator[tuple[Any, ...]]]  # the values of `key` for each
    run: Callable[[Key], Row]
    tables: Callable[[Sequence[Line]], str]  # Markdown
    draw: Callable[[Sequence[Line]], Figure]
    seconds: Sizes  # of processor time for each search
    seeds: Sizes
    compiled: tuple[str, ...]  # parts that are compiled ahead

    def keys(self, asked: Asked) -> Iterator[Key]:
        """Yield what tells each run from the others."""
        for values in self.runs(asked):
            yield dict(zip(self.key, values, strict=True))


def stopping_of(key: Key, scale: int = 1) -> Stopping:
    """Return when a search of a run ends: by seconds, or by its iterations times a scale."""
    if key["iterations"]:
        return Stopping(iterations=int(key["iterations"]) * scale)
    return Stopping(float(key["seconds"]))


UTF8, RAW = "utf-8", "surrogateescape"  # names of files, whatever the locale, may be no text
Line = dict[str, str]  # a row as it is read back


class Rows:
    """A CSV file of results, one row a run; a run that is there, and fine, is not repeated."""

    def __init__(self, path: Path, key: tuple[str, ...]) -> None:
        self.path, self.key = path, key
        self.rows: list[Line] = []
        self._torn = False  # the last row was not written to its end
        self.read()

    def read(self) -> None:
        """Read the rows there are; several benchmarks may append to one file.

        What ends without a line end is no row: whoever wrote it was killed, or the disk was full.
        """
        if self.path.exists():
            text = self.path.read_bytes()
            whole = text[: text.rfind(b"\n") + 1]
            self._torn = len(whole) < len(text)
            lines = io.StringIO(whole.decode(UTF8, RAW), newline="")
            self.rows = list(csv.DictReader(lines))

    def missing(self, keys: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return the keys of which no run was made already, by this process or another."""
        self.read()
        made = {self.key_of(row) for row in self.rows if not row.get("error")}
        return [key for key in keys if tuple(str(key[name]) for name in self.key) not in made]

    def key_of(self, row: Line) -> tuple[str, ...]:
        """Return the values of a row that say which run it was."""
        return tuple(row[name] for name in self.key)

    def append(self, row: dict[str, Any]) -> None:
        """Add one row at the end of the file at once; new columns are empty in older rows.

        Where it brings new columns, or stands behind a torn row, the file is written anew.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.read()
        names = list(self.rows[0]) if self.rows else []
        added = [name for name in row if name not in names]
        lines = io.StringIO(newline="")
        writer = csv.DictWriter(lines, fieldnames=[*names, *added], restval="")
        anew = added or self._torn
        if anew:
            writer.writeheader()
            writer.writerows(self.rows)
        writer.writerow(row)
        text = lines.getvalue().encode(UTF8, RAW)
        if anew:
            write_whole(self.path, text)
        else:
            with self.path.open("ab") as file:
                file.write(text)
        self.rows.append({name: str(value) for name, value in row.items()})


def grouped(rows: Iterable[Line], *fields: str) -> dict[tuple[str, ...], list[Line]]:
    """Return the rows without an error by their values of `fields`, in order of appearance."""
    found: dict[tuple[str, ...], list[Line]] = {}
    for row in rows:
        if not row["error"]:
            found.setdefault(tuple(row[name] for name in fields), []).append(row)
    return found


def against(rows: Iterable[Line], is_base: Callable[[Line], bool], *same: str) -> list[Line]:
    """Return the rows with `ratio`: makespan over that of the base row alike in these columns.

    Rows with an error, and those that have no such base, are left out.
    """
    fine = [row for row in rows if not row["error"]]
    base = {tuple(row[name] for name in same): row for row in fine if is_base(row)}
    return [
        {**row, "ratio": str(float(row["makespan_s"]) / float(base[at]["makespan_s"]))}
        for row in fine
        if (at := tuple(row[name] for name in same)) in base
    ]


def column(rows: Iterable[Line], name: str) -> list[float]:
    """Return a column as numbers."""
    return [float(row[name]) for row in rows]


def median(rows: Iterable[Line], field: str) -> float:
    """Return the median of a column over rows, at least one."""
    return statistics.median(column(rows, field))


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Return the median of values and, in brackets, their quartiles."""
    if len(values) < 2:
        return f"{values[0]:.{digits}f}" if values else ""
    low, mid, high = statistics.quantiles(values, n=4, method="inclusive")
    return f"{mid:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def markdown(rows: Sequence[Sequence[str]], head: Sequence[str]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


DPI = 110


def figure(columns: int, *, width: float = 5.0, height: float = 4.2) -> tuple[Figure, list[Axes]]:
    """Return a figure of so many axes side by side."""
    from matplotlib.figure import Figure

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
