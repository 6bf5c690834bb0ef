"""What a slicer writes where a layer begins, and which of it is said when one is entered again.

In a new order a layer is entered many times. Its marker, height and number are said each
time: they describe what comes next. What the slicer wrote around its first move
(`BEFORE_LAYER_CHANGE`, `AFTER_LAYER_CHANGE`) is what scripts act on once a layer, so it is
said once, where the layer is first begun.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

NUMBER = re.compile(r"\s*+;\s*+-?(\d++(?:\.\d*+)?|\.\d++)\s*+$")  # the height below such a line
_ONCE = re.compile(r"\s*+;\s*+(BEFORE|AFTER)_LAYER_CHANGE\s*+$", re.I)


@dataclass(frozen=True, slots=True)
class LayerWords:
    """The lines at the beginning of a layer."""

    always: tuple[str, ...]  # marker, height, number
    before: tuple[str, ...]  # once, before the head goes there
    after: tuple[str, ...]  # once, when it is there


def layer_words(text: str) -> LayerWords:
    r"""Part the lines of a layer's marker.

    Examples
    --------
    >>> words = layer_words(";LAYER:2\n;BEFORE_LAYER_CHANGE\n;0.4\n;AFTER_LAYER_CHANGE")
    >>> words.always, words.before, words.after
    ((';LAYER:2',), (';BEFORE_LAYER_CHANGE', ';0.4'), (';AFTER_LAYER_CHANGE',))
    """
    parts: dict[str, list[str]] = {"": [], "BEFORE": [], "AFTER": []}
    at = ""
    for line in text.split("\n") if text else []:
        if once := _ONCE.match(line):
            at = once.group(1).upper()
        elif not NUMBER.match(line):
            at = ""
        parts[at].append(line)
    return LayerWords(*(tuple(part) for part in parts.values()))


def with_note(marker: str, note: str) -> str:
    """Return a layer's lines with one more; a bare number belongs to the line above it."""
    if NUMBER.match(note) and not _ONCE.match(marker.rsplit("\n", 1)[-1]):
        return marker
    return f"{marker}\n{note}"
