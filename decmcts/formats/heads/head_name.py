"""What a head may be called: its name becomes part of a file's name and of that file's header.

`STEM_NAME.gcode`, and `; head NAME, file 1 of 2: to be run together`. So what no file
system takes, or no line of comment holds, is refused where a machine is read.
"""

from __future__ import annotations

import unicodedata

from decmcts.formats.files.fields import Fields, shown

MOST_BYTES = 64  # in UTF-8; file systems take 255 for the whole name
_FORBIDDEN = frozenset('/\\:*?"<>|')
_RULE = (
    f"a name is 1 to {MOST_BYTES} bytes, no blank at its ends, no control characters"
    f" and none of {' '.join(sorted(_FORBIDDEN))}: it becomes part of a file's name"
)


def head_name(table: Fields) -> str:
    """Return the name of a head; raises InputError for one that no file can have."""
    name = table.text("name")
    bad = next((c for c in name if c in _FORBIDDEN or not c.isprintable()), None)
    if bad is not None:
        table.fail("name", f"{bad!r} cannot be in a head's name", _RULE)
    if not name or name != name.strip():
        table.fail("name", f"{shown(name)} is empty or has a blank at an end", _RULE)
    size = len(name.encode())
    if size > MOST_BYTES:
        table.fail("name", f"{shown(name)} is {size} bytes long", _RULE)
    return name


def as_file_systems_see(name: str) -> str:
    """Return what two names share that are one file where case does not count."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())
