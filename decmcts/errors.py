"""The errors a user can meet, each one clear line.

Nothing here imports anything of the project. The command line turns an
`InputError` into one line and exit code 2.
"""

from __future__ import annotations

from pathlib import Path


class InputError(Exception):
    """What was given cannot be used; the input is untouched and nothing was written.

    Parameters
    ----------
    what : str
        What is wrong, with the offending value and the limit it breaks.
    path : Path | str | None
        The file it was found in.
    line : int | None
        The line of that file, counted from 1.
    advice : str
        What to do about it.
    """

    def __init__(
        self,
        what: str,
        *,
        path: Path | str | None = None,
        line: int | None = None,
        advice: str = "",
    ) -> None:
        self.what = what
        self.path = None if path is None else str(path)
        self.line = line
        self.advice = advice
        super().__init__(str(self))

    def __str__(self) -> str:
        where = ""
        if self.path is not None:
            where = self.path + (f":{self.line}" if self.line is not None else "") + ": "
        elif self.line is not None:
            where = f"line {self.line}: "
        tail = f"; {self.advice}" if self.advice else ""
        return " ".join(f"{where}{self.what}{tail}".split())


class VerificationError(Exception):
    """A result of ours failed the independent check; it was not written."""
