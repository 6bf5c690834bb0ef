"""What a file lays against the contours of its source, all beads at once: against a slow oracle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.gcode.controller.motion import Motion, interpret
from decmcts.formats.gcode.text.lines import split_lines
from decmcts.print.contours import Contours
from sim.heads.file import E_MM, FEED_MM_S, SAME_MM, pairs_of_states

START = "G28\nG90\nM83\nM106 S9\nG1 X0 Y0 Z.2 F6000\n"
LINE = "G1 X{x} Y0 F6000\nG1 X{x} Y9 E.3 F1800\nM106 S{x}\nG1 X{x} Y20 E.4\nG1 X{r} Y20 E.5 F900\n"
BACK = "G1 X{r} Y20 F6000\nM106 S{x}\nG1 X{x} E.5 F900\nG1 Y9 E.4 F1800\nM106 S7\nG1 Y0 E.3\n"
SOURCE = START + "".join(LINE.format(x=x, r=x + 5) for x in (30, 60, 90))
FILE = START + LINE.format(x=60, r=65) + BACK.format(x=90, r=95) + LINE.format(x=30, r=35)
BEADS = [(1, False, 3), (2, True, 7), (0, False, 11)]  # contour, reversed, first move
Laid = tuple[Contours, GcodeDocument, Motion, list[int]]


@pytest.fixture(scope="module")
def laid(tmp_path_factory: pytest.TempPathFactory) -> Laid:
    """Return a source, and a file that prints it in another order, one contour reversed."""
    path: Path = tmp_path_factory.mktemp("laid") / "in.gcode"
    path.write_text(SOURCE)
    job, document = read_gcode(path)
    motion = interpret(split_lines(FILE.encode(), path))
    assert len(job.contours) == 3 and len(motion.line) == 14
    return job.contours, document, motion, list(range(len(motion.line)))


def slow(
    beads: list[tuple[int, bool, int]], motion: Motion, state: list[int], contours: Contours,
    document: GcodeDocument,
) -> list[tuple[int, int]] | None:  # fmt: skip
    """Return the same, bead by bead and point by point."""
    pairs = set()
    for contour, is_reversed, first in beads:
        rows = list(range(contours.offsets[contour], contours.offsets[contour + 1]))
        ends = rows[1:]
        if is_reversed:
            rows, ends = rows[::-1], ends[::-1]
        for k, end in enumerate(ends):
            move = first + k
            there = contours.points[rows[k + 1]]
            if (
                np.abs(motion.points[move + 1] - there).max() > SAME_MM
                or abs(motion.extrusion[move] - contours.extrusion[end]) > E_MM
                or abs(motion.feed[move] - contours.feed[end]) > FEED_MM_S
            ):
                return None
            pairs.add((state[move], int(document.point_state[end])))
    return sorted(pairs)


def test_states_that_go_together_are_those_of_the_oracle(laid: Laid) -> None:
    """Of each bead the file's and the source's, whichever way it is printed."""
    contours, document, motion, state = laid
    found = pairs_of_states(BEADS, motion, state, contours, document)
    assert found == slow(BEADS, motion, state, contours, document)
    assert found is not None and len(found) == 9
    assert pairs_of_states([], motion, state, contours, document) == []


def moved(name: str, move: int, by: float, axis: int | None = None) -> Callable[[Motion], Motion]:
    """Return what changes one figure of one move."""

    def spoil(motion: Motion) -> Motion:
        values = np.array(getattr(motion, name))
        values[move if axis is None else (move + 1, axis)] += by  # a bead ends behind its move
        return replace(motion, **{name: values})

    return spoil


SPOILT = {
    f"{name} of move {move} by {by}": (moved(name, move, by, axis), abs(by) > least)
    for move in (3, 5, 7, 9, 13)
    for name, least, axis in (
        ("points", SAME_MM, 0), ("points", SAME_MM, 2), ("extrusion", E_MM, None),
        ("feed", FEED_MM_S, None),
    )
    for by in (2.0 * least, -2.0 * least, 0.4 * least)
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILT)
def test_one_figure_that_differs_is_seen(laid: Laid, name: str) -> None:
    """What is within what files round off is the same."""
    contours, document, motion, state = laid
    spoil, differs = SPOILT[name]
    spoilt = spoil(motion)
    found = pairs_of_states(BEADS, spoilt, state, contours, document)
    assert found == slow(BEADS, spoilt, state, contours, document)
    assert (found is None) == differs


@pytest.mark.parametrize(
    "beads",
    [
        [(0, False, 3)],
        [(1, True, 3)],
        [(2, False, 7)],
        [(2, True, 8)],
        [*BEADS[:2], (0, False, 10)],
    ],
)
def test_other_beads_than_were_laid_are_seen(laid: Laid, beads) -> None:
    """Another contour, another direction, or from another move on."""
    contours, document, motion, state = laid
    assert pairs_of_states(beads, motion, state, contours, document) is None
