"""An agent process over the toy problem: real zenoh, real pipes, no print needed."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from agents.extruder import main
from tests.agents.toy import ToyPlanner


class Stuck(ToyPlanner):
    """Does not return from its 50th round; the network's threads go on."""

    def iterate(self, live: Sequence[int]) -> None:
        self.rounds = getattr(self, "rounds", 0) + 1
        if self.rounds == 50:
            time.sleep(3600.0)
        super().iterate(live)


if __name__ == "__main__":
    names = os.environ["TOY_HEADS"].split(",")
    stuck = os.environ.get("TOY_STUCK_HEAD", "")
    odd = os.environ.get("TOY_ODD_HEAD", "")  # this head holds another problem
    sys.exit(
        main(
            make_planner=lambda given: (Stuck if str(given.head) == stuck else ToyPlanner)(
                given.head,
                names=names,
                jobs=41 if str(given.head) == odd else 40,
                seed=given.seed,
            )
        )
    )
