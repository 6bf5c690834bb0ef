"""Let a planner of your own search, and compare it with ours.

    python examples/05_your_own_planner.py

A planner is an object with one method, `plan`. It offers orders to an incumbent, which takes
only those that keep every rule, and asks it whether to go on. So it can be as simple as this
one, and what it finds is safe all the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import decmcts


@dataclass(frozen=True, slots=True)
class TopologicalWalks:
    """Nearest of a few ready contours, drawn at random: greedy walks, the best one kept."""

    drawn: int = 8

    def plan(self, incumbent: decmcts.Incumbent, *, seed: int) -> None:
        """Offer one order after the other until the search is over."""
        rng = np.random.default_rng(seed)
        while not incumbent.over:
            incumbent.offer_order(self.walk(incumbent, rng))
            incumbent.tick(1)

    def walk(
        self, incumbent: decmcts.Incumbent, rng: np.random.Generator
    ) -> np.ndarray[tuple[int], np.dtype[np.int32]]:
        """Return an order of all contours in which each comes after those it waits for."""
        problem, graph = incumbent.problem, incumbent.problem.graph
        waits = np.zeros(len(problem), np.int32)
        np.add.at(waits, graph.succs, 1)
        ready, order = np.flatnonzero(waits == 0).tolist(), []
        at = problem.start[ready[0]]
        while ready:
            picks = rng.integers(len(ready), size=min(self.drawn, len(ready)))
            ways = [np.linalg.norm(problem.start[ready[k]] - at) for k in picks]
            chosen = ready.pop(int(picks[int(np.argmin(ways))]))
            order.append(chosen)
            at = problem.end[chosen]
            after = graph.succs[graph.succ_offsets[chosen] : graph.succ_offsets[chosen + 1]]
            waits[after] -= 1
            ready.extend(after[waits[after] == 0].tolist())
        return np.array(order, np.int32)


def main(time_limit_s: float = 5.0) -> dict[str, float]:
    """Return the travel of the slicer's order, of our own planner's and of `hybrid`'s."""
    source = decmcts.read(decmcts.sample_path("four_nuts.gcode.gz"), "paper")
    planners: dict[str, decmcts.PlannerName | decmcts.Planner] = {
        "walks": TopologicalWalks(),
        "greedy": decmcts.PlannerName.GREEDY,
        "hybrid": decmcts.PlannerName.HYBRID,
    }
    found: dict[str, float] = {}
    for name, planner in planners.items():
        search = decmcts.Search(time_limit_s, planner=planner, certificate=False)
        result = decmcts.plan(source, search, writes=False)
        found |= {"as sliced": result.before.travel_mm, name: result.after.travel_mm}
    for name, travel in found.items():
        print(f"{name}: {travel:.0f} mm")
    return found


if __name__ == "__main__":
    main()
