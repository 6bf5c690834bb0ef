"""What can be set about the search: limits that are said, parts that can be left out."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.team.dec_mcts import planner as dec_mcts
from decmcts.team.dec_mcts.parameters import RANGES, Parameters, changed
from decmcts.team.dec_mcts.planner import DecMcts
from decmcts.team.engine.plans import decode
from decmcts.team.engine.problem import TeamProblem, build_team_problem

PAGE = Path(__file__).parents[3] / "docs" / "team.md"
FEW = Parameters(share=0.1, samples=4, renew=1, windows=4, tries=8)


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    chosen = case(2, towers=4, reach=5.0)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph)


def team_after(problem: TeamProblem, rounds: int, **values: Any) -> list[DecMcts]:
    """Return two heads that planned in turn and told each other their plans."""
    parameters = changed(FEW, values)
    team = [DecMcts(problem, r, seed=3, parameters=parameters) for r in range(2)]
    for _ in range(rounds):
        for agent in team:
            agent.iterate([0, 1])
            team[1 - agent.head].take(agent.head, agent.distribution)
            team[1 - agent.head].take_joint(agent.best([0, 1]).plans, [0, 1])
    return team


def test_what_is_set_is_set_and_nothing_else() -> None:
    """The rest is as the print asks for; whole numbers may stand for others."""
    usual = Parameters.for_contours(500)
    made = changed(usual, {"gamma": 1, "windows": 7})
    assert asdict(made) == {**asdict(usual), "gamma": 1.0, "windows": 7}
    assert changed(usual, {}) == usual


def test_every_parameter_has_a_range_that_holds_its_default() -> None:
    """A file that states the defaults must be accepted."""
    values = asdict(Parameters())
    assert set(values) == set(RANGES)
    assert changed(Parameters(samples=1), values) == Parameters()


def test_the_page_states_ranges_and_defaults_and_its_example_is_allowed() -> None:
    """What users read must be what is held."""
    text = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| ([^|]+) \| (\S+)\.\.(\d+)", text, re.MULTILINE)
    assert {key: (float(least), float(most)) for key, _, least, most in rows} == RANGES
    usual = asdict(Parameters())
    for key, default, _, _ in rows:
        if not re.match(r"[\d.]+ to ", default):  # by the print
            assert float(default.split()[0]) == pytest.approx(usual[key], abs=1e-4), key
    example = re.search(r"```toml\n(.+?)```", text, re.DOTALL)
    assert example is not None
    assert changed(Parameters(), tomllib.loads(example[1])).windows == 30


@pytest.mark.parametrize("key", RANGES)
def test_limits_are_allowed_and_beyond_them_is_refused(key: str) -> None:
    """The line names the key, the value and the limits."""
    least, most = RANGES[key]
    hot = {} if key in ("beta", "coldest") else {"beta": 100.0}
    for value in (least, most):
        others = {"beta": 100.0} if key == "coldest" else {**hot, "coldest": 0.001}
        assert getattr(changed(Parameters(), {**others, key: value}), key) == value
    for value in (least - 1, most + 1):
        with pytest.raises(InputError) as error:
            changed(Parameters(), {key: value}, path="team.toml")
        assert str(error.value).startswith(f"team.toml: {key}: expected ")
        assert f"{least:g}..{most:g}, found {value!r}" in str(error.value)


@pytest.mark.parametrize("value", [True, "1", None, [1], float("nan"), float("inf"), 10**400])
@pytest.mark.parametrize("key", ["beta", "samples"])
def test_what_is_no_number_is_refused(key: str, value: Any) -> None:
    """TOML has booleans, texts, infinities and integers beyond any float."""
    with pytest.raises(InputError, match=f"{key}: expected a"):
        changed(Parameters(), {key: value})


def test_counts_are_whole() -> None:
    """Half an update is a typing error."""
    with pytest.raises(InputError, match=r"samples: expected a whole number in 1\.\.1000"):
        changed(Parameters(), {"samples": 2.0})


def test_an_unknown_name_is_refused() -> None:
    """A misspelt name that changes nothing would spoil an experiment."""
    with pytest.raises(InputError, match="tau: unknown key; known here: gamma, exploration"):
        changed(Parameters(), {"tau": 3})
    with pytest.raises(InputError, match="expected a table"):
        changed(Parameters(), [("gamma", 1)])  # type: ignore[arg-type]  # as a pack may hold


@pytest.mark.parametrize("values", [{"coldest": 2.0}, {"beta": 0.01}])
def test_the_search_does_not_heat(values: dict[str, float]) -> None:
    """The temperature falls from beta to coldest."""
    with pytest.raises(InputError, match=r"coldest .* is above beta"):
        changed(Parameters(), values)


@pytest.mark.slow
def test_without_a_share_there_is_no_tree(problem: TeamProblem) -> None:
    """What policies and polishing alone reach."""
    for agent in team_after(problem, 3, share=0):
        assert not agent._tree.root.children and len(agent.distribution.sequences) == 1
        assert agent._polishing is not None and agent.best([0, 1]).makespan_s < np.inf
    assert team_after(problem, 3)[0]._tree.root.children


@pytest.mark.slow
def test_without_windows_no_joint_order_is_stated(
    problem: TeamProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the plans of macro-actions alone reach."""
    monkeypatch.setattr(dec_mcts, "UNPOLISHED", 15_000)

    def states(agent: DecMcts) -> bool:
        plans = agent.best([0, 1]).plans.values()
        n = len(problem.macro)
        return any(decode(plan, problem.n_macros, n).stated is not None for plan in plans)

    assert not any(states(agent) for agent in team_after(problem, 3, windows=0))
    assert any(states(agent) for agent in team_after(problem, 3))


@pytest.mark.slow
def test_with_no_step_the_distribution_stays_even(problem: TeamProblem) -> None:
    """The other heads are told plans, but not which is the likeliest."""
    frozen = [a.distribution for a in team_after(problem, 8, alpha=0.0)]
    moving = [a.distribution for a in team_after(problem, 8)]
    assert all(len(told.sequences) > 1 for told in frozen)
    assert [told.entropy for told in frozen] == pytest.approx([1.0, 1.0])
    assert all(told.entropy < 1.0 - 1e-6 for told in moving)
