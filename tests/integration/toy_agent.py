"""An agent process over the toy problem: real zenoh, real pipes, no print needed."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from agents.extruder import main
from decmcts.leaving import leave
from tests.agents.toy import ToyPlanner


def get_stuck(*_: object) -> None:
    """What plans does nothing any more from here on; the network's threads go on."""
    time.sleep(3600.0)


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, get_stuck)
    names = os.environ["TOY_HEADS"].split(",")
    odd = os.environ.get("TOY_ODD_HEAD", "")  # this head holds another problem
    leave(
        main(
            make_planner=lambda given: ToyPlanner(
                given.head,
                names=names,
                jobs=41 if str(given.head) == odd else 40,
                seed=given.seed,
            ),
            load=lambda: None,
        )
    )
