"""What one line means, in the words of all slicers (`formats.slicers`): a function of its text.

A line is sticky state, a layer marker, an object label, a comment without
meaning for the order, or a barrier. What is not known is a barrier: nothing is
guessed to be harmless.

In a new order a layer is entered many times. Its marker, height and number are said each
time: they describe what comes next. What the slicer wrote around its first move
(`BEFORE_LAYER_CHANGE`, `AFTER_LAYER_CHANGE`) is what scripts act on once a layer, so it is
said once, where the layer is first begun.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

from decmcts.formats.slicers import slic3r
from decmcts.formats.slicers.known import DIALECTS, every, together
from decmcts.print.contours import Role

BY_NAME = {
    name: role for known in DIALECTS for role, names in known.roles.items() for name in names
}
CANONICAL = {role: names[0].capitalize() for role, names in slic3r.DIALECT.roles.items()}
CANONICAL[Role.SKIRT_BRIM] = "Skirt/Brim"
_TYPED = re.compile(r"(?:TYPE|FEATURE)\s*:\s*(.*)$", re.I)
_KISS = re.compile(r"'([^']+ Path)'", re.I)
Params = tuple[tuple[str, str], ...]
SPLIT_MARK = "; next contour"
WAIT_MARK = "; decmcts waits for cooling"  # behind a dwell of ours, which plans make anew
IDLE_MARK = "; decmcts stands idle"
DWELL_MARKS = (WAIT_MARK, IDLE_MARK)
_LAYER = re.compile("|".join(every("layers")), re.I)
_NOTE = re.compile("|".join(every("notes")), re.I)
_VALUES = together("values")
_TEMPERATURE = {"M104", "M109", "M140", "M190", "M141", "M191", "M142", "M116", "M303"}
# Commands whose setting holds: slot and the parameter that selects which one.
_REPLACED = {
    "M106": ("fan", "P"), "M107": ("fan", "P"), "M126": ("fan", ""), "M127": ("fan", ""),
    "M220": ("speed factor", ""), "M117": ("message", ""), "M74": ("mass", ""),
    "G17": ("plane", ""), "SET_PRINT_STATS_INFO": ("print stats", ""),
}  # fmt: skip
_MERGED = {
    "M204": ("acceleration", ""), "M205": ("jerk", ""), "M201": ("axis acceleration", ""),
    "M203": ("axis feed", ""), "M566": ("jerk (RRF)", ""), "M207": ("retraction", ""),
    "M208": ("unretraction", ""), "SET_VELOCITY_LIMIT": ("velocity limit", ""),
    "M593": ("input shaping", ""), "SET_RETRACTION": ("retraction", ""),
    "SET_FAN_SPEED": ("fan", "FAN"),
}  # fmt: skip
_OF_TOOL = {
    "M221": ("flow factor", ("T", "D")), "M900": ("linear advance", ("T",)),
    "M572": ("pressure advance", ("D",)),
    "SET_PRESSURE_ADVANCE": ("pressure advance", ("EXTRUDER",)),
}  # fmt: skip
OF_TOOL = frozenset(slot for slot, _ in _OF_TOOL.values())  # settings of the tool in use, or named
_SET = _REPLACED.keys() | _MERGED.keys() | _OF_TOOL.keys()
_NUMBERS = (_SET | _TEMPERATURE) - {"M117"}  # that are acted on
GROWING = frozenset(_MERGED.keys() | _OF_TOOL.keys()) - {"SET_FAN_SPEED"}
# commands whose parameters only add up
_REASONS = {
    "M600": "filament change", "M0": "pause", "M1": "pause", "M25": "pause", "M226": "pause",
    "M601": "pause", "M125": "pause", "PAUSE": "pause", "@PAUSE": "pause",
    "M701": "filament change", "M702": "filament change", "G4": "dwell", "G28": "homing",
    "G29": "bed probing", "G92": "coordinates set anew", "M400": "wait for moves to end",
}  # fmt: skip
UNKNOWN = frozenset({"unknown macro", "unknown command", "filament change", "pause"})
# reasons of barriers that may move filament unseen
_NAME = re.compile(r"[A-Za-z]\s*+\d++(\.\d++)?(?![A-Za-z_](?![-+.\d]))|[^\s]+")  # M106S9 is M106
_EXPONENT = re.compile(r"[0-9.]e[-+]?[0-9]")  # small: E5 behind a number is a word
_DWELL = re.compile(r"G4 P\d+ ;")
_WORD = re.compile(r'([A-Za-z])\s*("[^"]*"|[-+]?[0-9.]*(?::[-+]?[0-9.]+)*)')
NUMBER = re.compile(r"\s*+;\s*+-?(\d++(?:\.\d*+)?|\.\d++)\s*+$")  # the height below such a line
_ONCE = re.compile(r"\s*+;\s*+(BEFORE|AFTER)_LAYER_CHANGE\s*+$", re.I)


def _name(body: str) -> str:
    if match := _TYPED.match(body):
        return match.group(1).strip().lower()
    if match := _KISS.match(body):
        return match.group(1).lower()
    return body.strip().lower().removeprefix("feature ")


def is_layer_comment(body: str) -> bool:
    """Tell whether a comment (without its marks) begins a layer."""
    return _LAYER.match(body) is not None


def role_of(text: str) -> Role:
    """Return the role a comment, or the last of several, names; UNKNOWN for unknown words."""
    text = text[text.rfind("\n") + 1 :]
    return BY_NAME.get(_name(text.lstrip("; (").rstrip(") ")), Role.UNKNOWN)


class Kind(IntEnum):
    """What a line does to the print."""

    NOTHING = 0  # a comment, progress, a mode that is set already
    STATE = 1  # sticky: holds until it is set again
    LAYER = 2  # a layer begins
    LAYER_NOTE = 3  # a line that belongs to the layer marker above it
    LEAVE = 4  # the object (or label) in `slot` ends
    BARRIER = 5  # nothing may be moved across
    MODE = 6  # G90, G91, M82, M83: a barrier if it changes anything
    SECTION = 7  # a tool change of the slicer begins
    SECTION_END = 8
    SPLIT = 9  # our own mark: the next bead is another contour though it begins here
    UNREADABLE = 10  # a number in it has an exponent


@dataclass(frozen=True, slots=True)
class LineMeaning:
    """The meaning of one line."""

    kind: Kind
    slot: str = ""  # which state it sets
    text: str = ""  # the state's text, or the barrier's reason
    params: Params = ()  # of a command whose parameters hold one by one
    tools: tuple[str, ...] | None = None  # that it names, of a setting of a tool; (): that in use
    names: str = ""  # the word that names them
    whole: str = ""  # the command, if it may be said again as it stands


_NOTHING = LineMeaning(Kind.NOTHING)


@lru_cache(maxsize=65536)
def classify(raw: bytes) -> LineMeaning:
    """Return what a line (without its line end) means; moves are not asked about."""
    text = raw.decode("utf-8", "surrogateescape").strip()
    behind = without_brackets(text.split(";", 1)[0]).strip() if text[:1] == "(" else ""
    if text[:1] in (";", "(") and not behind:
        return _comment(text)
    if text.endswith(DWELL_MARKS) and _DWELL.match(text):
        return _NOTHING
    text = re.sub(r"^[Nn]\s*\d+\s*", "", text)
    code = text.split(";", 1)[0].strip()
    if not code.upper().startswith("M117"):
        code = re.sub(r"\*\d+\s*$", "", without_brackets(code)).strip()
    return _command(code) if code else _NOTHING


def without_brackets(code: str) -> str:
    """Return a command without comments in brackets; one that is not closed stays."""
    *closed, rest = code.split(")")
    kept = []
    for piece in closed:
        before, opened, _ = piece.partition("(")
        kept.append(before if opened else piece + ")")
    return "".join([*kept, rest])


def _comment(text: str) -> LineMeaning:
    if text == SPLIT_MARK:
        return LineMeaning(Kind.SPLIT)
    body = text.lstrip("; (").rstrip(") ")
    upper = body.upper()
    key = upper.split(":", 1)[0].strip() if ":" in upper else ""
    stated = _VALUES.get(key, "")
    if stated in ("width", "height") and not text.startswith("; LAYER_HEIGHT: ;"):
        return LineMeaning(Kind.STATE, stated, text)
    if stated == "layer" or _NOTE.match(body):
        return LineMeaning(Kind.LAYER_NOTE, "layer", text)
    if stated == "mesh":
        return LineMeaning(Kind.STATE, "mesh", text)
    if _TYPED.match(body) or (_name(body) in BY_NAME and ":" not in body):
        return LineMeaning(Kind.STATE, "type", text)
    if is_layer_comment(body):
        return LineMeaning(Kind.LAYER, "layer", text)
    return _label(text, body)


def _label(text: str, body: str) -> LineMeaning:
    lower = body.lower()
    slot = "numbered label" if lower.startswith(every("numbered")) else "label"
    if lower.startswith(every("objects")):
        return LineMeaning(Kind.STATE, slot, text)
    if lower.startswith(every("objects_end")):
        return LineMeaning(Kind.LEAVE, slot, text)
    if body.startswith(every("changes")):
        return LineMeaning(Kind.SECTION, text=text)
    if body.startswith(every("changes_end")):
        return LineMeaning(Kind.SECTION_END, text=text)
    return _NOTHING


def _command(code: str) -> LineMeaning:
    head = _NAME.match(code)
    name = head.group(0).upper().replace(" ", "") if head else code
    name = re.sub(r"^([GMT])0+(?=\d)", r"\1", name)
    rest = code[head.end() :].strip() if head else ""
    if name in ("G90", "G91", "M82", "M83"):
        return LineMeaning(Kind.MODE, text=name)
    if name == "M73" and re.fullmatch(r"[Ll]\s*\d+", rest):
        return LineMeaning(Kind.LAYER_NOTE, "layer", code)  # the layer that Bambu's display shows
    if name in ("G21", "M73") or (name == "G92" and re.fullmatch(r"[Ee]\s*[-+0-9.]*", rest)):
        return _NOTHING
    if name in ("G10", "G11") and not re.search(r"[PSRLX]", rest.upper()):
        return _NOTHING
    if event := _object(name, code, rest):
        return event
    if name in _NUMBERS and _EXPONENT.search(rest):
        return LineMeaning(Kind.UNREADABLE)
    if name in _REPLACED and not (name == "M220" and re.search(r"[BR]", rest.upper())):
        slot, selector = _REPLACED[name]
        params = () if name == "M117" else _params(rest)
        return LineMeaning(Kind.STATE, _selected(slot, selector, params), code)
    if name in _OF_TOOL:
        return _of_tool(name, code, rest)
    if name in _MERGED:
        return _merged(name, code, rest)
    return _barrier(name, code, rest)


def _object(name: str, code: str, rest: str) -> LineMeaning | None:
    if name == "EXCLUDE_OBJECT_START" or name == "M624":
        return LineMeaning(Kind.STATE, "object", code)
    if name == "EXCLUDE_OBJECT_END" or name == "M625":
        return LineMeaning(Kind.LEAVE, "object", code)
    if name == "M486":
        if rest.replace(" ", "").upper().startswith("S-1"):
            return LineMeaning(Kind.LEAVE, "object", code)
        if rest.upper().startswith("S"):
            return LineMeaning(Kind.STATE, "object", code)
        return LineMeaning(Kind.LAYER_NOTE, "object", code)
    return None


def _params(rest: str) -> Params:
    if "=" in rest:
        pairs = (word.split("=", 1) for word in rest.split() if "=" in word)
        return tuple((key.upper(), value) for key, value in pairs)
    return tuple((key.upper(), value) for key, value in _WORD.findall(rest))


def _selected(slot: str, selector: str, params: Params) -> str:
    """Return the slot of the fan, say, that a command's `selector` names; "" for no selector."""
    chosen = next((value for key, value in params if key and key == selector), "0")
    return slot if chosen in ("", "0") else f"{slot} {chosen}"


def _merged(name: str, code: str, rest: str) -> LineMeaning:
    slot, selector = _MERGED[name]
    params = _params(rest)
    whole = code if name == "M593" else ""
    slot = _selected(slot, selector, params)
    return LineMeaning(Kind.STATE, slot, name, params or (("", ""),), whole=whole)


def _of_tool(name: str, code: str, rest: str) -> LineMeaning:
    slot, selectors = _OF_TOOL[name]
    params = _params(rest)
    found = next(((key, value) for key, value in params if key in selectors), ("", ""))
    kept = tuple(word for word in params if word[0] not in selectors) or (("", ""),)
    tools = tuple(filter(None, found[1].split(":")))
    return LineMeaning(
        Kind.STATE, slot, name, kept, tools, found[0], "" if len(tools) > 1 else code
    )


def _barrier(name: str, code: str, rest: str) -> LineMeaning:
    if name in _TEMPERATURE or (name == "G10" and "L" not in rest.upper()):
        tool = dict(_params(rest)).get("T", "")
        where = {"M104": "hotend", "M109": "hotend", "M140": "bed", "M190": "bed"}.get(name, name)
        return LineMeaning(Kind.BARRIER, f"temperature {where}{tool}", "temperature change")
    if re.fullmatch(r"T-?\d+", name):
        return LineMeaning(Kind.BARRIER, "tool", "tool change")
    known = re.fullmatch(r"[GMT]\d+(\.\d+)?", name) is not None
    return LineMeaning(
        Kind.BARRIER, "", _REASONS.get(name, "unknown command" if known else "unknown macro")
    )


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
