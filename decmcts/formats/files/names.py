"""Names out of files: as part of a line, as the name of a file, and shown on a terminal.

What somebody else wrote may hold a line end, which would begin a command in G-code, or a path,
which would lead out of a folder.
"""

from __future__ import annotations

from unicodedata import category

_FORBIDDEN = frozenset('/\\:*?"<>|')  # in names of files, on one system or another
_MOST_BYTES = 120  # of a name, in UTF-8; file systems take 255
_KEPT = frozenset("\n\t")  # parts of a layout
_RAW = range(0xDC80, 0xDCA0)  # bytes of a name that a terminal of 8 bits takes for controls
_TURNS = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")  # text the other way


def in_one_line(text: str) -> str:
    r"""Return a text without line ends and controls, as it may stand in a comment.

    Examples
    --------
    >>> in_one_line("Mine\nM104 S300")
    'Mine M104 S300'
    """
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def as_file_name(name: str) -> str:
    """Return the name of a file in the folder that is meant, whatever `name` holds.

    Examples
    --------
    >>> as_file_name("Voron 2.4"), as_file_name("../../etc/x"), as_file_name("..")
    ('Voron 2.4', '_.._etc_x', '_')
    """
    plain = "".join("_" if c in _FORBIDDEN or not c.isprintable() else c for c in name)
    plain = plain.encode("utf-8", "replace")[:_MOST_BYTES].decode("utf-8", "ignore")
    return plain.strip(" ").strip(".").strip(" ") or "_"


def harmless(text: str) -> str:
    r"""Return a text with a question mark for whatever would command a terminal.

    Examples
    --------
    >>> harmless("a\x1b]0;title\x07b")
    'a?]0;title?b'
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join("?" if _commands(c) else c for c in text)


def _commands(char: str) -> bool:
    """Tell whether a terminal takes a character for a command."""
    if char in _KEPT:
        return False
    return category(char) == "Cc" or char in _TURNS or ord(char) in _RAW
