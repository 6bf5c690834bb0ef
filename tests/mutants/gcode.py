"""Mutants of a G-code file of one head, as the list of its lines."""

from __future__ import annotations

import re
from itertools import pairwise

from decmcts.formats.gcode.dialects.dialect import WAIT_MARK
from tests.mutants.catalogue import Mutant, NotHereError, pick
from tests.mutants.gcode_lines import (
    ARC,
    BEAD,
    PRIME,
    RETRACT,
    TRAVEL,
    Lines,
    Rng,
    Spoil,
    change,
    insert,
    remove,
    rows_of,
    some_bead,
    some_contour,
    within,
)  # fmt: skip


def bead_twice(lines: Lines, rng: Rng) -> None:
    """Print one bead twice."""
    at = some_bead(lines, rng)
    lines.insert(at, lines[at])


def contour_twice(lines: Lines, rng: Rng) -> None:
    """Print one whole contour twice."""
    first, last = some_contour(lines, rng)
    lines[last:last] = lines[first:last]


def contour_dropped(lines: Lines, rng: Rng) -> None:
    """Leave one contour out."""
    first, last = some_contour(lines, rng)
    del lines[first:last]


def beads_exchanged(lines: Lines, rng: Rng) -> None:
    """Exchange two lines of one contour, so that other beads are laid."""
    beads = rows_of(lines, BEAD)
    k = pick([k for k in beads if k + 1 in beads], rng)
    lines[k], lines[k + 1] = lines[k + 1], lines[k]


def arc_turned(lines: Lines, rng: Rng) -> None:
    """Run one arc the other way round its centre."""
    k = pick(rows_of(lines, ARC), rng)
    lines[k] = lines[k].replace("G2", "G?").replace("G3", "G2").replace("G?", "G3")


def arc_straight(lines: Lines, rng: Rng) -> None:
    """Go straight to the end of one arc."""
    k = pick(rows_of(lines, ARC), rng)
    lines[k] = re.sub(r" [IJ]\S+", "", "G1" + lines[k][2:])


def layers_exchanged(lines: Lines, rng: Rng) -> None:
    """Exchange what is printed at one height and at the next."""
    z = [re.sub(r"^(G1 Z)0\.400", r"\1@", line) for line in lines]
    if not any("@" in line for line in z):
        raise NotHereError
    z = [re.sub(r"^(G1 Z)0\.600", r"\g<1>0.400", line) for line in z]
    lines[:] = [line.replace("G1 Z@", "G1 Z0.600") for line in z]


def cut_off(share: float) -> Spoil:
    """Return a mutant that ends the file early."""

    def spoil(lines: Lines, rng: Rng) -> None:
        del lines[int(share * len(lines)) :]

    return spoil


def travel_down(lines: Lines, rng: Rng) -> None:
    """Let a travel go down into the print first."""
    rows = rows_of(lines, TRAVEL)
    at = rows[-1]
    lines.insert(at, "G1 Z0.100")


def retracted_late(lines: Lines, rng: Rng) -> None:
    """Retract behind the travel; filament is right."""
    beads, travels = rows_of(lines, BEAD), rows_of(lines, TRAVEL)
    at = pick([k for k in rows_of(lines, RETRACT) if k + 1 in travels and k > beads[0]], rng)
    lines[at], lines[at + 1] = lines[at + 1], lines[at]


def primed_early(lines: Lines, rng: Rng) -> None:
    """Prime before the travel; filament is right."""
    beads, travels = rows_of(lines, BEAD), rows_of(lines, TRAVEL)
    above = {k: t for t in travels for k in range(t + 1, t + 5)}  # the last travel near
    k = pick([k for k in rows_of(lines, PRIME) if k > beads[0] and k in above], rng)
    lines.insert(above[k], lines.pop(k))


def never_retracted(lines: Lines, rng: Rng) -> None:
    """Neither retract nor prime between two contours; filament is right."""
    beads = rows_of(lines, BEAD)
    at = pick([k for k in rows_of(lines, RETRACT) if beads[0] < k < beads[-1]], rng)
    prime = next(k for k in rows_of(lines, PRIME) if k > at)
    del lines[prime], lines[at]


def no_feed(lines: Lines, rng: Rng) -> None:
    """Let a travel have no speed."""
    k = pick(rows_of(lines, TRAVEL), rng)
    lines[k] = re.sub(r" F\S+", "", lines[k]) + " F0"


def own_dwell_within(lines: Lines, rng: Rng) -> None:
    """Let the head wait for cooling between two beads of one contour."""
    beads = rows_of(lines, BEAD)
    at = pick([b for a, b in pairwise(beads) if b == a + 1], rng)
    lines.insert(at, f"G4 P600000 {WAIT_MARK}")


def with_carriage_returns(lines: Lines, rng: Rng) -> None:
    """End lines as on Windows."""
    lines[:] = [line + "\r" for line in lines]


def with_comments(lines: Lines, rng: Rng) -> None:
    """Put a comment behind a bead."""
    k = some_bead(lines, rng)
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
    Mutant("a retraction behind its travel", retracted_late),
    Mutant("priming before its travel", primed_early),
    Mutant("neither retraction nor priming", never_retracted),
    Mutant("more priming", change(PRIME, r"E0\.8", "E1.8")),
    Mutant("a retraction a hundred times as fast", change(RETRACT, r" F\d+", " F210000")),
    Mutant("a retraction that takes a minute", change(RETRACT, r" F\d+", " F1")),
    Mutant("a travel that takes hours", change(TRAVEL, r"( F\d+)?$", " F1")),
    Mutant("a travel ten times as fast", change(TRAVEL, r" F\d+", " F90000")),
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
    Mutant("a word twice in a bead", change(BEAD, r"X", "X5 X")),
    Mutant("a word twice in a travel", change(TRAVEL, r"Y", "Y5 Y")),
    Mutant("a dwell within a contour, said to be our own", own_dwell_within),
    Mutant("a line number", change(BEAD, "^", "N7 ")),
    Mutant("a move behind a lone carriage return", within("; a comment\rG1 X50 Y50 E5")),
    Mutant("a travel behind a vertical tab", insert("\x0bG1 X50 Y50 Z0.1")),
    Mutant("a reset of filament behind a form feed", insert("\x0cG92 E0")),
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
