"""Texts that are dear to match, made from a pattern's own parts.

What makes a pattern slow is a long repetition of something its parts share, behind what leads
to them and before what none of them takes. So an attack is a prefix of a match, a repeated
piece, and an end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain, product
from re import _constants as ops  # type: ignore[attr-defined]  # where `re` keeps its tree
from typing import Any

from tests.growth.matcher import ONE, REPEATS, Counted, chars_of

MANY = 16  # what is repeated no more than this grows no further
_REFUSED = ")\n;(=:]}! a0"
_PREFERRED = "a0 \t.;(=-\n"


def attacks(pattern: Counted, *, pairs: bool) -> Iterator[tuple[str, str, str]]:
    """Yield prefix, piece to repeat, and end; with `pairs` also pieces of any two characters."""
    letters = representatives(pattern)
    ends = _ends(pattern)
    prefixes, bodies = ["", *_prefixes(list(pattern.tree), pattern.flags)], _bodies(pattern)
    short = sorted(prefixes[1:], key=len)[:3]  # begun again and again
    pieces = dict.fromkeys([*letters, *bodies, *short])
    if pairs:
        pieces |= dict.fromkeys(a + b for a, b in product(letters, repeat=2))
    for prefix in dict.fromkeys(prefixes):
        for piece in pieces:
            for end in ends:
                yield prefix, piece, end


def representatives(pattern: Counted) -> list[str]:
    """Return one character of each kind that what the pattern repeats tells apart."""
    bodies = [v[2] for op, v in _walk(list(pattern.tree)) if op in REPEATS and v[1] > MANY]
    nodes = [node for body in bodies for node in _walk(list(body)) if node[0] in ONE]
    kinds: dict[tuple[bool, ...], str] = {}
    sets = [chars_of(node, pattern.flags) for node in nodes]
    for char in chain(_PREFERRED, map(chr, range(1, 128))):
        kinds.setdefault(tuple(char in chars for chars in sets), char)
    lines = ["\n"] if pattern.flags & re.MULTILINE else []
    return list(dict.fromkeys([*kinds.values(), *lines]))


def _ends(pattern: Counted) -> list[str]:
    """Return characters of which each repetition does not take one."""
    found = ["\0"]
    for op, value in _walk(list(pattern.tree)):
        nodes = list(value[2]) if op in REPEATS and value[1] > MANY else []
        for node in (n for n in nodes if n[0] in ONE):
            if not any(end not in chars_of(node, pattern.flags) for end in found):
                others = (c for c in _REFUSED if c not in chars_of(node, pattern.flags))
                found += list(others)[:1]
    return found


def _walk(nodes: list[Any]) -> Iterator[Any]:
    for node in nodes:
        yield node
        for part in _parts(node):
            yield from _walk(list(part))


def _parts(node: Any) -> list[Any]:
    """Return the sequences within a node."""
    op, value = node
    if op in REPEATS:
        return [value[2]]
    if op is ops.SUBPATTERN:
        return [value[-1]]
    if op is ops.BRANCH:
        return list(value[1])
    if op is ops.ATOMIC_GROUP:
        return [value]
    return [value[1]] if op in (ops.ASSERT, ops.ASSERT_NOT) else []


def _sample(nodes: list[Any], flags: int, more: int = 0) -> str:
    """Return a text that the nodes take, repetitions as short as may be, or `more` times."""
    said = ""
    for node in nodes:
        op, value = node
        if op in ONE:
            order = chain(_PREFERRED, map(chr, range(32, 127)), "\t\n\r")
            said += next((c for c in order if c in chars_of(node, flags)), "")
        elif op in REPEATS:
            times = min(max(int(value[0]), more), int(value[1]))
            said += _sample(list(value[2]), flags, more) * times
        elif op is ops.BRANCH:
            said += _sample(list(value[1][0]), flags, more)
        elif op in (ops.SUBPATTERN, ops.ATOMIC_GROUP):
            said += _sample(list(_parts(node)[0]), flags, more)
    return said


def _prefixes(nodes: list[Any], flags: int) -> list[str]:
    """Return beginnings of matches, up to each repetition and behind it."""
    found: list[str] = []
    for k, node in enumerate(nodes):
        if not _repeats(node):
            continue
        for more in (0, 1):
            said = _sample(nodes[:k], flags, more)
            found += [said, *(said + inner for inner in _inner(node, flags))]
        found.append(_sample(nodes[: k + 1], flags, 1))
    return [prefix for prefix in dict.fromkeys(found) if prefix][:MANY]


def _repeats(node: Any) -> bool:
    """Tell whether a node, or anything within it, may be repeated often."""
    return any(op in REPEATS and value[1] > MANY for op, value in _walk([node]))


def _inner(node: Any, flags: int) -> list[str]:
    parts = [] if node[0] in (ops.ASSERT, ops.ASSERT_NOT) else _parts(node)
    return [prefix for part in parts for prefix in _prefixes(list(part), flags)]


def _bodies(pattern: Counted) -> list[str]:
    """Return what groups that are repeated take."""
    found = []
    for op, value in _walk(list(pattern.tree)):
        if op in REPEATS:
            found += [_sample(list(value[2]), pattern.flags, more) for more in (0, 1, 2)]
    return [body for body in dict.fromkeys(found) if len(body) > 1][:MANY]
