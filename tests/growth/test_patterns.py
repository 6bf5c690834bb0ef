"""No regular expression takes more than linear steps, on any text that its own parts suggest."""

from __future__ import annotations

import random
import re
import sys

import pytest

from decmcts.formats.gcode.controller.limits import _ONE
from decmcts.formats.gcode.dialects.stated_times import _COUNT
from decmcts.print.machine import USUAL_WORDS, pattern_of
from sim.heads.sync import _pattern as judges_pattern_of
from tests.growth.attacks import attacks, representatives
from tests.growth.found import Use, uses
from tests.growth.matcher import NO, Counted, TooManyError

MADE = [  # patterns that are put together where they are used
    Use("limits.setting", _ONE % b"retract_length", re.M, "search"),
    Use("stated_times._most", _COUNT.pattern % b"R", re.M, "findall"),
    Use("slicer_settings", rb"^;[ \t]*(a|bc)[ \t]*=([^\r\n]*)", re.M, "finditer"),
    Use("words of a machine", pattern_of(USUAL_WORDS.wait), 0, "match"),
    Use("the same, as the judge reads them", judges_pattern_of(USUAL_WORDS.wait).pattern, 0,
        "fullmatch"),
]  # fmt: skip
SMALL, LARGE, SURE = 12, 36, (72, 288)  # characters
MOST_STEPS = 60_000


def dear(use: Use) -> tuple[str, str, str] | None:
    """Return an attack (prefix, piece, end) whose steps grow faster than its length."""
    pattern = use.pattern
    if use.method == "fullmatch":
        whole = (b"(?:%s)\\Z" % pattern) if isinstance(pattern, bytes) else f"(?:{pattern})\\Z"
        pattern = whole
    counted = Counted(pattern, use.flags, most=MOST_STEPS)

    def steps(size: int, prefix: str, piece: str, end: str) -> int:
        text = prefix + piece * (size // len(piece)) + end
        counted.steps = 0
        try:
            if use.looks_through:
                counted.find_all(text)
            else:
                counted.match(text)
        except TooManyError:
            return MOST_STEPS * len(text)
        return counted.steps

    for attack in attacks(counted, pairs=False):
        if steps(LARGE, *attack) > 3.6 * steps(SMALL, *attack) + 60:
            less, more = (steps(size, *attack) for size in SURE)
            if more > 1.3 * less * SURE[1] / SURE[0]:
                return attack
    return None


@pytest.fixture
def deep():
    """Let the slow matcher go deep: a group repeated is a call within a call."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(20_000)
    yield
    sys.setrecursionlimit(before)


@pytest.mark.slow
@pytest.mark.usefixtures("deep")
def test_every_pattern_grows_linearly():
    """A line of 20,000 brackets took a minute: each was where a comment might begin."""
    found = [*uses(), *MADE]
    assert len(found) > 130
    assert {use.where: attack for use in found if (attack := dear(use))} == {}


@pytest.mark.usefixtures("deep")
@pytest.mark.parametrize(
    ("pattern", "method"),
    [
        (r"\([^);]*(?:;|\Z)", "search"),
        (r"(?m)^\s*facet\b", "findall"),
        (r"\s*\(at", "sub"),
        (r"(?: X\d*\.?\d+)*;", "match"),
        (r"\d+\.?\d*", "fullmatch"),
        (r"^\s*a\s*=?\s*b", "match"),
    ],
)
def test_what_grows_faster_is_found(pattern, method):
    """Patterns of ours as they were."""
    assert dear(Use("", pattern, 0, method)) is not None


@pytest.mark.usefixtures("deep")
def test_the_slow_matcher_finds_what_python_finds():
    """Else its steps would be those of another pattern."""
    rng = random.Random(1)
    for use in uses():
        counted = Counted(use.pattern, use.flags)
        letters = [*representatives(counted), *"G1 X;T\n"]
        own = re.compile(use.pattern, use.flags)
        for _ in range(2):
            text = "".join(rng.choice(letters) for _ in range(12))
            given = text.encode("latin-1") if isinstance(use.pattern, bytes) else text
            due = [m.span() for m in own.finditer(given) if m.end() > m.start()]
            assert [s for s in counted.find_all(text) if s[1] > s[0]] == due, (use, text)
            match = own.match(given)
            assert counted.match(text) == (NO if match is None else match.end()), (use, text)
