"""A user is told when the written file takes longer than its source, and why."""

from __future__ import annotations

import pytest

from decmcts.cli.console import gain_table
from decmcts.cli.lines import file_time_line
from decmcts.planning.writing.file_times import is_longer


@pytest.mark.parametrize(("after_s", "longer"), [(1000.0, False), (1036.0, False), (1109.0, True)])
def test_a_file_that_takes_longer_says_why(after_s: float, longer: bool) -> None:
    """Cura combs without retraction: an order with half the travel took a minute more."""
    line = file_time_line(1035.0, after_s, 5.0)
    assert line.startswith("print time of the whole file: 17 min 15 s → ")
    assert ("every travel from 5 mm up is retracted" in line) == longer
    assert ("print the source" in line) == longer


def test_a_print_that_combs_is_not_said_to_retract_inside_the_part() -> None:
    """Half of its travels from 5 mm up are bare: "every travel" would be false."""
    line = file_time_line(1035.0, 1109.0, 5.0, combs=True)
    assert "every travel that leaves the part from 5 mm up is retracted" in line


def test_retractions_are_counted_without_a_percentage() -> None:
    """Of 3 that became 9 a table once said −200 %, though both are next to none."""
    table = gain_table({"retractions": 3}, {"retractions": 9})
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells == ["retractions", "3 ", "9 ", ""]


def test_a_print_without_retraction_is_not_said_to_retract() -> None:
    """What the line gives as a reason must be true of the print."""
    line = file_time_line(1035.0, 1109.0, None)
    assert "retracted" not in line
    assert "print the source" in line


@pytest.mark.parametrize(
    ("before_s", "after_s", "longer"),
    [(10.0, 10.2, False), (88.4, 89.3, True), (500.0, 500.4, False), (500.0, 500.6, True),
     (9000.0, 9000.9, False), (9000.0, 9001.1, True)],
)  # fmt: skip
def test_what_counts_as_longer(before_s, after_s, longer):
    """A short print is not given away for a whole second: 88 s became 89 s, and was written."""
    assert is_longer(before_s, after_s) is longer
