"""A user is told when the written file takes longer than its source, and why."""

from __future__ import annotations

import pytest

from decmcts.cli.lines import gain_table, plain_lines, whole_file_line
from decmcts.planning.writing.file_times import FileTimes, is_longer


@pytest.mark.parametrize(("after_s", "longer"), [(1000.0, False), (1036.0, False), (1109.0, True)])
def test_a_file_that_takes_longer_says_why(after_s: float, longer: bool) -> None:
    """Cura combs without retraction: an order with half the travel took a minute more."""
    line = whole_file_line(FileTimes(1035.0, after_s))
    assert (line is not None) == longer
    assert line is None or "print the source" in line


def test_retractions_are_counted_without_a_percentage() -> None:
    """Of 3 that became 9 a table once said −200 %, though both are next to none."""
    table = gain_table({"retractions": 3}, {"retractions": 9})
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells == ["retractions", "3", "9", ""]


@pytest.mark.parametrize(
    ("before_s", "after_s", "longer"),
    [(10.0, 10.2, False), (88.4, 89.3, True), (500.0, 500.4, False), (500.0, 500.6, True),
     (9000.0, 9000.9, False), (9000.0, 9001.1, True)],
)  # fmt: skip
def test_what_counts_as_longer(before_s, after_s, longer):
    """A short print is not given away for a whole second: 88 s became 89 s, and was written."""
    assert is_longer(before_s, after_s) is longer


WAS = {
    "contours": 12, "extrusionless_travel_mm": 900.4, "emitted_travel_mm": 1000.0,
    "print_time_s": 3700.0, "file_time_s": 3909.4, "retractions": 30,
}  # fmt: skip
NOW = {**WAS, "extrusionless_travel_mm": 450.2, "emitted_travel_mm": 520.0, "file_time_s": 3600.0}


def shown(*, verbose: bool) -> list[list[str]]:
    """Return the rows of a table of results."""
    table = gain_table(WAS, NOW, verbose=verbose)
    return [list(row) for row in zip(*(column.cells for column in table.columns), strict=True)]


def test_a_table_has_each_figure_once_in_the_makers_words() -> None:
    """One print time, the whole file's, in h:min:s; the paper's figures are for who asks."""
    rows = shown(verbose=False)
    assert rows == [
        ["print time", "1:05:09", "1:00:00", "−7.9 %"],
        ["travel", "1,000 mm", "520 mm", "−48.0 %"],
        ["retractions", "30", "30", ""],
    ]
    more = shown(verbose=True)
    assert more[:3] == rows
    assert [row[0] for row in more[3:]] == [
        "contours", "travel between contours", "print time, first to last bead"
    ]  # fmt: skip


def test_the_time_of_a_plan_is_shown_where_no_file_was_written() -> None:
    """It is the only one there is."""
    was, now = ({k: v for k, v in one.items() if k != "file_time_s"} for one in (WAS, NOW))
    (column,) = [list(gain_table(was, now).columns[1].cells)]
    assert column == ["1:01:40", "1,000 mm", "30"]


def test_a_log_has_the_same_figures_as_lines() -> None:
    """A slicer's window has neither columns nor a wide font; what is compared with is named."""
    assert plain_lines(WAS, NOW) == [
        "print time: 1:05:09 → 1:00:00 (−7.9 %)",
        "travel: 1,000 mm → 520 mm (−48.0 %)",
        "retractions: 30 → 30",
    ]
    assert (
        plain_lines({**WAS, "made_safe": True}, NOW)[2] == "retractions: 30 (layer by layer) → 30"
    )
