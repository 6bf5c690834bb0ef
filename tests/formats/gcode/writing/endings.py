"""How a file that was written ends, against its source."""

from __future__ import annotations

from pathlib import Path

from decmcts.formats.gcode import GcodeDocument, read_written
from sim.files.written import ending_faults


def same_ending(document: GcodeDocument, path: Path) -> list[str]:
    """Return how a file made from `document` reaches its end G-code otherwise than the source."""
    *_, ending = read_written(path, document)
    return ending_faults(document, ending)
