"""A print of two tools, to break."""

from __future__ import annotations

from collections.abc import Iterator

from decmcts.experiments.made_print import END, LAYERS, START, layer_start, segments, square


def made_tools_gcode(*, macro: bool = True) -> str:
    """Return the G-code of four towers of two tools.

    T0 retracts 0.8 mm. T1 retracts 2 mm and pushes 2.03 back. For a change of tools 10 mm are
    pulled, and pushed with the tool that comes, for the first time too. Behind the third layer T0
    pulls 1.5 mm that a `macro` pushes back, and one loop begins with 0.1 mm pushed on the spot.
    """
    lines = [";LAYER_CHANGE", ";Z:0.2", ";HEIGHT:0.2", "G1 Z0.200 F720"]
    for layer in range(LAYERS):
        lines += layer_start(layer) if layer else []
        for tool, pull, push, x in ((0, 0.8, 0.8, 60.0), (1, 2.0, 2.03, 160.0)):
            lines += [f"T{tool}", f"G1 X{x - 10:.3f} Y90.000 F9000"]
            lines += ["G1 E10.00000 F2100"] if layer or tool else []
            for k, centre in enumerate(((x, 100.0), (x, 150.0))):
                extra = 0.1 if (layer, tool, k) == (4, 0, 1) else 0.0
                lines += _loop(centre, pull if k == 0 else 10.0, (push + extra) if k else 0.0)
            if macro and (layer, tool) == (2, 0):
                lines[-1:] = ["G1 E-1.50000 F2100", "CLEAN_NOZZLE", "G1 E-10.00000 F2100"]
    return START + "\n".join(lines) + "\n" + END


def _loop(centre: tuple[float, float], pull: float, push: float) -> Iterator[str]:
    """Yield a square and what is pushed before it and pulled behind it, mm."""
    corners = square(*centre, 10.0)
    yield f"G1 X{corners[0][0]:.3f} Y{corners[0][1]:.3f} F9000"
    yield from ([f"G1 E{push:.5f} F2100"] if push else [])
    yield from (";TYPE:External perimeter", ";WIDTH:0.45", "G1 F1500")
    yield from segments(corners)
    yield f"G1 E-{pull:.5f} F2100"
