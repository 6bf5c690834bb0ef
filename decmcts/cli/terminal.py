"""The one way to the terminal: nothing that comes out of a file commands it.

Names of machines and heads, macros, lines of G-code and recordings hold what somebody else wrote:
an escape sequence in them could rename the window, hide a warning, or answer in the user's
place. All that is shown is rendered by a `SafeConsole`, which puts a question mark in the place
of each control character; colours and cursor movements of our own are not text and pass.
"""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from decmcts.formats.files.names import harmless

__all__ = ["SafeConsole", "harmless"]


class SafeConsole(Console):
    """A console that shows no control character of what it is given."""

    def show(self, *lines: str | None) -> None:
        """Print lines whole, however long; those that are empty, or None, not at all."""
        for line in filter(None, lines):
            self.print(line, soft_wrap=True)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render as any console, what is text without controls."""
        for segment in super().render(renderable, options):
            if segment.control is None and (clean := harmless(segment.text)) != segment.text:
                yield Segment(clean, segment.style)
            else:
                yield segment
