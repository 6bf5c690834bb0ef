"""The one way to the terminal: nothing that comes out of a file commands it.

Names of machines and heads, macros, lines of G-code and recordings hold what somebody else wrote:
an escape sequence in them could rename the window, hide a warning, or answer in the user's
place. All that is shown is rendered by a `SafeConsole`, which puts a question mark in the place
of each control character; colours and cursor movements of our own are not text and pass.
"""

from __future__ import annotations

from collections.abc import Iterable
from unicodedata import category

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

_KEPT = frozenset("\n\t")  # parts of a layout
_RAW = range(0xDC80, 0xDCA0)  # bytes of a name that a terminal of 8 bits takes for controls
_TURNS = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")  # text the other way


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


class SafeConsole(Console):
    """A console that shows no control character of what it is given."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render as any console, what is text without controls."""
        for segment in super().render(renderable, options):
            if segment.control is None and (clean := harmless(segment.text)) != segment.text:
                yield Segment(clean, segment.style)
            else:
                yield segment
