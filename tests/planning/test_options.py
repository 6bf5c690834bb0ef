"""What planning is asked is checked when it is made, not when it is used."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.options import (
    Freedom,
    Held,
    Objective,
    PlannerName,
    ProcessOrder,
    Rules,
    Seam,
    Search,
    TeamSearch,
)
from decmcts.search.planners import PLANNERS
from decmcts.search.sequence.incumbent import Incumbent


class Mine:
    """A planner that does nothing."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        return


@pytest.mark.parametrize(
    "made",
    [
        lambda: Search(-1.0),
        lambda: Search(float("nan")),
        lambda: Search(float("inf")),
        lambda: TeamSearch(float("inf")),
        lambda: Search(seed=-1),
        lambda: Search(max_iterations=-1),
        lambda: TeamSearch(-1.0),
        lambda: TeamSearch(seed=-1),
        lambda: Rules(min_layer_time_s=-1.0),
        lambda: Rules(max_layers_ahead=-1),
        lambda: Held(max_layers_ahead=-1),
        lambda: Held(min_layer_time_s=-1.0),
    ],
)
def test_a_limit_below_zero_is_refused(made) -> None:
    """Minutes later nobody knows where it came from."""
    with pytest.raises(InputError, match="must be at least 0"):
        made()


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: Search(objective="speed"), "objective is 'speed', must be one of travel, time"),
        (lambda: Search(planner="fast"), "planner is 'fast', must be one of slicer, "),
        (lambda: Search(planner=None), "planner is None, must be one of slicer, "),
        (lambda: Rules(freedom="some"), "freedom is 'some', must be one of fixed, "),
        (lambda: Rules(process_order=None), "process_order is None, must be one of keep, free"),
        (lambda: TeamSearch(objective="speed"), "objective is 'speed'"),
        (lambda: TeamSearch(parameters={"gama": 1.0}), "gama"),
        (lambda: Held(freedom="some"), "freedom is 'some'"),
    ],
)
def test_a_name_that_is_none_is_refused(made, said) -> None:
    """It used to be found when the search was over, as an internal error."""
    with pytest.raises(InputError, match=said):
        made()


def test_names_stand_for_what_they_name() -> None:
    """Who writes a script writes words."""
    assert Search(objective="time", planner="greedy") == Search(
        objective=Objective.TIME, planner=PlannerName.GREEDY
    )
    assert Search(planner="greedy").name == "greedy" and Search(objective="time").unit == "s"
    assert Rules(freedom="seam", seam="rear") == Rules(freedom=Freedom.SEAM, seam=Seam.REAR)
    assert Held(freedom="fixed").freedom is Freedom.FIXED


def test_a_seam_policy_needs_its_freedom() -> None:
    """It would mean nothing."""
    with pytest.raises(InputError, match="seam rear needs freedom seam"):
        Rules(seam=Seam.REAR)
    assert Rules(freedom=Freedom.SEAM, seam=Seam.REAR).seam == Seam.REAR


def test_options_do_not_change() -> None:
    """A result says what was asked; that must stay true."""
    with pytest.raises(FrozenInstanceError):
        Search().seed = 1  # type: ignore[misc]  # that is what is tested


def test_rules_that_are_left_open_are_the_machine_s() -> None:
    """The paper's model knows of no shells; a real machine's prints have some."""
    real, paper = load_machine("mk4s"), load_machine("paper")
    assert Rules().on(real).quality and not Rules().on(paper).quality
    stated = Rules(ProcessOrder.FREE, True, max_layers_ahead=2, freedom=Freedom.FIXED).on(paper)
    assert (stated.process_order, stated.quality) == ("free", True)
    assert (stated.max_layers_ahead, stated.freedom) == (2, "fixed")


def test_a_planner_has_a_name() -> None:
    """Files and summaries say who found an order."""
    assert Search().name == "hybrid"
    assert Search(planner=Mine()).name == "mine"
    assert {name.value for name in PlannerName} == set(PLANNERS)
