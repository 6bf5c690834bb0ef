"""Old orders carried out by those that are left, and what is planned anew."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import online
from online import Old, retimed

from decmcts.team.dec_mcts.warm_up import smallest_problem
from decmcts.team.engine.plans import StatedOrder

TEAM = smallest_problem()  # contours 0 and 2 lie left, 1 and 3 right; 2 on 0, 3 on 1
N = len(TEAM.macro)
LEFT_FIRST = StatedOrder(
    np.array([0, 1, 2, 3], np.int32), np.zeros(4, np.bool_), np.array([0, 1, 0, 1])
)


def test_an_old_order_is_kept_where_all_heads_live() -> None:
    """Only times change, so who prints what and in which order must not."""
    order, resolved = retimed(TEAM, Old(LEFT_FIRST, np.arange(N), np.array([0, 1])))
    assert order.order.tolist() == LEFT_FIRST.order.tolist()
    assert order.head.tolist() == LEFT_FIRST.head.tolist()
    assert [path.order.tolist() for path in resolved.toolpaths] == [[0, 2], [1, 3]]


def test_what_a_head_leaves_is_printed_by_another() -> None:
    """All of it, once, and what must come before comes before."""
    order, resolved = retimed(TEAM, Old(LEFT_FIRST, np.arange(N), np.array([-1, 1])))
    assert set(order.head.tolist()) <= {0, 1}
    turn = np.argsort(order.order)
    assert sorted(order.order.tolist()) == list(range(N))
    assert turn[0] < turn[2] and turn[1] < turn[3]
    assert sum(len(path) for path in resolved.toolpaths) == N


def test_what_must_come_before_comes_before() -> None:
    """The rest of a print may demand what the whole did not."""
    upside_down = StatedOrder(LEFT_FIRST.order[::-1].copy(), LEFT_FIRST.reversed, LEFT_FIRST.head)
    order, _ = retimed(TEAM, Old(upside_down, np.arange(N), np.array([0, 1])))
    assert order.order.tolist() == [1, 3, 0, 2]


@pytest.mark.long
def test_what_a_change_leaves_is_planned_anew_in_all_ways_from_one_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of it is printed in each way; where a head is late its old plan may also just go on."""
    monkeypatch.setattr(online, "MADE", (("row-4-20-20", 2), ("row-6-20-20", 3)))
    monkeypatch.setattr(online, "MOMENTS", (0.5,))
    monkeypatch.setattr("sys.argv", ["online", "--time-limit", "0.1", "--results", str(tmp_path)])
    online.main()
    rows = list(csv.DictReader((tmp_path / "online.csv").read_text().splitlines()))
    assert (tmp_path / "online.png").stat().st_size > 0
    for row in rows:
        assert not row["error"] and row["left_out"] == "0"
        assert 0 < int(row["left"]) < int(row["contours"])
        least = min(float(row[f"{way}_s"]) for way in online.WAYS)
        assert max(float(row["bound_s"]), float(row["planned_s"])) < least == float(row["best_s"])
        late = row["event"] != "fenced"
        assert (float(row["going_on_s"]) > float(row["planned_s"])) is late
