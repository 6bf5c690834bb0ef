"""What `verify` says besides faults."""

from __future__ import annotations

from sim.faults import Gap, Nearest, Verdict
from sim.verdict_lines import GCODE_RULES, HEADS_RULES, PLAN_RULES, checked_lines, nearest_facts

PLAN = {
    "contours": 2532, "actions": 5066, "heads": 2, "trials": 3, "moves": 103471, "pairs": 1832408,
    "replays": 13,
}  # fmt: skip
HEADS = Gap(10.0169, 5.0, ("left", "right"), ("head left action 5", "head right action 3"))
BESIDE = Gap(5.0, 0.0, ("left",), (), at_least=True)


def test_a_plan_of_two_heads():
    """How much was looked at, and how near it came, is what "no fault" rests on."""
    verdict = Verdict((), PLAN, ("order: as asked",), nearest=Nearest(HEADS, BESIDE))
    lines = [
        "checked: 2,532 contours, 5,066 actions of 2 heads, 103,471 moves",
        "checked: 1,832,408 pairs of actions that may run at once, in any timing; "
        "13 timings replayed, 3 of them random",
        "nearest: heads left and right: 10.016 mm (5 mm required)",
        "nearest: head and print, where a bead stands higher beside it: at least 5 mm "
        "(0 mm required)",
        "order: as asked",
    ]
    assert checked_lines(verdict) == lines
    more = checked_lines(verdict, verbose=True)
    assert [line for line in more if line in lines] == lines
    assert "  head left action 5 beside head right action 3" in more
    assert [line for line in more if line.startswith("rule: ")] == [
        f"rule: {r}" for r in PLAN_RULES
    ]


def test_each_kind_of_result_has_rules_of_its_own():
    """G-code has no timings to speak of; heads' files are held to their plan's rules too."""

    def rules(counts):
        lines = checked_lines(Verdict((), counts), verbose=True)
        return tuple(line[6:] for line in lines if line.startswith("rule: "))

    assert rules({"moves": 5, "segments": 1}) == GCODE_RULES
    assert rules({**PLAN, "files": 2, "signals": 1}) == (*PLAN_RULES, *HEADS_RULES)
    assert rules({}) == ()
    assert checked_lines(Verdict((), {"moves": 5, "segments": 1})) == ["checked: 1 bead, 5 moves"]
    assert checked_lines(Verdict(())) == []


def test_what_was_not_measured_is_null():
    """A program must tell that from 0 mm."""
    facts = nearest_facts(Verdict((), nearest=Nearest(beside=BESIDE)))
    assert facts == {
        "heads": None,
        "beside": {"mm": 5.0, "at_least": True, "required_mm": 0.0, "heads": ("left",), "at": ()},
    }
