"""Mutants of a G-code file, as the list of its lines, and of the files of several heads."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from decmcts.formats.gcode.dialects.dialect import WAIT_MARK
from sim.experiments.mutants import Mutant, NotHereError, pick

Lines = list[str]
Files = list[Lines]  # one a head
Rng = np.random.Generator

BEAD = re.compile(r"^G1 X\S+ Y\S+ E\d")
ARC = re.compile(r"^G[23] .*E\d")
TRAVEL = re.compile(r"^G1 X\S+ Y\S+( F\S+)?$")
RETRACT = re.compile(r"^G1 E-")
PRIME = re.compile(r"^G1 E\d")
SIGNAL = re.compile(r"^SYNC_SIGNAL")
PASSED = re.compile(r"^SYNC_PASSED")
WAIT = re.compile(r"^SYNC_WAIT")


def _rows(lines: Lines, pattern: str | re.Pattern[str]) -> list[int]:
    return [k for k, line in enumerate(lines) if re.search(pattern, line)]


def _bead(lines: Lines, rng: Rng) -> int:
    return pick(_rows(lines, BEAD), rng)


def _between(lines: Lines, rng: Rng) -> int:
    """Return a place between two contours: a retraction with beads before and after it."""
    beads = _rows(lines, BEAD)
    return pick([k for k in _rows(lines, RETRACT) if beads[0] < k < beads[-1]], rng)


def insert(text: str) -> Callable[[Lines, Rng], None]:
    """Return a mutant that puts lines between two contours."""

    def spoil(lines: Lines, rng: Rng) -> None:
        at = _between(lines, rng)
        lines[at:at] = text.split("\n")

    return spoil


def within(text: str) -> Callable[[Lines, Rng], None]:
    """Return a mutant that puts lines before a bead."""

    def spoil(lines: Lines, rng: Rng) -> None:
        at = _bead(lines, rng)
        lines[at:at] = text.split("\n")

    return spoil


def remove(pattern: str | re.Pattern[str], *, all_of_them: bool = False) -> Callable[..., None]:
    """Return a mutant that takes out one line, or all, that fit a pattern."""

    def spoil(lines: Lines, rng: Rng) -> None:
        rows = _rows(lines, pattern)
        rows = rows if all_of_them and rows else [pick(rows, rng)]
        for k in reversed(rows):
            del lines[k]

    return spoil


def change(pattern: str | re.Pattern[str], old: str, new: str) -> Callable[[Lines, Rng], None]:
    """Return a mutant that rewrites part of one line that fits a pattern."""

    def spoil(lines: Lines, rng: Rng) -> None:
        k = pick([k for k in _rows(lines, pattern) if re.search(old, lines[k])], rng)
        lines[k] = re.sub(old, new, lines[k], count=1)

    return spoil


def bead_twice(lines: Lines, rng: Rng) -> None:
    """Print one bead twice."""
    at = _bead(lines, rng)
    lines.insert(at, lines[at])


def contour_twice(lines: Lines, rng: Rng) -> None:
    """Print one whole contour twice."""
    first, last = _contour(lines, rng)
    lines[last:last] = lines[first:last]


def _contour(lines: Lines, rng: Rng) -> tuple[int, int]:
    """Return where a contour with its priming begins and, past its retraction, ends."""
    primes, retracts = _rows(lines, PRIME), _rows(lines, RETRACT)
    k = int(rng.integers(2, len(primes) - 2))
    first = max(j for j in _rows(lines, TRAVEL) if j < primes[k])
    return first, min(j for j in retracts if j > primes[k]) + 1


def contour_dropped(lines: Lines, rng: Rng) -> None:
    """Leave one contour out."""
    first, last = _contour(lines, rng)
    del lines[first:last]


def beads_exchanged(lines: Lines, rng: Rng) -> None:
    """Exchange two lines of one contour, so that other beads are laid."""
    beads = _rows(lines, BEAD)
    k = pick([k for k in beads if k + 1 in beads], rng)
    lines[k], lines[k + 1] = lines[k + 1], lines[k]


def arc_turned(lines: Lines, rng: Rng) -> None:
    """Run one arc the other way round its centre."""
    k = pick(_rows(lines, ARC), rng)
    lines[k] = lines[k].replace("G2", "G?").replace("G3", "G2").replace("G?", "G3")


def arc_straight(lines: Lines, rng: Rng) -> None:
    """Go straight to the end of one arc."""
    k = pick(_rows(lines, ARC), rng)
    lines[k] = re.sub(r" [IJ]\S+", "", "G1" + lines[k][2:])


def layers_exchanged(lines: Lines, rng: Rng) -> None:
    """Exchange what is printed at one height and at the next."""
    z = [re.sub(r"^(G1 Z)0\.400", r"\1@", line) for line in lines]
    if not any("@" in line for line in z):
        raise NotHereError
    z = [re.sub(r"^(G1 Z)0\.600", r"\g<1>0.400", line) for line in z]
    lines[:] = [line.replace("G1 Z@", "G1 Z0.600") for line in z]


def cut_off(share: float) -> Callable[[Lines, Rng], None]:
    """Return a mutant that ends the file early."""

    def spoil(lines: Lines, rng: Rng) -> None:
        del lines[int(share * len(lines)) :]

    return spoil


def travel_down(lines: Lines, rng: Rng) -> None:
    """Let a travel go down into the print first."""
    rows = _rows(lines, TRAVEL)
    at = rows[-1]
    lines.insert(at, "G1 Z0.100")


def no_feed(lines: Lines, rng: Rng) -> None:
    """Let a travel have no speed."""
    k = pick(_rows(lines, TRAVEL), rng)
    lines[k] = re.sub(r" F\S+", "", lines[k]) + " F0"


def with_carriage_returns(lines: Lines, rng: Rng) -> None:
    """End lines as on Windows."""
    lines[:] = [line + "\r" for line in lines]


def with_comments(lines: Lines, rng: Rng) -> None:
    """Put a comment behind a bead."""
    k = _bead(lines, rng)
    lines[k] += " ; looks fine"


COMMANDS = (
    "SET_GCODE_OFFSET X=1 MOVE=1", "M206 X5", "M290 Z0.5", "M851 Z-1", "M84", "M112", "M0", "M25",
    "PAUSE", "M600", "G29", "G38.2 Z-5", "M23 other.gco", "G28", "G28 X", "G92 X0", "G92 E5", "G91",
    "M82", "G20", "M220 S50", "M221 S80", "T1", "M104 S0", "M109 S180", "M140 S0", "M107",
    "M106 S13", "M204 P50", "M205 X1", "M900 K1", "M500", "M502", "M999", "M81", "M18", "G10",
    "G4 P60000", "SET_VELOCITY_LIMIT ACCEL=10", "SAVE_CONFIG", "CANCEL_PRINT", "G1 Z0.05\nG1 Z5",
    "G1 E5", "G0 X400", "G2 X10 Y10 I5 J5 E1", "M486 S7", "EXCLUDE_OBJECT NAME=a", "M118 hello",
    "M190 R20", "M211 S0", "M569 P0 S1", "M92 E50", "G54", "G55", "G53 G1 Z1", "M302 S0",
    "M42 P4 S255", "M280 P0 S90", "G5.1 X10 Y10 I1 J1", "M596 P1", "M598", "G18",
)  # fmt: skip
HARMLESS_COMMANDS = {
    "G92 E5": "E counts from move to move here (M83), so where it stands means nothing",
    "M118 hello": "a message moves nothing",
    "M486 S7": "a label; it only matters to who cancels an object",
}

GCODE_MUTANTS: tuple[Mutant[Lines], ...] = (
    Mutant("a bead dropped", remove(BEAD)),
    Mutant("a bead twice", bead_twice),
    Mutant("a contour dropped", contour_dropped),
    Mutant("a contour twice", contour_twice),
    Mutant("two beads exchanged", beads_exchanged),
    Mutant("two layers exchanged", layers_exchanged),
    Mutant("more filament", change(BEAD, r"E(\d)", r"E1\1")),
    Mutant("a bead elsewhere", change(BEAD, r"X(\d+)", r"X1\1")),
    Mutant("a bead a little elsewhere", change(BEAD, r"(X\d+)\.\d", r"\1.7")),
    Mutant("an arc dropped", remove(ARC)),
    Mutant("an arc twice", change(ARC, r"(.*)", r"\1\n\1")),
    Mutant("an arc the other way round", arc_turned),
    Mutant("an arc as a straight line", arc_straight),
    Mutant("an arc around another centre", change(ARC, r"(I-?\d+)\.\d", r"\1.6")),
    Mutant("an arc with more filament", change(ARC, r"E(\d)", r"E1\1")),
    Mutant("another feed", change(BEAD, r" F\d+", " F601")),
    Mutant("a travel elsewhere", change(TRAVEL, r"X\d+", "X33")),
    Mutant("a travel through the print", travel_down),
    Mutant("a travel at feed 0", no_feed),
    Mutant("no retraction", remove(RETRACT)),
    Mutant("no priming", remove(PRIME)),
    Mutant("more priming", change(PRIME, r"E0\.8", "E1.8")),
    Mutant("a fan line gone", remove(r"^M106")),
    Mutant("another fan speed", change(r"^M106", r"S\d+", "S13")),
    Mutant("another acceleration", change(r"^M204", r"P\d+", "P77")),
    Mutant("a temperature line gone", remove(r"^M104 S205")),
    Mutant("another first temperature", change(r"^M109", r"S\d+", "S170")),
    Mutant("no homing", remove(r"^G28")),
    Mutant("no M83", remove(r"^M83")),
    Mutant("no G90", remove(r"^G90"), harmless="absolute positions are where firmware starts"),
    Mutant("no G21", remove(r"^G21"), harmless="millimetres are where firmware starts"),
    Mutant("no waiting for the bed", remove(r"^M190")),
    Mutant("pressure advance gone", remove(r"^M900")),
    Mutant("the heater left on", remove(r"^M104 S0")),
    Mutant("motors left on", remove(r"^M84")),
    Mutant("cut off in the middle", cut_off(0.5)),
    Mutant("the end cut off", cut_off(0.98)),
    Mutant("lines as on Windows", with_carriage_returns, harmless="firmware reads both ends alike"),
    Mutant("a comment more", with_comments, harmless="comments do nothing"),
    Mutant("relative positions within a contour", within("G91")),
    Mutant("a home within a contour", within("G28")),
    Mutant("a dwell within a contour", within("G4 S30")),
    Mutant("a line number", change(BEAD, "^", "N7 ")),
    Mutant("a move behind a lone carriage return", within("; a comment\rG1 X50 Y50 E5")),
    Mutant("an unclosed bracket", change(BEAD, r" E", " ( E")),
    Mutant("a bead a hundred metres away", change(BEAD, r"X\d+", "X100000")),
    Mutant("a coordinate of 5000 digits", change(BEAD, r"X\d+", "X" + "9" * 5000)),
    *(
        Mutant(
            f"between contours: {text.splitlines()[0]}",
            insert(text),
            HARMLESS_COMMANDS.get(text, ""),
        )
        for text in COMMANDS
    ),
)


def other_retraction(own: str, other: str) -> Callable[[Lines, Rng], None]:
    """Return a mutant that lets a tool retract, and push back, as far as another does."""

    def spoil(lines: Lines, rng: Rng) -> None:
        pairs = [k for k in _rows(lines, rf"^G1 E-{own}") for j in (_pushed(lines, k),)
                 if lines[j].startswith(f"G1 E{own}")]  # fmt: skip
        k = pick(pairs, rng)
        for row in (k, _pushed(lines, k)):
            lines[row] = lines[row].replace(own, other)

    return spoil


def _pushed(lines: Lines, pulled: int) -> int:
    """Return the next line that pushes filament alone."""
    return next((k for k in _rows(lines, PRIME) if k > pulled), pulled)


def pushes_exchanged(lines: Lines, rng: Rng) -> None:
    """Let one tool push half a millimetre less and the other more: together nothing is lost."""
    a, b = pick(_rows(lines, r"^G1 E0\.80"), rng), pick(_rows(lines, r"^G1 E2\.03"), rng)
    lines[a] = lines[a].replace("E0.80", "E0.30")
    lines[b] = lines[b].replace("E2.03", "E2.53")


def pull_behind_its_macro(lines: Lines, rng: Rng) -> None:
    """Pull behind the macro that should push back."""
    k = pick(_rows(lines, r"^CLEAN_NOZZLE"), rng)
    lines[k - 1], lines[k] = lines[k], lines[k - 1]


def by_firmware(lines: Lines, rng: Rng) -> None:
    """Leave one retraction to a firmware that may know none."""
    rows = [
        k for k in _rows(lines, r"^G1 E-0\.80") if lines[_pushed(lines, k)].startswith("G1 E0.80")
    ]
    k = pick(rows, rng)
    lines[_pushed(lines, k)], lines[k] = "G11", "G10"


TOOL_MUTANTS: tuple[Mutant[Lines], ...] = (  # of the made print with two tools
    Mutant("a tool's first push dropped", remove(r"^G1 E10\.")),
    Mutant("a tool retracts as far as the other", other_retraction("0.80000", "2.00000")),
    Mutant("a tool retracts as far as for a change", other_retraction("0.80000", "10.00000")),
    Mutant("a pull behind the macro that pays it", pull_behind_its_macro),
    Mutant("a push back before a macro that pays", change(r"^CLEAN", r"^", "G1 E1.50000\n")),
    Mutant("a push on the spot dropped", change(r"^G1 E0\.9", "E0.9", "E0.8")),
    Mutant("a push on the spot doubled", change(r"^G1 E0\.9", "E0.9", "E1.0")),
    Mutant("a restart distance dropped", change(r"^G1 E2\.03", "E2.03", "E2.00")),
    Mutant("pushes of two tools exchanged", pushes_exchanged),
    Mutant("a retraction left to the firmware", by_firmware),
)


def in_one(spoil: Callable[[Lines, Rng], None]) -> Callable[[Files, Rng], None]:
    """Return a mutant of one head's file, whichever it fits."""

    def spoil_files(files: Files, rng: Rng) -> None:
        for k in rng.permutation(len(files)).tolist():
            try:
                return spoil(files[k], rng)
            except NotHereError:
                continue
        raise NotHereError

    return spoil_files


def exchange_files(files: Files, rng: Rng) -> None:
    """Give each controller the other one's file."""
    files[0][:], files[1][:] = list(files[1]), list(files[0])


def same_file_twice(files: Files, rng: Rng) -> None:
    """Give both controllers one file."""
    files[1][:] = list(files[0])


def moved_earlier(pattern: re.Pattern[str]) -> Callable[[Lines, Rng], None]:
    """Return a mutant that moves a line to before the contour it stands behind."""

    def spoil(lines: Lines, rng: Rng) -> None:
        beads = _rows(lines, BEAD)
        k = pick([k for k in _rows(lines, pattern) if beads and beads[0] < k < beads[-1]], rng)
        line = lines.pop(k)
        lines.insert(max(j for j in beads if j < k), line)

    return spoil


def moved_later(pattern: re.Pattern[str]) -> Callable[[Lines, Rng], None]:
    """Return a mutant that moves a line to behind the next bead."""

    def spoil(lines: Lines, rng: Rng) -> None:
        beads = _rows(lines, BEAD)
        k = pick([k for k in _rows(lines, pattern) if beads and beads[0] < k < beads[-1]], rng)
        line = lines.pop(k)
        lines.insert(min(j for j in _rows(lines, BEAD) if j >= k) + 1, line)

    return spoil


def numbers_exchanged(pattern: re.Pattern[str]) -> Callable[[Lines, Rng], None]:
    """Return a mutant that exchanges two lines of a kind."""

    def spoil(lines: Lines, rng: Rng) -> None:
        rows, beads = _rows(lines, pattern), _rows(lines, BEAD)
        # behind the last bead all heads give two, and each waits for both
        k = pick([k for k in range(len(rows) - 1) if beads and rows[k] < beads[-1]], rng)
        if lines[rows[k]] == lines[rows[k + 1]]:
            raise NotHereError
        lines[rows[k]], lines[rows[k + 1]] = lines[rows[k + 1]], lines[rows[k]]

    return spoil


def without_its_stop(lines: Lines, rng: Rng) -> None:
    """Give a signal at rest in motion, without the M400 above it."""
    k = pick([k for k in _rows(lines, SIGNAL) if k and lines[k - 1] == "M400"], rng)
    lines[k - 1 : k + 1] = [lines[k].replace("SIGNAL", "PASSED")]


def contour_to_the_other(files: Files, rng: Rng) -> None:
    """Let one head print a contour of the other."""
    first, last = _contour(files[0], rng)
    moved = files[0][first:last]
    del files[0][first:last]
    at = _between(files[1], rng)
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
