"""The prints of experiments: made by code, samples of the package, or files of one's own.

`row-4-20-30` is four square towers of 20 mm, 30 mm apart, along x; `grid-3-10-15` is three by
three of 10 mm, 15 mm apart; `strewn-9-10-2` is nine of 10 mm at places drawn from seed 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from decmcts.errors import InputError
from decmcts.experiments.kinds import Key
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.files.atomic import draft_folder
from decmcts.samples import SAMPLES

LAYERS = 8
MIDDLE_MM = (150.0, 150.0)  # of the bed of `dual-gantry`
STREWN_MM = 70.0  # half of the square that towers are strewn over
PIN_MM = 8.0  # of a tower stands beside it
SUFFIXES = (".gcode", ".gcode.gz", ".bgcode", ".gcode.3mf")
Point = tuple[float, float]


@contextmanager
def print_file(key: Key, middle: Point = MIDDLE_MM) -> Iterator[Path]:
    """Yield the file of a run's print."""
    name = key["print"]
    path = Path(key["folder"], name) if is_own(key) else SAMPLES / f"{name}.gcode.gz"
    if is_own(key) or path.is_file():
        yield path
        return
    word, *numbers = name.split("-")
    with draft_folder() as folder:
        made = folder / f"{name}.gcode"
        made.write_text(_made(word, [int(n) for n in numbers], middle))
        yield made


def is_own(key: Key) -> bool:
    """Tell whether a run is of one's own print; its folder stands in no table."""
    return bool(key.get("folder"))


def shown(name: str) -> str:
    """Return a print's name for tables: of one's own file without suffix.

    Examples
    --------
    >>> shown("bracket-v1.2.gcode.gz"), shown("row-4-20-30")
    ('bracket-v1.2', 'row-4-20-30')
    """
    end = next((end for end in SUFFIXES if name.lower().endswith(end)), "")
    return name[: len(name) - len(end)]


def own_prints(folder: Path) -> tuple[str, ...]:
    """Return the names of the G-code files of a folder, sorted; InputError where there is none."""
    if not folder.is_dir():
        raise InputError("no such folder", path=folder)
    found = [path.name for path in folder.iterdir() if path.name.lower().endswith(SUFFIXES)]
    if not found:
        raise InputError(f"no G-code is there ({', '.join(SUFFIXES)})", path=folder)
    return tuple(sorted(found))


def _made(word: str, numbers: Sequence[int], middle: Point) -> str:
    count, size, last = numbers  # the last is a gap, mm, or the seed
    at = [(k - (count - 1) / 2.0) * (size + PIN_MM + last) for k in range(count)]
    if word == "row":
        places = [(x, 0.0) for x in at]
    elif word == "grid":
        places = [(x, y) for y in at for x in at]
    else:
        places = _strewn(count, size + PIN_MM + 2.0, last)
    centres = [(middle[0] + x, middle[1] + y) for x, y in places]
    return made_gcode(centres, size_mm=float(size), layers=LAYERS)


def _strewn(count: int, apart: float, seed: int) -> list[Point]:
    """Return places at random, no two nearer than so far along both axes."""
    rng, found = np.random.default_rng(seed), list[Point]()
    while len(found) < count:
        x, y = rng.uniform(-STREWN_MM, STREWN_MM, 2).round(2).tolist()
        if all(max(abs(x - u), abs(y - v)) >= apart for u, v in found):
            found.append((x, y))
    return found
