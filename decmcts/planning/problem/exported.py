"""Where a slicer will put the file that it hands to a post-processing script.

PrusaSlicer, SuperSlicer, OrcaSlicer and Bambu Studio export to a temporary name, run the
script on that file, and rename it then. They say the final name in the environment.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

NAME, HOST = "SLIC3R_PP_OUTPUT_NAME", "SLIC3R_PP_HOST"
HEAD = 8192  # bytes in which a report or picture says who made it
A_FILE = ("", "File")  # hosts that are none: the file stays on this computer


def exported_file(path: Path, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the name a file will have; its own where no slicer says another.

    Where the file will be sent to a printer, or the slicer names a folder that is not there,
    only the name is taken: the folder is that of the file that was handed over.
    """
    stated = environment.get(NAME, "")
    if not stated or "\0" in stated or stated.endswith(("/", os.sep)):
        return path
    final = Path(stated)
    if final.name in ("", "..", "."):
        return path
    stays = environment.get(HOST, "") in A_FILE and final.is_absolute() and final.parent.is_dir()
    return final if stays else path.with_name(final.name)


def is_foreign(path: Path) -> bool:
    """Tell whether a file is there that no report or picture of ours is; so are links and folders.

    Ours name this program near their begin.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return True
    try:
        with path.open("rb") as file:
            return b"decmcts" not in file.read(HEAD)
    except FileNotFoundError:
        return False
    except OSError:
        return True


def beside(path: Path, ending: str) -> Path:
    """Return the name of what stands next to a file: `part.gcode` with another ending.

    Examples
    --------
    >>> beside(Path("my/part.gcode.gz"), ".report.html").name
    'part.report.html'
    """
    stem = path.name
    for suffix in (".gz", ".3mf", ".gcode", ".bgcode", ".gx", ".gco", ".g"):
        stem = stem[: -len(suffix)] if stem.lower().endswith(suffix) and stem != suffix else stem
    return path.with_name(stem + ending)
