"""What is in force of a setting whose words hold one by one, and the commands that say it again.

A word holds until one that covers it is said: `M204 S` covers P and T, `M593 F` without an axis
covers F of both axes. What says more is said first, and what covers a part of it behind it.

Temperatures are held too, as far as a file's own commands state them. Slicers that print parts one
by one state bed and hot end anew before each part. The target that is in force already changes
nothing, and needs no barrier. What is not known is not taken for known.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from decmcts.formats.gcode.dialects.dialect import Params, classify

_FORMS = {"M204": ("S", ""), "M593": ("", "X Y", "X", "Y")}  # what covers others comes first

Word = tuple[str, str]  # its form, and the word
WordKey = tuple[str, str]  # an axis, or "", and a word
SETS = re.compile(r"M(104|140)\s++S\s*+(\d++(?:\.\d*+)?|\.\d++)(?:\s++T\s*+(\d++))?", re.I)
WAITS = re.compile(r"M1(09|90)\s++[SR]\s*+(\d++(?:\.\d*+)?|\.\d++)(?:\s++T\s*+(\d++))?", re.I)
_HEATERS = {"104": "hot end", "09": "hot end", "140": "bed", "90": "bed"}
# Printers that probe with the nozzle cool it for that.
COOL_NOZZLE = ("homing", "bed probing")
# Barriers behind which each heater is as warm as before.
KEEP_HEAT = ("dwell", "coordinates set anew", "wait for moves to end", "coordinate mode")


@dataclass(slots=True)
class WordsInForce:
    """The words of one setting that are in force; mutates only itself."""

    command: str
    values: dict[Word, str] = field(default_factory=dict)
    carriers: dict[WordKey, Word] = field(default_factory=dict)

    def take(self, params: Params, *, form: str = "", whole: str = "") -> str:
        """Take a command, and return what says all that is now in force.

        `form` is the word that names a tool, as `T1`, `whole` the command as it stands, which is
        kept where nothing of others is left.
        """
        count = 0
        for word, value, keys in _words_of(self.command, form, params):
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


def keys_of(text: str) -> frozenset[WordKey]:
    """Return what the commands of a text set, for commands whose words hold one by one."""
    keys: set[WordKey] = set()
    for line in text.split("\n"):
        event = classify(line.encode("utf-8", "surrogateescape"))
        for _, _, covered in _words_of(event.text, "", event.params):
            keys.update(covered)
    return frozenset(keys)


def _words_of(command: str, form: str, params: Params) -> Iterator[tuple[Word, str, list[WordKey]]]:
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


def target_of(code: str) -> str:
    """Return the target that a command sets, whether it waits or not; of others the command."""
    stated = SETS.fullmatch(code) or WAITS.fullmatch(code)
    return code if stated is None else f"{float(stated[2]):g} degrees"


@dataclass(slots=True)
class Targets:
    """The targets in force while the lines of a file go by; mutates only itself."""

    known: dict[tuple[str, str], float] = field(default_factory=dict)  # heater and tool -> °C

    def again(self, code: str, reason: str) -> bool:
        """Take a barrier, and tell whether it only sets a target that is in force.

        One that waits is never said in vain: the heater may not be there yet.
        """
        stated = SETS.fullmatch(code) or WAITS.fullmatch(code)
        if stated is None:
            if reason in COOL_NOZZLE:
                self.known = {k: v for k, v in self.known.items() if k[0] != "hot end"}
            elif reason not in KEEP_HEAT:
                self.known.clear()
            return False
        heater, target, tool = _HEATERS[stated[1]], float(stated[2]), stated[3] or ""
        if self.known.get((heater, tool)) == target and stated.re is SETS:
            return True
        for other in [key for key in self.known if key[0] == heater and "" in (key[1], tool)]:
            del self.known[other]  # one of them names no tool: it may be the same heater
        self.known[heater, tool] = target
        return False
