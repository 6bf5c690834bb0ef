"""InputError is the one line a user sees."""

from decmcts.errors import InputError


def test_line_names_file_line_what_and_advice() -> None:
    """All four parts must be there, in one line."""
    error = InputError("X is nan", path="a.gcode", line=7, advice="slice it again")
    assert str(error) == "a.gcode:7: X is nan; slice it again"


def test_line_breaks_are_folded() -> None:
    """A library's multi-line message must not become several lines."""
    assert "\n" not in str(InputError("a\n  b", path="f"))
