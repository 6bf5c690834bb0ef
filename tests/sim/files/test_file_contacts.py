"""Contacts that the source makes on moves of its own: forgiven one by one, however many."""

from __future__ import annotations

import numpy as np

from sim.faults import FaultKind as K
from tests.sim.files.motions import File, verify_motions

MANY = 300  # more than the judge lists


def file_of(steps) -> File:
    """Return a file of steps (contour or -1, point); a step of a contour is a bead."""
    contour = np.array([owner for owner, _ in steps])
    printing = contour >= 0
    return File(
        np.array([[0.0, 0.0, 5.0], *(point for _, point in steps)], float),
        np.where(printing, 0.03, 0.0), np.where(printing, 30.0, 100.0),
        np.arange(1, len(steps) + 1), contour, 0.4 * printing, 0.2 * printing,
    )  # fmt: skip


def line_at(number: int, x: float) -> list:
    """Return steps that print a line along y from above and go up again."""
    start, end = (x, 10.0, 0.2), (x, 20.0, 0.2)
    return [(-1, (x, 10.0, 5.0)), (-1, start), (number, end), (-1, (x, 20.0, 5.0))]


def through(y: float, begin: float = 5.0, end: float = 25.0) -> list:
    """Return steps that drag the nozzle through what stands between two x."""
    return [(-1, (begin, y, 5.0)), (-1, (begin, y, 0.1)), (-1, (end, y, 0.1)), (-1, (end, y, 5.0))]


def kinds(make, ours, source):
    return verify_motions(file_of(ours), file_of(source), make.one_head_machine()).kinds()


def often(number: int) -> list:
    """Return drags through a line at x = 10, each elsewhere."""
    return [step for k in range(number) for step in through(11.0 + 8.0 * k / number, 5.0, 15.0)]


def test_what_the_source_does_is_a_warning(make):
    """The drag is the source's own; it is kept and said, once."""
    steps = [*line_at(0, 10.0), *often(MANY)]
    verdict = verify_motions(file_of(steps), file_of(steps), make.one_head_machine())
    assert verdict.ok
    assert "line 6: slice at 0 mm meets the bead of line 3" in verdict.warnings[0]
    assert "more like it, as in the source" in verdict.warnings[-1]


def test_a_contact_of_its_own_behind_many_of_the_source(make):
    """However many contacts are the source's, one more is found."""
    source = [*line_at(0, 10.0), *often(MANY), *line_at(1, 40.0)]
    ours = [*source, *through(15.0, 35.0, 45.0)]
    assert kinds(make, source, source) == set()
    assert kinds(make, ours, source) == {K.HEAD_MATERIAL}


def test_many_contacts_on_beads_leave_those_on_travels_to_the_source(make):
    """Beads that meet each other in the source used up what was looked at of its moves."""
    low = [
        step
        for k in range(MANY)
        for step in [
            (-1, (60.0, 10.0 + 0.02 * k, 5.0)), (-1, (60.0, 10.0 + 0.02 * k, 0.1)),
            (1 + k, (60.3, 10.0 + 0.02 * k, 0.1)), (-1, (60.3, 10.0 + 0.02 * k, 5.0)),
        ]
    ]  # fmt: skip
    source = [*line_at(0, 60.0), *low, *through(15.0, 55.0, 65.0)]
    ours = [*line_at(0, 60.0), *through(15.0, 55.0, 65.0), *low]
    verdict = verify_motions(file_of(ours), file_of(source), make.one_head_machine())
    assert not [fault for fault in verdict.faults if "near (60.00, 15.00, 0.10)" in fault.text]


def test_the_same_move_meets_what_was_not_there_in_the_source(make):
    """The source drags through one line, the file through another one too."""
    source = [*line_at(0, 10.0), *through(15.0), *line_at(1, 20.0)]
    lines = (line_at(0, 10.0), line_at(1, 20.0))
    assert kinds(make, source, source) == set()
    for one, other in (lines, lines[::-1]):
        assert kinds(make, [*one, *other, *through(15.0)], source) == {K.HEAD_MATERIAL}


def test_a_move_straight_down_ends_as_low(make):
    """Down onto a bead from another height is the source's move; deeper is not."""
    down = [(-1, (10.0, 15.0, 5.0)), (-1, (10.0, 15.0, 0.15)), (-1, (10.0, 15.0, 5.0))]
    higher = [(-1, (10.0, 15.0, 8.0)), (-1, (10.0, 15.0, 0.15)), (-1, (10.0, 15.0, 8.0))]
    deeper = [(-1, (10.0, 15.0, 5.0)), (-1, (10.0, 15.0, 0.05)), (-1, (10.0, 15.0, 5.0))]
    source = [*line_at(0, 10.0), *down]
    assert kinds(make, [*line_at(0, 10.0), *higher], source) == set()
    assert kinds(make, [*line_at(0, 10.0), *deeper], source) == {K.HEAD_MATERIAL}
