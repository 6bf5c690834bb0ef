"""Reading TSPLIB's sequential ordering problems, and writing tours."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.bare.sop import is_sop, read_sop, tour_text

HEAD = (
    "NAME: tiny.sop\nTYPE: SOP\nCOMMENT: three nodes\nDIMENSION: 3\n"
    "EDGE_WEIGHT_TYPE: EXPLICIT\nEDGE_WEIGHT_FORMAT: FULL_MATRIX \nEDGE_WEIGHT_SECTION\n"
)
ROWS = " 0 4 7\n-1 0 2.5\n-1 -1 0\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "tiny.sop"
    path.write_text(text)
    return path


@pytest.mark.parametrize("start", ["", "3\n", " 3 \n"])
def test_minus_one_says_that_the_column_comes_before_the_row(tmp_path: Path, start: str) -> None:
    """The other way round every constraint is reversed; TSPLIB's files repeat the dimension."""
    instance = read_sop(written(tmp_path, HEAD + start + ROWS + "EOF\n"))
    assert instance.name == "tiny.sop"
    assert instance.costs.tolist() == [[0, 4, 7], [0, 0, 2.5], [0, 0, 0]]
    assert sorted(map(tuple, instance.precedence.tolist())) == [(0, 1), (0, 2), (1, 2)]


def test_rows_may_be_broken_and_packed(tmp_path: Path) -> None:
    """SOPLIB's rows are long; some tools wrap them. The collection is kept gzipped."""
    path = tmp_path / "tiny.SOP.gz"
    path.write_bytes(gzip.compress((HEAD + "0 4\n7 -1 0\n2.5 -1 -1 0\nEOF").encode()))
    plain = read_sop(written(tmp_path, HEAD + ROWS))
    assert is_sop(path)
    assert (read_sop(path).costs == plain.costs).all()


@pytest.mark.parametrize("start", ["", "3\n"])
def test_a_number_a_line_is_read_too(tmp_path: Path, start: str) -> None:
    """Some tools write so, with or without the dimension before, or break off one number only."""
    plain = read_sop(written(tmp_path, HEAD + ROWS)).costs
    for text in ("\n".join(ROWS.split()), ROWS.replace("0 4", "0\n4", 1)):
        assert (read_sop(written(tmp_path, HEAD + start + text)).costs == plain).all()
    one = HEAD.replace("N: 3", "N: 1") + start.replace("3", "1") + "0\n"
    assert read_sop(written(tmp_path, one)).costs.tolist() == [[0.0]]


@pytest.mark.parametrize("start", ["", "3\n", "\n 3 \n\n"])
@pytest.mark.parametrize("rows", [ROWS, ROWS.replace(" ", "\t").lstrip(), "\n".join(ROWS.split())])
def test_a_bare_matrix_is_read(tmp_path: Path, start: str, rows: str) -> None:
    """SOPLIB is published without a header: the size, or not even that, and the matrix."""
    if not start and rows.count(" ") + rows.count("\t") == 0:
        start = "3\n"  # a number a line does not tell the size
    plain = read_sop(written(tmp_path, HEAD + ROWS))
    bare = read_sop(written(tmp_path, start + rows))
    assert bare.name == "tiny.sop"
    assert bare.costs.tolist() == plain.costs.tolist()
    assert bare.precedence.tolist() == plain.precedence.tolist()


BAD = {
    "bare, cut off": ("3\n0 4 7\n-1 0 2\n", "3", "6 costs instead of 3 × 3"),
    "bare, too many": ("3\n0 4 7\n-1 0 2\n-1 -1 0\n1 2\n", "5", "11 costs instead of 3 × 3"),
    "bare, no number": ("3\n0 4 7\n-1 x 2\n-1 -1 0\n", "3", "not a number"),
    "bare, no size": ("0 4 7\n-1 0 2\n", "2", "6 costs instead of 3 × 3"),
    "bare, absurd size": ("99999999999\n0 4 7\n", "1", "from 1 to 20000"),
    "cut off": (HEAD + "0 4 7\n-1 0 2\n", "9", "6 costs instead of 3 × 3"),
    "cut off by one": (HEAD + "3\n0 4 7\n-1 0 2\n-1 -1\n", "11", "8 costs instead of 3 × 3"),
    "one too many": (HEAD + "0 4 7\n-1 0 2\n-1 -1 0\n5\n", "11", "10 costs instead of 3 × 3"),
    "a number a line, cut off by one": (
        HEAD + "\n".join(["3", *ROWS.split()][:-1]),
        "16",
        "8 costs instead of 3 × 3",
    ),
    "too long": (HEAD + ROWS + "5 5 5\n", "11", "12 costs instead of 3 × 3"),
    "a word": (HEAD + "0 4 7\n-1 x 2\n-1 -1 0\n", "9", "'x'"),
    "negative": (HEAD + "0 4 7\n-2 0 2\n-1 -1 0\n", "9", "-2 is neither"),
    "not finite": (HEAD + "0 4 inf\n-1 0 2\n-1 -1 0\n", "8", "inf is neither"),
    "too large": (HEAD + "0 4 1e13\n-1 0 2\n-1 -1 0\n", "8", "1e13 is neither"),
    "endless dimension": (HEAD.replace("N: 3", "N: " + "9" * 5000), "4", "expected a number"),
    "another dimension": (HEAD + "4\n" + ROWS, "11", "10 costs instead of 3 × 3"),
    "a tour": (HEAD.replace("SOP\n", "ATSP\n", 1), "2", "TYPE is 'ATSP'"),
    "points": (HEAD.replace("EXPLICIT", "EUC_2D"), "5", "EUC_2D"),
    "half a matrix": (HEAD.replace("FULL_MATRIX", "UPPER_ROW"), "6", "UPPER_ROW"),
    "no number": (HEAD.replace("N: 3", "N: three"), "4", "'three'"),
    "no dimension": (HEAD.replace("DIMENSION: 3\n", ""), "", "no DIMENSION"),
    "no matrix": ("NAME: a\nTYPE: SOP\n", "2", "no EDGE_WEIGHT_SECTION"),
    "empty": ("", "", "is empty"),
}


@pytest.mark.parametrize("name", sorted(BAD))
def test_bad_files_are_refused_with_the_line(tmp_path: Path, name: str) -> None:
    """A user must find the place; a cut-off matrix must not be solved."""
    text, line, word = BAD[name]
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_sop(path)
    assert str(caught.value).startswith(f"{path}:{line}" if line else str(path))
    assert word in str(caught.value)


def test_damaged_and_missing_files_are_named(tmp_path: Path) -> None:
    """Broken downloads and mistyped names are the commonest faults."""
    path = tmp_path / "tiny.sop.gz"
    path.write_bytes(gzip.compress((HEAD + ROWS).encode())[:40])
    with pytest.raises(InputError, match=r"tiny\.sop\.gz: damaged"):
        read_sop(path)
    with pytest.raises(InputError, match=r"(?i)no such file"):
        read_sop(tmp_path / "none.sop")
    (tmp_path / "b.sop").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="no text"):
        read_sop(tmp_path / "b.sop")


def test_a_tour_is_numbered_from_one(tmp_path: Path) -> None:
    """Other programs read it: TSPLIB counts from 1 and ends with -1."""
    tour = tour_text(name="tiny", order=np.array([0, 2, 1], np.int32), cost=1234567.5)
    text = tour.decode()
    assert "DIMENSION: 3\nTOUR_SECTION\n1\n3\n2\n-1\nEOF\n" in text
    assert "cost 1234567.5" in text
