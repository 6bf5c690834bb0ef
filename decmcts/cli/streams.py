"""Standard streams that never fail: any encoding, closed, full, or a pipe nobody reads.

What is shown comes after what is done: when a result is in its place, no terminal,
log or pipe may turn it into a failure. Installed once, before the first line.
"""

from __future__ import annotations

import codecs
import errno
import io
import os
import sys
import unicodedata
from contextlib import suppress

ERRORS = "decmcts.plain"  # name of the error handler below
PLAIN = {
    "→": "->", "←": "<-", "≥": ">=", "≤": "<=", "×": "x", "±": "+-", "−": "-", "–": "-", "—": "-",
    "…": "...", "µ": "u", "μ": "u", "°": " deg", "·": "*", "•": "*", "Γ": "Gamma", "γ": "gamma",
    "‘": "'", "’": "'", "“": '"', "”": '"', "█": "#", "━": "-", "╸": "-", "╺": "-",
}  # fmt: skip
GONE = (errno.EPIPE, errno.EBADF, errno.EINVAL, errno.EIO)  # nobody listens: nothing to say


def plain(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace what an encoding has no letters for by what reads the same.

    Bytes of a file's name that are no text stay the bytes they were.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    first = error.object[error.start]
    if "\udc80" <= first <= "\udcff":
        return bytes([ord(first) - 0xDC00]), error.start + 1
    near = unicodedata.normalize("NFKD", first).encode("ascii", "ignore").decode()
    return PLAIN.get(first) or near or "?", error.start + 1


class Forgiving(io.TextIOWrapper):
    """A text stream that goes quiet where it cannot write, instead of raising."""

    def __init__(self, stream: io.TextIOWrapper, name: str) -> None:
        super().__init__(
            stream.buffer,
            encoding=stream.encoding,
            errors=ERRORS,
            line_buffering=stream.line_buffering,
            write_through=stream.write_through,
        )
        self._called = name

    def write(self, text: str) -> int:
        """Write, or lose the text."""
        try:
            return super().write(text)
        except (OSError, ValueError) as error:  # ValueError: the stream was closed
            self._go_quiet(error)
            return len(text)

    def flush(self) -> None:
        """Flush, or lose what was buffered."""
        try:
            super().flush()
        except (OSError, ValueError) as error:
            self._go_quiet(error)

    def _go_quiet(self, error: OSError | ValueError) -> None:
        """Send all that follows nowhere, so that not even the interpreter's end stumbles on it."""
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
        if isinstance(error, OSError) and error.errno not in GONE and sys.stderr is not self:
            sys.stderr.write(f"decmcts: {self._called} cannot be written ({error.strerror})\n")


def forgive() -> None:
    """Make standard output and error streams that never fail; mutates `sys`.

    A descriptor that was closed is opened on nothing first: else the next file
    opened would get its number, and messages would be written into that file.
    """
    codecs.register_error(ERRORS, plain)
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream is None:
            stream = open(descriptor, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - for good
        if isinstance(stream, io.TextIOWrapper) and not isinstance(stream, Forgiving):
            called = "standard output" if descriptor == 1 else "standard error"
            setattr(sys, name, Forgiving(stream, called))
