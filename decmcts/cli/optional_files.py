"""Options whose file may be left out: `--report` alone, or `--report FILE`.

A slicer puts the file it hands over behind the words of its script. So what follows such an
option is its file only if it is named like one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

BESIDE = Path("beside")  # no name such an option takes: its file stands next to the exported one
ENDINGS = {"--report": (".html", ".htm"), "--picture": (".png", ".svg")}


def completed(arguments: Sequence[str]) -> list[str]:
    """Return arguments in which each such option has a file.

    Examples
    --------
    >>> completed(["--report", "part.gcode", "--picture", "p.png"])
    ['--report', 'beside', 'part.gcode', '--picture', 'p.png']
    """
    made = list[str]()
    for k, word in enumerate(arguments):
        made.append(word)
        if word == "--":
            return [*made, *arguments[k + 1 :]]
        following = arguments[k + 1] if k + 1 < len(arguments) else ""
        if word in ENDINGS and not following.lower().endswith(ENDINGS[word]):
            made.append(str(BESIDE))
    return made


class OptionalFiles(TyperCommand):
    """A command with such options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments once each of these options has a file; keep them as they came."""
        ctx.meta[__name__] = list(args)
        return super().parse_args(ctx, completed(args))


def words_of(context: typer.Context) -> list[str]:
    """Return the arguments of such a command as they were given."""
    return list(context.meta.get(__name__, ()))
