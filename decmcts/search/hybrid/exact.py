"""An exact solution, where layers have few contours; given up soon where it would take too long."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from decmcts.search.bounds.exact import WIDEST, Patience, solve_exactly
from decmcts.search.hybrid.search import Search


@dataclass(frozen=True, slots=True)
class Exact:
    """How long to try, in shares of the search."""

    probe: float = 0.15  # for finding out how long an exact solution would take
    share: float = 0.75  # the longest it may take; 0: no exact solutions

    def run(self, search: Search) -> Iterator[None]:
        """Solve the problem if it can be solved in time; then the search is over."""
        incumbent = search.incumbent
        if self.share > 0.0:
            patience, widest = Patience(lambda: incumbent.spent, self.probe, self.share), WIDEST
            if incumbent.stopping.iterations is not None:
                widest = min(widest, 1 + int(self.probe * incumbent.stopping.iterations))

            def go_on(made: int, share: float) -> bool:
                incumbent.tick(made)
                return not incumbent.over and patience.lasts(share)

            optimum = solve_exactly(incumbent.problem, go_on, widest=widest)
            if optimum is not None:
                incumbent.offer(optimum.order, optimum.reversed, optimum.entry_id)
                incumbent.prove(optimum.bound)
                incumbent.finish()
        incumbent.tick()
        yield
