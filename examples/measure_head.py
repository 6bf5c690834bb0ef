"""Draws the pictures of docs/measure-your-head.md: what to measure on a head, and what comes of it.

    python -m examples.measure_head [FOLDER]

The head is made up: a nozzle, a heater block, a duct and a carriage under a rod.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from decmcts.formats.machines.machine_file import load_machine
from sim.pictures.canvas import save
from sim.pictures.machine_picture import draw_machine

FOLDER = Path(__file__).resolve().parent.parent / "docs"
MACHINE = Path(__file__).resolve().parent / "measured.toml"
# name: x, y and z from the nozzle's tip, mm, and a colour
PARTS = {
    "heater block": ((-12, 12), (-10, 16), (5, 16), "#ff9d5c"),
    "fan duct": ((12, 30), (-10, 6), (6, 26), "#a6d854"),
    "carriage": ((-28, 28), (-24, 20), (16, 46), "#8da0cb"),
    "rod": ((-110, 110), (10, 20), (22, 30), "#b3b3b3"),
}
NOZZLE = np.array([[-0.5, 0.0], [0.5, 0.0], [3.5, 5.0], [-3.5, 5.0]])
NOZZLE_HEIGHT, ROD_HEIGHT = 5.0, 22.0
RADIUS = float(np.hypot(28, 24))  # the carriage's furthest corner


def main() -> None:
    """Write the pictures to the folder given, docs by default."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    draw_heights(folder / "measure-heights.png")
    draw_radius(folder / "measure-radius.png")
    draw_machine(load_machine(str(MACHINE)), folder / "measure-result.png")


def draw_heights(path: Path) -> None:
    """Draw the head from the front, with the heights to measure."""
    figure = Figure(figsize=(8.0, 3.9))
    axis = figure.subplots()
    for name in reversed(PARTS):
        (left, right), _, (low, high), colour = PARTS[name]
        axis.add_patch(Rectangle((left, low), right - left, high - low, fc=colour, ec="black"))
    axis.add_patch(Polygon(NOZZLE, fc="#d62728", ec="black"))
    axis.axhline(0.0, color="grey", lw=0.8)
    _height(axis, -22.0, NOZZLE_HEIGHT, -1, "step 2: nozzle height")
    _height(axis, 38.0, ROD_HEIGHT, 1, "step 4: rod height")
    for name, at in (("heater block", (0, 11)), ("fan duct", (21, 13)), ("carriage", (0, 36)),
                     ("rod", (-48, 26)), ("nozzle", (8, 1.8))):  # fmt: skip
        axis.annotate(name, at, ha="center", va="center", fontsize=9)
    _finish(axis, "from the front", "z from the tip, mm", (-72, 72), (-4, 50))
    save(figure, path)


def _height(axis: Any, x: float, height: float, side: int, text: str) -> None:
    """Draw a height as an arrow between the tip's level and its own, the text beside it."""
    axis.plot([x - 1, x + 10], [height, height], color="black", lw=0.8, ls="--")
    arrow = {"arrowstyle": "<->", "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axis.annotate("", (x, 0), (x, height), arrowprops=arrow)
    axis.annotate(
        f"{text}\n{height:g} mm", (x + 2 * side, height / 2), fontsize=9, va="center",
        ha="left" if side > 0 else "right",
    )  # fmt: skip


def draw_radius(path: Path) -> None:
    """Draw the head from above, with the disc that holds it."""
    figure = Figure(figsize=(7.5, 5.2))
    axis = figure.subplots()
    for name in reversed(PARTS):
        (left, right), (near, far), _, colour = PARTS[name]
        axis.add_patch(Rectangle((left, near), right - left, far - near, fc=colour, ec="black"))
    axis.add_patch(Circle((0, 0), 3.5, fc="#d62728", ec="black"))
    axis.add_patch(Circle((0, 0), RADIUS, fill=False, ec="black", ls="--", lw=1.4))
    corner = (PARTS["carriage"][0][1], PARTS["carriage"][1][0])
    axis.annotate("", (0, 0), corner, arrowprops={"arrowstyle": "<->", "lw": 1.4})
    axis.annotate(f"step 3: radius\n{np.ceil(RADIUS):g} mm", (31, -34), fontsize=9)
    for name, at in (("fan duct", (21, 3)), ("carriage", (-18, -18)), ("rod", (-50, 15)),
                     ("nozzle", (-5, -6.5))):  # fmt: skip
        axis.annotate(name, at, ha="center", va="center", fontsize=9)
    _finish(axis, "from above", "y from the nozzle, mm", (-62, 62), (-42, 42))
    save(figure, path)


def _finish(
    axis: Any, title: str, label: str, x: tuple[float, float], y: tuple[float, float]
) -> None:
    axis.set(title=title, xlabel="x from the nozzle, mm", ylabel=label, xlim=x, ylim=y)
    axis.set_aspect("equal")


if __name__ == "__main__":
    main()
