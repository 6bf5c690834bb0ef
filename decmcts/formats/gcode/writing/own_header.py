"""The comment lines at the top of a file of ours: put there, known again, and what they keep.

A file that was planned already is a source like any other. What its slicer's own order took stays
in the header through all later runs, as what the result is compared with.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

TRAVEL = "extrusionless travel {was:.1f} mm -> {now:.1f} mm"
TIME = "time of the whole file {was:.0f} s -> {now:.0f} s ({order} -> in this order)"
SAFE = "the slicer's own order would hit the part: all is compared with it layer by layer"
_HEADER = re.compile(  # as `decmcts.planning.writing.lines` words it
    rb"^; reordered by decmcts ([^\s;]*+)[^\n]*+\n(?:;[^\n]*+\n){0,12}?"
    rb"; verified: every extrusion[^\n]*+\n",
    re.MULTILINE,
)
_BLOCK = re.compile(rb"; HEADER_BLOCK_START\r?\n(?:;[^\n]*+\n)*?; HEADER_BLOCK_END\r?\n")
_TRAVEL_MM = re.compile(rb"^; extrusionless travel ([0-9]++(?:\.[0-9]*+)?) mm ->", re.M)
_TIME_S = re.compile(rb"^; time of the whole file ([0-9]++(?:\.[0-9]*+)?) s ->", re.M)


@dataclass(frozen=True, slots=True)
class AsSliced:
    """What the header of a file of ours says of the slicer's own order."""

    version: str  # of the program that planned it first or last
    travel_mm: float | None
    time_s: float | None
    made_safe: bool = False  # the slicer's order would hit the part; both are of a safe one


def as_sliced(text: bytes) -> AsSliced | None:
    """Return what a file says of the order it was sliced in; None if it is none of ours."""
    header = None
    if b"; reordered by decmcts " in text:  # far quicker than the pattern
        header = _HEADER.search(text)
    if header is None:
        return None
    return AsSliced(
        header[1].decode("utf-8", "replace"),
        _number(_TRAVEL_MM.search(header[0])),
        _number(_TIME_S.search(header[0])),
        SAFE.encode() in header[0],
    )


def _number(found: re.Match[bytes] | None) -> float | None:
    return None if found is None else float(found[1])


def with_header(preamble: bytes, header: Sequence[str], newline: bytes) -> bytes:
    """Return the preamble with comment lines below the line that names the slicer.

    They take the place of those an earlier run wrote.
    """
    if not header:
        return preamble
    preamble = _HEADER.sub(b"", preamble)
    text = b"".join(
        b"; " + part.encode("utf-8", "surrogateescape") + newline
        for line in header
        for part in line.splitlines()
    )
    if block := _BLOCK.match(preamble):  # which readers look for at the top
        return block[0] + text + preamble[block.end() :]
    first = preamble.split(b"\n", 1)[0]
    named = first.lstrip().startswith(b";") and (b"enerated" in first or b"FLAVOR" in first)
    cut = preamble.find(b"\n") + 1 if named else 0
    return preamble[:cut] + text + preamble[cut:]


def with_time(text: bytes, was_s: float | None, now_s: float) -> bytes:
    """Return a file of ours with the times of whole files in its header, known only now.

    Nothing is said where there is no other file to compare with.
    """
    header = _HEADER.search(text)
    if header is None or was_s is None:
        return text
    order = "layer by layer" if SAFE.encode() in header[0] else "as sliced"
    line = f"; {TIME.format(was=was_s, now=now_s, order=order)}".encode()
    end = text.rfind(b"\n", 0, text.rfind(b"; verified:", header.start(), header.end())) + 1
    newline = b"\r\n" if header[0].endswith(b"\r\n") else b"\n"
    return text[:end] + line + newline + text[end:]
