"""Colours and the way a figure becomes a file, the same in every picture."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from decmcts.formats.files.atomic import write_whole

TRAVEL = "#d62728"
HEAD_COLOURS = (
    "#7f7f7f", "#1f77b4", "#e6a817", "#2ca02c", "#9467bd", "#8c564b",
    "#e377c2", "#17becf", "#bcbd22",
)  # fmt: skip
DPI = 150
SVG: Any = {"svg.fonttype": "none", "svg.hashsalt": "decmcts", "font.family": "sans-serif"}
# text stays text, and equal pictures are equal files


def head_colour(index: int, heads: int) -> str:
    """Return the colour of a head's extrusions: grey when it is the only one."""
    return HEAD_COLOURS[0] if heads == 1 else HEAD_COLOURS[1 + index % (len(HEAD_COLOURS) - 1)]


@contextmanager
def words_as_they_are(**style: Any) -> Iterator[None]:
    """Take no name for a formula, and say nothing of letters the font has not; `style` as well."""
    settings: Any = {"text.parse_math": False, **style}
    with mpl.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        yield


def save(figure: Figure, path: Path | str) -> None:
    """Write a figure as SVG where the name says so, else as PNG."""
    FigureCanvasAgg(figure)
    image = io.BytesIO()
    kind = "svg" if Path(path).suffix.lower() == ".svg" else "png"
    dated = {"Date": None, "Creator": "decmcts"} if kind == "svg" else {"Software": "decmcts"}
    with mpl.rc_context(SVG if kind == "svg" else {}), words_as_they_are():
        figure.savefig(image, dpi=DPI, facecolor="white", format=kind, metadata=dated)
    write_whole(path, image.getvalue())
