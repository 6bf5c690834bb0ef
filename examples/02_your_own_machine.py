"""Plan for a head that you measured yourself.

    python examples/02_your_own_machine.py

How much can be gained depends on the head: the slimmer it is, the more often it may print a
part higher than its neighbours. docs/measure-your-head.md says how to measure yours.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import decmcts

MEASURED = Path(__file__).parent / "measured.toml"


def travel_mm(machine: decmcts.Machine, *, iterations: int = 200_000) -> float:
    """Return the travel of the order found for a machine; equal seeds give equal orders."""
    source = decmcts.read(decmcts.sample_path("four_nuts.gcode.gz"), machine)
    search = decmcts.Search(
        60.0, planner=decmcts.PlannerName.LOCAL, max_iterations=iterations, certificate=False
    )
    return decmcts.plan(source, search, writes=False).after.travel_mm


def main(iterations: int = 200_000) -> dict[str, float]:
    """Compare a measured head, the same with more room around it, and a preset."""
    measured = decmcts.load_machine(str(MEASURED))
    machines = {
        "as measured": measured,
        "5 mm more room": replace(measured, clearance_mm=measured.clearance_mm + 5.0),
        "preset mk4s": decmcts.load_machine("mk4s"),
    }
    found = {name: travel_mm(each, iterations=iterations) for name, each in machines.items()}
    for name, travel in found.items():
        print(f"{name}: {travel:.0f} mm of travel")
    return found


if __name__ == "__main__":
    main()
