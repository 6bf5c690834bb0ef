"""What is in force of a setting whose words hold one by one, and the commands that say it again.

A word holds until one that covers it is said: `M204 S` covers P and T, `M593 F` without an axis
covers F of both axes. What says more is said first, and what covers a part of it behind it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from decmcts.formats.gcode.dialects.dialect import Params, classify

_FORMS = {"M204": ("S", ""), "M593": ("", "X Y", "X", "Y")}  # what covers others comes first

Word = tuple[str, str]  # its form, and the word
Key = tuple[str, str]  # an axis, or "", and a word


@dataclass(slots=True)
class Held:
    """The words of one setting that are in force; mutates only itself."""

    command: str
    values: dict[Word, str] = field(default_factory=dict)
    carriers: dict[Key, Word] = field(default_factory=dict)

    def say(self, params: Params, *, form: str = "", whole: str = "") -> str:
        """Take a command, and return what says all that is now in force.

        Parameters
        ----------
        form : str
            The word that names a tool, as `T1`.
        whole : str
            The command as it stands, which is kept where nothing of others is left.
        """
        count = 0
        for word, value, keys in _said(self.command, form, params):
            self.values[word] = value
            self.carriers.update(dict.fromkeys(keys, word))
            count += 1
        if self.command in _FORMS or form or len(self.values) > len(self.carriers):
            self._drop_covered()
        return whole if whole and len(self.values) == count else self._text()

    def _drop_covered(self) -> None:
        """Forget what others cover, and put what covers others first."""
        forms = _FORMS.get(self.command, ())
        left = sorted(
            set(self.carriers.values()),
            key=lambda word: (forms.index(word[0]) if word[0] in forms else 0, word),
        )
        self.values = {word: self.values[word] for word in left}

    def _text(self) -> str:
        lines: dict[str, list[str]] = {}
        for (form, word), value in self.values.items():
            joint = "" if len(word) < 2 else "="
            lines.setdefault(form, []).append(f"{word}{joint}{value}")
        return "\n".join(
            " ".join(filter(None, [self.command, "" if form == "S" else form, *words]))
            for form, words in lines.items()
        )


def keys_of(text: str) -> frozenset[Key]:
    """Return what the commands of a text set, for commands whose words hold one by one."""
    keys: set[Key] = set()
    for line in text.split("\n"):
        event = classify(line.encode("utf-8", "surrogateescape"))
        for _, _, covered in _said(event.text, "", event.params):
            keys.update(covered)
    return frozenset(keys)


def _said(command: str, form: str, params: Params) -> Iterator[tuple[Word, str, list[Key]]]:
    """Yield each word of a command, its value, and what it covers."""
    named = {word for word, _ in params}
    if command == "M204" and "S" in named:  # a form of its own: firmwares differ in its T
        keys = [("", "P"), ("", "T")] + [("", "R")] * bool(named & {"T", "R"})
        yield ("S", ""), " ".join(word + value for word, value in params), keys
        return
    axes = [axis for axis in ("X", "Y") if command == "M593" and axis in named]
    for word, value in params:
        if command != "M593":
            yield (form, word), value, [("", word)]
        elif word not in axes:
            yield (" ".join(axes), word), value, [(axis, word) for axis in axes or ("X", "Y")]
