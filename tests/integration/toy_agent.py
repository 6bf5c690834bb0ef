"""An agent process over the toy problem: real zenoh, real pipes, no print needed."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from agents.extruder import main
from tests.agents.toy import ToyPlanner


class Sticky(ToyPlanner):
    """Does not return from the round after SIGUSR1; the network's threads go on."""

    stuck = False

    def iterate(self, live: Sequence[int], spent: float) -> None:
        if self.stuck:
            time.sleep(3600.0)
        super().iterate(live, spent)


def get_stuck(*_: object) -> None:
    Sticky.stuck = True


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, get_stuck)
    names = os.environ["TOY_HEADS"].split(",")
    odd = os.environ.get("TOY_ODD_HEAD", "")  # this head holds another problem
    sys.exit(
        main(
            make_planner=lambda given: Sticky(
                given.head,
                names=names,
                jobs=41 if str(given.head) == odd else 40,
                seed=given.seed,
            )
        )
    )
