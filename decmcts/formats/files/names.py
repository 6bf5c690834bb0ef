"""Names out of files: as part of a line, and as the name of a file.

What somebody else wrote may hold a line end, which would begin a command in G-code, or a path,
which would lead out of a folder.
"""

from __future__ import annotations

_FORBIDDEN = frozenset('/\\:*?"<>|')  # in names of files, on one system or another
_MOST_BYTES = 120  # of a name, in UTF-8; file systems take 255


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
