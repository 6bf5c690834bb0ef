"""Prove how near to the best an order is, and have the finished file judged again.

    python examples/03_prove_how_near.py

A bound says what no order can beat. The judge shares no algorithm with the planners, so what
it passes does not depend on their being right.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import decmcts

NUTS = decmcts.sample_path("four_nuts.gcode.gz")


def main(time_limit_s: float = 10.0) -> tuple[decmcts.Certificate, decmcts.Verdict]:
    """Plan, prove, write, judge; and show that the judge sees a line that was left out."""
    source = decmcts.read(NUTS, "mk4s")
    search = decmcts.Search(time_limit_s=time_limit_s, certificate=False)
    result = decmcts.plan(source, search)
    proven = decmcts.bound(result, time_limit_s=time_limit_s)
    if proven.bound is not None:
        print(f"travel {proven.travel:.0f} mm, no order has less than {proven.bound:.0f} mm")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "better.gcode"
        result.write_gcode(out)
        verdict = decmcts.verify(out, source=NUTS, machine="mk4s")
        print("faults:", len(verdict.faults))
        lines = out.read_text().splitlines()
        bead = next(k for k, line in enumerate(lines) if k > 2000 and " E" in line and " X" in line)
        out.write_text("\n".join(lines[:bead] + lines[bead + 1 :]))
        print("with a line left out:", decmcts.verify(out, NUTS, "mk4s").shown)
    return proven, verdict


if __name__ == "__main__":
    main()
