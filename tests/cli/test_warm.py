"""Compiling ahead must never disturb the program it runs beside."""

from __future__ import annotations

import pytest

from decmcts.cli.warm import compiling_ahead, main, smallest_job


@pytest.mark.slow
def test_smallest_job_is_planned_and_judged_without_fault() -> None:
    """The warm-up takes the same path as a real plan, so it must come to one."""
    main()


def test_smallest_job_needs_both_layers_in_order() -> None:
    """Four contours on two layers: enough to make every kernel run."""
    assert smallest_job().contours.layer.tolist() == [0, 0, 1, 1]


def test_child_ends_with_the_body() -> None:
    """A finished program leaves no process behind, even when its body fails."""
    with pytest.raises(ZeroDivisionError), compiling_ahead():
        raise ZeroDivisionError
