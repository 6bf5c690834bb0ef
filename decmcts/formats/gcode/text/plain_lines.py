"""Lines of G-code without what only counts them, and none that firmwares split elsewhere.

Line numbers and checksums are of the source's lines in the source's order: a firmware that reads
them from a file stops where the next number is not the next. So they are taken off once, at the
door, and everything behind it reads and writes plain lines. Each line stays a line, so messages
name those of the file.
"""

from __future__ import annotations

import re
from pathlib import Path

from decmcts.errors import InputError

# Both begin with a plain byte, which `re` looks for faster than for the begin of a line.
_NUMBERED = re.compile(rb"\n[ \t]*[Nn][ \t]*\d+(?:\.\d*)?[ \t]*([^;\r\n]*)")
_LONE_RETURN = re.compile(rb"\r(?![\r\n]|\Z)")


def without_numbers(text: bytes) -> bytes:
    """Return a text whose lines have no number (`N12`) and no checksum (`*71`)."""
    if not _NUMBERED.search(above := b"\n" + text):
        return text
    return _NUMBERED.sub(lambda line: b"\n" + _without_checksum(line[1]), above)[1:]


def first_number(text: bytes) -> int | None:
    """Return the first line (from 1) that has a number; None where none has."""
    found = _NUMBERED.search(above := b"\n" + text)
    return None if found is None else above.count(b"\n", 0, found.start() + 1)


def _without_checksum(code: bytes) -> bytes:
    """Return a command that had a number without the checksum at its end."""
    command, star, digits = code.rpartition(b"*")
    return command.rstrip() if star and digits.strip().isdigit() else code


def refuse_lone_returns(text: bytes, path: Path | str) -> None:
    """Refuse a carriage return within a line: some firmwares end the line there, others do not.

    Raises
    ------
    InputError
        With the line it stands in.
    """
    found = _LONE_RETURN.search(text)
    if found is None:
        return
    if b"\n" not in text:
        raise InputError(
            "its lines end in a carriage return alone (CR, as on old Macs), where some firmwares "
            "end a line and others do not",
            path=path,
            advice="save it with line ends LF or CRLF (`tr '\\r' '\\n' < IN > OUT`)",
        )
    raise InputError(
        "a carriage return within a line: some firmwares end the line there, and then run what "
        "stands behind it",
        path=path,
        line=text.count(b"\n", 0, found.start()) + 1,
        advice="export the G-code again, or put a line end there",
    )
