"""Values of a row are taken by the types of its fields, and nothing is converted."""

from __future__ import annotations

import pytest

from agents.messages.kinds import Beat, Commit, MessageError, Stage
from agents.messages.rows import read_row
from agents.running.port import Alive

DIGEST = "ab" * 16


def test_a_row_gives_the_fields_in_their_order() -> None:
    """Of every type that messages and the port have."""
    row = [[0, 2], DIGEST, 2, 7, [0, 9]]
    assert read_row(Commit, row) == Commit((0, 2), DIGEST, Stage.AGREED, 7, (0, 9))
    assert read_row(Alive, [1.5, [1.0, 2.0, 3.0]]) == Alive(1.5, (1.0, 2.0, 3.0))


@pytest.mark.parametrize("row", [[True], ["3"], [3.0], [None], [], [3, 4], {"within": 3}, [0]])
def test_a_row_of_anything_else_is_refused(row: object) -> None:
    """True is no number of ticks, and a message's own limits hold too."""
    with pytest.raises(MessageError):
        read_row(Beat, row)


@pytest.mark.parametrize("at", [[1.0, 2.0], [1, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0], "abc"])
def test_a_place_is_three_numbers(at: object) -> None:
    """What a controller states is where its head counts as standing."""
    with pytest.raises(MessageError):
        read_row(Alive, [1.5, at])
