"""Print one plate with two heads, each planned by a process of its own.

    python examples/04_two_heads.py [FOLDER]

The processes search together and agree on one plan. One file a head is written; where a head
must wait for the other, the files say so. Ctrl-C keeps the best plan so far.
"""

from __future__ import annotations

import sys
from pathlib import Path

import decmcts


class Watch:
    """Remember the best makespan that the heads have reported."""

    def __init__(self) -> None:
        self.best_s = float("inf")

    def __call__(self, event: decmcts.Event) -> None:
        """Take in one event."""
        if isinstance(event, decmcts.Heads):
            self.best_s = min([self.best_s, *(a.best_makespan_s for a in event.agents)])


def main(folder: Path, *, time_limit_s: float = 10.0) -> decmcts.Written:
    """Plan the plate for two heads and write a file for each."""
    source = decmcts.read(decmcts.sample_path("plate.gcode.gz"), "dual-gantry")
    watch = Watch()
    search = decmcts.TeamSearch(time_limit_s=time_limit_s)
    result = decmcts.launch(source, search, report=watch)
    print(f"one head: {result.before.print_time_s:.0f} s")
    print(f"two heads: {result.after.print_time_s:.0f} s; none can do it in {result.bound_s:.0f} s")
    written = result.write_gcode(folder / "plate")
    result.write_picture(folder / "plate.png")
    print("wrote", *(path.name for path in written.paths))
    return written


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path())
