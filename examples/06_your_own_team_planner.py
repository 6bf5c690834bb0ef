"""Let a planner of your own plan for two heads, and compare it with one head.

    python examples/06_your_own_team_planner.py

A planner for several heads is an object with one method, `plan`. It offers joint orders to an
incumbent: which contour, by which head, in one order of all. Heads that are in each other's way
keep that order. The incumbent says when the slowest head is done, and keeps the best. What the
search ends with is made exact and judged, so that it is safe whatever the planner does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import decmcts


@dataclass(frozen=True, slots=True)
class Borders:
    """Cut the bed in two by a line, a head on each side; of all lines tried the best is kept."""

    lines: int = 20

    def plan(self, incumbent: decmcts.TeamIncumbent, *, seed: int) -> None:
        """Offer one joint order for each line until the search is over."""
        problem = incumbent.problem
        contours, may = problem.job.contours, problem.space.eligible
        order, x = np.arange(len(contours), dtype=np.int32), contours.start[:, 0]
        lines = np.linspace(x.min(), x.max(), self.lines)
        for line in np.random.default_rng(seed).permutation(lines):
            head = (x >= line).astype(np.int32)
            head ^= ~may[order, head]  # what it cannot reach, the other can
            incumbent.offer_order(order, head)
            if incumbent.over:
                break


def main(time_limit_s: float = 10.0) -> decmcts.Result:
    """Plan the plate by borders, and say what it gains."""
    source = decmcts.read(decmcts.sample_path("plate.gcode.gz"), "dual-gantry")
    search = decmcts.TeamSearch(time_limit_s, cut=decmcts.Cut.NONE, planner=Borders())
    result = decmcts.launch(source, search, writes=False)
    one_s, two_s = result.before.print_time_s, result.after.print_time_s
    print(f"one head: {one_s:.0f} s; two heads by {search.name}: {two_s:.0f} s")
    return result


if __name__ == "__main__":
    main()
