"""A slow matcher of regular expressions that counts its steps, as `re` would take them.

It walks the tree that `re` itself parses, with the same backtracking: greedy, lazy, possessive
and atomic repetition, groups, looking ahead and behind. A step is one place of the text at which
one node of the pattern is tried. So growth can be measured by counting, on any machine.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from re import _constants as ops  # type: ignore[attr-defined]  # where `re` keeps its tree
from re import _parser as parser  # type: ignore[attr-defined]
from typing import Any

Next = Callable[[int], int]  # where a match that goes on here ends, or NO
Node = Callable[[int, Next], int]
NO = -1
ONE = (ops.LITERAL, ops.NOT_LITERAL, ops.ANY, ops.IN)
REPEATS = (ops.MAX_REPEAT, ops.MIN_REPEAT, ops.POSSESSIVE_REPEAT)


class TooManyError(Exception):
    """More steps than were allowed."""


def _same(end: int) -> int:
    return end


class Counted:
    """A pattern whose matching is counted in `steps`; above `most` it stops."""

    def __init__(self, pattern: str | bytes, flags: int = 0, *, most: int = 10**9) -> None:
        self.tree = parser.parse(pattern, flags)
        self.flags = self.tree.state.flags
        self.steps, self.most = 0, most
        self.text = ""
        self._whole = self._sequence(list(self.tree))

    def match(self, text: str, at: int = 0) -> int:
        """Return where a match that begins at a place ends, NO for none."""
        self.text = text
        return self._whole(at, _same)

    def find_all(self, text: str) -> list[tuple[int, int]]:
        """Return where all matches begin and end, as `finditer` finds them."""
        found, at = [], 0
        while at <= len(text):
            end = self.match(text, at)
            if end == NO:
                at += 1
                continue
            found.append((at, end))
            at = max(end, at + 1)
        return found

    def _step(self) -> None:
        self.steps += 1
        if self.steps > self.most:
            raise TooManyError

    def _sequence(self, nodes: list[Any]) -> Node:
        """Return what matches nodes one after the other."""
        if not nodes:
            return lambda at, then: then(at)
        first, rest = self._node(nodes[0]), self._sequence(nodes[1:]) if nodes[1:] else None

        def run(at: int, then: Next) -> int:
            self._step()
            return first(at, then if rest is None else lambda end: rest(end, then))

        return run

    def _node(self, node: Any) -> Node:
        op, value = node
        if op in ONE:
            chars = chars_of(node, self.flags)
            return lambda at, then: then(at + 1) if self.text[at : at + 1] in chars else NO
        if op is ops.AT:
            return lambda at, then: then(at) if self._stands(value, at) else NO
        if op is ops.SUBPATTERN:
            return self._sequence(list(value[-1]))
        if op is ops.BRANCH:
            return self._branch([self._sequence(list(branch)) for branch in value[1]])
        if op is ops.ATOMIC_GROUP:
            return self._atomic(self._sequence(list(value)))
        if op in (ops.ASSERT, ops.ASSERT_NOT):
            return self._looks(value, due=op is ops.ASSERT)
        if op in REPEATS:
            return self._repeat(op, *value)
        raise NotImplementedError(f"{op} is no node that is counted")

    def _branch(self, branches: list[Node]) -> Node:
        def run(at: int, then: Next) -> int:
            for branch in branches:
                end = branch(at, then)
                if end != NO:
                    return end
            return NO

        return run

    def _atomic(self, body: Node) -> Node:
        def run(at: int, then: Next) -> int:
            end = body(at, _same)
            return NO if end == NO else then(end)

        return run

    def _looks(self, value: Any, *, due: bool) -> Node:
        direction, body = value
        width = 0 if direction > 0 else body.getwidth()[0]
        seen = self._sequence(list(body))

        def run(at: int, then: Next) -> int:
            found = at >= width and seen(at - width, _same) != NO
            return then(at) if found == due else NO

        return run

    def _repeat(self, op: Any, least: int, most: int, body: Any) -> Node:
        nodes = list(body)
        if len(nodes) == 1 and nodes[0][0] in ONE:
            chars = chars_of(nodes[0], self.flags)
            if op is ops.MIN_REPEAT:
                return self._lazy_run(chars, least, most)
            return self._run(chars, least, most, possessive=op is ops.POSSESSIVE_REPEAT)
        inner = self._sequence(nodes)
        if op is ops.POSSESSIVE_REPEAT:
            return self._atomic(self._many(inner, least, most, lazy=False))
        return self._many(inner, least, most, lazy=op is ops.MIN_REPEAT)

    def _many(self, inner: Node, least: int, most: int, *, lazy: bool) -> Node:
        """Repeat a group."""

        def turn(count: int, at: int, then: Next) -> int:
            def again(end: int) -> int:  # an empty turn leads nowhere
                return NO if end == at and count >= least else turn(count + 1, end, then)

            if lazy and count >= least:
                end = then(at)
                return inner(at, again) if end == NO and count < most else end
            if count < most:
                end = inner(at, again)
                if end != NO or count < least:
                    return end
            return then(at) if count >= least else NO

        return lambda at, then: turn(0, at, then)

    def _run(self, chars: frozenset[str], least: int, most: int, *, possessive: bool) -> Node:
        """Repeat one character as often as may be, then less often."""

        def run(at: int, then: Next) -> int:
            end = at
            while end - at < most and self.text[end : end + 1] in chars:
                self._step()
                end += 1
            if possessive:
                return then(end) if end - at >= least else NO
            while end - at >= least:
                found = then(end)
                if found != NO:
                    return found
                self._step()
                end -= 1
            return NO

        return run

    def _lazy_run(self, chars: frozenset[str], least: int, most: int) -> Node:
        """Repeat one character as seldom as may be, then more often."""

        def run(at: int, then: Next) -> int:
            end = at
            while True:
                found = then(end) if end - at >= least else NO
                if found != NO or end - at >= most or self.text[end : end + 1] not in chars:
                    return found
                self._step()
                end += 1

        return run

    def _stands(self, value: Any, at: int) -> bool:
        before, after = self.text[at - 1 : at] if at else "", self.text[at : at + 1]
        lines = bool(self.flags & re.MULTILINE)
        if value in (ops.AT_BEGINNING, ops.AT_BEGINNING_STRING):
            return at == 0 or (lines and value is ops.AT_BEGINNING and before == "\n")
        if value is ops.AT_END_STRING:
            return not after
        if value is ops.AT_END:
            return not after or (after == "\n" and (lines or at == len(self.text) - 1))
        words = [bool(c) and (c.isalnum() or c == "_") for c in (before, after)]
        return (words[0] != words[1]) == (value is ops.AT_BOUNDARY)


_known: dict[tuple[str, int], frozenset[str]] = {}


def chars_of(node: Any, flags: int) -> frozenset[str]:
    """Return the characters that a node of one takes."""
    key = (repr(node), flags)
    if key not in _known:
        _known[key] = frozenset(c for c in map(chr, range(256)) if taken(node, c, flags))
    return _known[key]


def taken(node: Any, char: str, flags: int) -> bool:
    """Tell whether a node of one character takes this one."""
    op, value = node
    if op is ops.ANY:
        return bool(flags & re.DOTALL) or char != "\n"
    spelled = {char, char.lower(), char.upper()} if flags & re.IGNORECASE else {char}
    codes = {ord(c) for c in spelled if len(c) == 1}
    if op is ops.LITERAL:
        return value in codes
    if op is ops.NOT_LITERAL:
        return value not in codes
    negated, found = False, False
    for kind, what in value:
        if kind is ops.NEGATE:
            negated = True
        elif kind is ops.LITERAL:
            found |= what in codes
        elif kind is ops.RANGE:
            found |= any(what[0] <= code <= what[1] for code in codes)
        else:
            found |= re.match(_CATEGORIES[what], char, re.ASCII) is not None
    return found != negated


_CATEGORIES = {
    ops.CATEGORY_DIGIT: r"\d", ops.CATEGORY_NOT_DIGIT: r"\D", ops.CATEGORY_SPACE: r"\s",
    ops.CATEGORY_NOT_SPACE: r"\S", ops.CATEGORY_WORD: r"\w", ops.CATEGORY_NOT_WORD: r"\W",
}  # fmt: skip
