"""Sequential ordering problems in TSPLIB's and SOPLIB's formats, and tours of them.

A full matrix of costs, in which −1 says that the column must come before the
row. Nothing is solved here. Nodes are numbered from 1 in files and from 0 in
memory.

References
----------
Reinelt 1991, "TSPLIB: a traveling salesman problem library", section 1.2
(EDGE_WEIGHT_SECTION, FULL_MATRIX) and section 2 (TOUR_SECTION).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decmcts.arguments import checked
from decmcts.arrays import Floats, Int32s
from decmcts.errors import InputError
from decmcts.formats.files.bounds import unpacked
from decmcts.formats.files.reading import read_bytes
from decmcts.print.brief import brief

SOP_SUFFIXES = (".sop", ".sop.gz")
MOST_NODES = 20_000  # 3.2 GB of costs
MOST_COST = 1e12  # sums of larger ones are no longer exact
_EXPECTED = {
    "TYPE": "SOP",
    "EDGE_WEIGHT_TYPE": "EXPLICIT",
    "EDGE_WEIGHT_FORMAT": "FULL_MATRIX",
}
_MUST_PRECEDE = -1.0


@dataclass(frozen=True, slots=True)
class SopInstance:
    """Costs between nodes and which node must come before which."""

    name: str
    costs: Floats  # (n, n) from row to column; 0 where there is no such step
    precedence: Int32s  # (m, 2) rows (a, b): a somewhere before b

    __repr__ = brief("name", "costs", "precedence")

    def __len__(self) -> int:
        return len(self.costs)


def is_sop(path: Path) -> bool:
    """Say whether the name of a file is that of a sequential ordering problem."""
    return path.name.lower().endswith(SOP_SUFFIXES)


@checked
def read_sop(path: Path | str) -> SopInstance:
    """Read `X.sop` or `X.sop.gz`.

    Raises
    ------
    InputError
        With file and line, for a file that cannot be read, is of another kind or
        form, is cut off, or holds a cost that is neither −1 nor a number from 0 to `MOST_COST`.
    """
    source = Path(path)
    lines = _text(source).splitlines()
    if not any(line.strip() for line in lines):
        raise InputError("is empty", path=source, advice="fetch it again")
    if (bare := _bare(lines, source)) is not None:
        n, first = bare
        return _instance(source.name, _matrix(lines, first, n, source))
    header, first = _header(lines, source)
    text, line = header.get("DIMENSION", ("", 0))
    if not line:
        raise InputError("no DIMENSION before the matrix", path=source)
    n = _size(text, "DIMENSION", source, line)
    return _instance(header["NAME"][0] or source.name, _matrix(lines, first, n, source))


def tour_text(*, name: str, order: Int32s, cost: float) -> bytes:
    """Return a tour as a file (`TYPE: TOUR`), nodes numbered from 1."""
    head = f"NAME: {name}\nTYPE: TOUR\nCOMMENT: cost {cost:.10g}\nDIMENSION: {len(order)}\n"
    body = "".join(f"{node + 1}\n" for node in order)
    return f"{head}TOUR_SECTION\n{body}-1\nEOF\n".encode()


def _text(source: Path) -> str:
    try:
        return unpacked(read_bytes(source), source).decode("ascii")
    except UnicodeDecodeError as error:
        raise InputError(
            f"byte {error.start} is no text", path=source, advice="give a TSPLIB .sop file"
        ) from error


def _bare(lines: list[str], source: Path) -> tuple[int, int] | None:
    """Return size and first line of a matrix without a header, None where there is one.

    SOPLIB is published so: the size on a line of its own, then the matrix; without
    the size the first row tells it.
    """
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        if not re.fullmatch(r"[-+]?[\d.]+", words[0]):
            return None
        if len(words) > 1:
            return _size(str(len(words)), "the first row's length", source, number), number
        return _size(words[0], "the size", source, number), number + 1
    return None


def _size(text: str, what: str, source: Path, line: int) -> int:
    if not text.isdigit() or len(text) > 9 or not 1 <= int(text) <= MOST_NODES:
        raise InputError(
            f"{what} is {text[:20]!r}, expected a number from 1 to {MOST_NODES}",
            path=source,
            line=line,
        )
    return int(text)


def _header(lines: list[str], source: Path) -> tuple[dict[str, tuple[str, int]], int]:
    """Return keyword -> (value, line) and the number of the first line of the matrix."""
    header: dict[str, tuple[str, int]] = {"NAME": ("", 0)}
    for number, line in enumerate(lines, start=1):
        key, _, value = (part.strip() for part in line.partition(":"))
        if key == "EDGE_WEIGHT_SECTION":
            return header, number + 1
        if key in _EXPECTED and value != _EXPECTED[key]:
            raise InputError(
                f"{key} is {value!r}, only {_EXPECTED[key]} can be read", path=source, line=number
            )
        if key:
            header[key] = (value, number)
    raise InputError(
        "no EDGE_WEIGHT_SECTION", path=source, line=len(lines), advice="give a TSPLIB .sop file"
    )


def _matrix(lines: list[str], first: int, n: int, source: Path) -> Floats:
    """Return the numbers of the matrix as (n, n), −1 included.

    TSPLIB's own SOP files repeat the dimension on a line of its own before the
    matrix. Rows may be broken over lines, down to a number a line.
    """
    rows: list[Floats] = []
    for number, line in enumerate(lines[first - 1 :], start=first):
        words = line.split()
        if words[:1] == ["EOF"]:
            break
        if words:
            rows.append(_numbers(words, source, number))
    if len(rows) > 1 and rows[0].tolist() == [n]:
        del rows[0]
    if (count := sum(map(len, rows))) != n * n:
        raise InputError(
            f"{count} costs instead of {n} × {n}",
            path=source,
            line=len(lines),
            advice="the file is cut off or its dimension is wrong",
        )
    return np.concatenate(rows).reshape(n, n)


def _numbers(words: list[str], source: Path, line: int) -> Floats:
    """Return one line of the matrix, checked."""
    try:
        row = np.array(words, np.float64)
    except ValueError as error:
        raise InputError(f"not a number ({error})", path=source, line=line) from error
    wrong = ~((row == _MUST_PRECEDE) | ((row >= 0) & (row <= MOST_COST)))
    if wrong.any():
        raise InputError(
            f"cost {words[int(np.flatnonzero(wrong)[0])]} is neither -1 nor a number from 0 to "
            f"{MOST_COST:g}",
            path=source,
            line=line,
        )
    return row


def _instance(name: str, matrix: Floats) -> SopInstance:
    """Split the matrix into costs and precedence."""
    np.fill_diagonal(matrix, 0.0)
    after, before = np.nonzero(matrix == _MUST_PRECEDE)
    pairs = np.stack([before, after], axis=1).astype(np.int32)
    return SopInstance(name, np.where(matrix < 0, 0.0, matrix), pairs)
