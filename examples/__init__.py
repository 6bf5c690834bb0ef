"""Ready-to-run examples and the prints they use."""

from __future__ import annotations

from pathlib import Path


def example_path(name: str) -> Path:
    """Return the path of a file that ships with the examples, e.g. ``plate.gcode.gz``.

    Raises
    ------
    FileNotFoundError
        When there is no such example; the message lists those there are.
    """
    folder = Path(__file__).parent
    path = folder / name
    if not path.is_file():
        there = sorted(p.name for p in folder.iterdir() if p.name.endswith((".stl", ".gz")))
        raise FileNotFoundError(f"no example {name!r}; there are {', '.join(there)}")
    return path
