"""Mutants of the files of several heads: their sync points, heat and contours."""

from __future__ import annotations

import re

from decmcts.formats.gcode.dialects.dialect import WAIT_MARK
from tests.mutants.catalogue import Mutant, NotHereError, pick
from tests.mutants.gcode import GCODE_MUTANTS
from tests.mutants.gcode_lines import (
    BEAD,
    PASSED,
    SIGNAL,
    WAIT,
    Files,
    Lines,
    Rng,
    Spoil,
    between,
    change,
    in_one,
    moved_earlier,
    moved_later,
    remove,
    rows_of,
    some_contour,
)  # fmt: skip


def exchange_files(files: Files, rng: Rng) -> None:
    """Give each controller the other one's file."""
    files[0][:], files[1][:] = list(files[1]), list(files[0])


def same_file_twice(files: Files, rng: Rng) -> None:
    """Give both controllers one file."""
    files[1][:] = list(files[0])


def numbers_exchanged(pattern: re.Pattern[str]) -> Spoil:
    """Return a mutant that exchanges two lines of a kind."""

    def spoil(lines: Lines, rng: Rng) -> None:
        rows, beads = rows_of(lines, pattern), rows_of(lines, BEAD)
        # behind the last bead all heads give two, and each waits for both
        k = pick([k for k in range(len(rows) - 1) if beads and rows[k] < beads[-1]], rng)
        if lines[rows[k]] == lines[rows[k + 1]]:
            raise NotHereError
        lines[rows[k]], lines[rows[k + 1]] = lines[rows[k + 1]], lines[rows[k]]

    return spoil


def without_its_stop(lines: Lines, rng: Rng) -> None:
    """Give a signal at rest in motion, without the M400 above it."""
    k = pick([k for k in rows_of(lines, SIGNAL) if k and lines[k - 1] == "M400"], rng)
    lines[k - 1 : k + 1] = [lines[k].replace("SIGNAL", "PASSED")]


def contour_to_the_other(files: Files, rng: Rng) -> None:
    """Let one head print a contour of the other."""
    first, last = some_contour(files[0], rng)
    moved = files[0][first:last]
    del files[0][first:last]
    at = between(files[1], rng)
    files[1][at + 1 : at + 1] = moved


HEAD_MUTANTS: tuple[Mutant[Files], ...] = (
    Mutant("files exchanged", exchange_files),
    Mutant("one file twice", same_file_twice),
    Mutant("a contour given to the other head", contour_to_the_other),
    Mutant("a wait dropped", in_one(remove(WAIT))),
    Mutant("all waits dropped", in_one(remove(WAIT, all_of_them=True))),
    Mutant("a signal dropped", in_one(remove(SIGNAL))),
    Mutant("a signal twice", in_one(change(SIGNAL, r"(SYNC_SIGNAL N=\d+)", r"\1\n\1"))),
    Mutant("another number waited for", in_one(change(WAIT, r"N=(\d+)", r"N=9\1"))),
    Mutant("another number signalled", in_one(change(SIGNAL, r"N=(\d+)", r"N=9\1"))),
    Mutant("a signal too soon", in_one(moved_earlier(SIGNAL))),
    Mutant("a wait too late", in_one(moved_later(WAIT))),
    Mutant("signals exchanged", in_one(numbers_exchanged(SIGNAL))),
    Mutant("waits exchanged", in_one(numbers_exchanged(WAIT))),
    Mutant("a signal in motion dropped", in_one(remove(PASSED))),
    Mutant("a signal in motion twice", in_one(change(PASSED, r"(.*N=\d+)", r"\1\n\1"))),
    Mutant("a signal in motion too soon", in_one(moved_earlier(PASSED))),
    Mutant("a signal in motion too late", in_one(moved_later(PASSED))),
    Mutant("a signal in motion at rest", in_one(change(PASSED, r"(.*N=\d+)", r"M400\n\1"))),
    Mutant("a signal at rest in motion", in_one(change(SIGNAL, "SIGNAL", "PASSED"))),
    Mutant("no M400 before a signal", in_one(remove(r"^M400"))),
    Mutant("a signal at rest without its stop", in_one(without_its_stop)),
    Mutant("M400 before a wait", in_one(change(WAIT, r"(SYNC_WAIT N=\d+)", r"M400\n\1"))),
    Mutant(
        "a dwell before a signal in motion",
        in_one(change(PASSED, r"(.*N=\d+)", rf"G4 P90 {WAIT_MARK}\n\1")),
    ),
    Mutant("no wait for heat", in_one(remove(r"^M109"))),
    Mutant("hotter while it waits its turn", in_one(change(r"^M104 S.*while", r"S\d+", "S290"))),
    Mutant("no time between two signals", in_one(remove(r"^G4 P10\d"))),
    *(
        Mutant(one.name, in_one(one.spoil), one.harmless)
        for one in GCODE_MUTANTS
        if one.name
        in (
            "a bead dropped",
            "a bead twice",
            "a contour dropped",
            "a contour twice",
            "more filament",
            "an arc dropped",
            "an arc the other way round",
            "an arc as a straight line",
            "an arc around another centre",
            "a bead a little elsewhere",
            "another feed",
            "a travel elsewhere",
            "a travel through the print",
            "no retraction",
            "no priming",
            "a retraction behind its travel",
            "priming before its travel",
            "neither retraction nor priming",
            "a retraction that takes a minute",
            "a word twice in a bead",
            "a word twice in a travel",
            "a line number",
            "another fan speed",
            "no M83",
            "no homing",
            "cut off in the middle",
            "the end cut off",
            "between contours: G28",
            "between contours: PAUSE",
            "between contours: G92 X0",
            "between contours: M84",
            "between contours: G1 Z0.05",
            "a comment more",
        )
    ),
)
