"""Progress and times as slicers state them: M73, and times in comments.

In another order they are no longer true. M73 is counted anew (`progress`) or stands as a
comment; M73 C and D (time to the next stop) are left out, for stops have other work before
them. Times in comments are multiplied by what the whole file takes now over what it took, so
a slicer's own calibration stays; those of a first layer are left out. docs/gcode.md has the
table.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from decmcts.formats.slicers.known import every

GONE = b"; left out by decmcts, true of another order: "
M73 = re.compile(rb"^[ \t]*(?:N\d+[ \t]*)?M0*73(?![\d.])([^;\r\n]*)", re.I)
_COUNT = re.compile(rb"^M73[^;\n]*?\b%s(\d+)", re.M)
WORD = re.compile(rb"([PRQSCD])\s*(\d+(?:\.\d+)?)", re.I)
_LABELS = "|".join((f"(?:{'|'.join(every('time_words'))})++time", *every("times"))).encode()
_TIMES = re.compile(
    rb"^;[ \t*-]*+(?:%b)[ \t]*+(?:\([^)\r\n]*+\)[ \t]*+)?[:=][^\r\n]*" % _LABELS, re.I | re.M
)
_VALUE = re.compile(rb"([:=][ \t]*)([^;:=\r\n]*)")
_PART = re.compile(
    rb"(?<!\d)(\d++(?:\.\d++)?)(?=[ \t]*+(days?|d|hours?|hrs?|h|minutes?|mins?|m|"
    rb"seconds?|secs?|s)\b)",
    re.I,
)
_NUMBER = re.compile(rb"\d+(?:\.\d+)?")
_SECONDS = {b"d": 86400.0, b"h": 3600.0, b"m": 60.0, b"s": 1.0}


def silent_share(text: bytes) -> float:
    """Return how much longer a file takes in silent mode as its M73 say, 0: they do not."""
    normal, silent = (_most(text, letter) for letter in (b"R", b"S"))
    return silent / normal if normal > 0.0 else 0.0


def _most(text: bytes, letter: bytes) -> float:
    if b"M73" not in text:
        return 0.0
    return max(map(float, re.findall(_COUNT.pattern % letter, text, re.M)), default=0.0)


def without_progress(text: bytes, *, keep: tuple[bytes, ...] = ()) -> Iterator[bytes]:
    """Yield the lines of verbatim text, M73 as comments but where it says 100 % or only `keep`."""
    for line in text.splitlines(keepends=True):
        found = M73.match(line)
        words = dict(WORD.findall(found[1].upper())) if found else {}
        done = words.get(b"P", words.get(b"Q", b"")) == b"100"
        stays = not words or done or set(words) <= set(keep)
        yield line if stays else GONE + line.lstrip()


def restated(text: bytes, ratio: float) -> bytes:
    """Return a file with the times in its comments multiplied by `ratio`, line by line."""
    return _TIMES.sub(lambda match: _restated_line(match[0], ratio), text)


def _restated_line(line: bytes, ratio: float) -> bytes:
    if b"first layer" in line.lower():
        return GONE + re.split(rb"[:=]", line.lstrip(b"; "), maxsplit=1)[0].rstrip()
    return _VALUE.sub(lambda match: match[1] + _scaled(match[2], ratio), line)


def _scaled(value: bytes, ratio: float) -> bytes:
    """Return a duration times `ratio` in the words it was said in."""
    parts = _PART.findall(value)
    if not parts:
        return _NUMBER.sub(lambda m: _as_written(float(m[0]) * ratio, m[0]), value, count=1)
    units = [_SECONDS[unit[:1].lower()] for _, unit in parts]
    left = ratio * sum(float(n) * unit for (n, _), unit in zip(parts, units, strict=True))
    places = _places(parts[-1][0])
    left = round(left / units[-1], places) * units[-1]
    written = []
    for (number, _), unit in zip(parts[:-1], units[:-1], strict=True):
        written.append(_as_written(left // unit, number))
        left -= left // unit * unit
    written.append(_as_written(left / units[-1], parts[-1][0]))
    numbers = iter(written)
    return _PART.sub(lambda _: next(numbers), value)


def _places(number: bytes) -> int:
    return len(number.partition(b".")[2])


def _as_written(value: float, number: bytes) -> bytes:
    """Return a value with as many decimals as `number`."""
    return f"{value:.{_places(number)}f}".encode()
