"""Find a better order for one head and write it.

    python examples/01_plan_one_head.py [part.gcode] [better.gcode]

A slicer's file goes in, the same extrusions in a better order come out. Whatever is written
was judged first: no extrusion is lost, and the head touches nothing that is printed already.
"""

from __future__ import annotations

import sys

import decmcts


def show(event: decmcts.Event) -> None:
    """Say what is done; a program with a window would draw it."""
    if isinstance(event, decmcts.Step):
        print(event.text)


def main(path: str, out: str, *, time_limit_s: float = 10.0) -> decmcts.Written:
    """Plan a print and write it, unless that would take longer than the source."""
    source = decmcts.read(path, "mk4s")
    result = decmcts.plan(source, decmcts.Search(time_limit_s=time_limit_s), report=show)
    written = result.write_gcode(out)
    before, after = result.before, result.after
    print(f"travel {before.travel_mm:.0f} mm -> {after.travel_mm:.0f} mm")
    print(f"print time {before.print_time_s:.0f} s -> {after.print_time_s:.0f} s")
    return written


if __name__ == "__main__":
    arguments = sys.argv[1:]
    nuts = str(decmcts.sample_path("four_nuts.gcode.gz"))
    main(arguments[0] if arguments else nuts, arguments[1] if arguments[1:] else "better.gcode")
