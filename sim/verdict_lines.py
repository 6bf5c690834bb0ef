"""What was judged, in plain sentences: how much of it, by which rules, and how near it came.

One source of these words for `decmcts verify` and for the report. Nothing is judged here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from sim.faults import Gap, Verdict

PLAN_RULES = (
    "contours: each once, whole, as it is sliced or reversed, by a head that reaches it and has "
    "its tool",
    "paths: joined end to end, from park to park, with the nominal times that motion needs",
    "order: what lies below, shells, priming, barriers, contacts of the source; no deadlock",
    "print: no head touches what may be printed by then, in any timing",
    "heads: their bodies keep their clearance and rails their order, in any timing; replayed too",
    "cooling: no spot is printed over too soon",
    "figures: what the plan states of itself",
)
GCODE_RULES = (
    "extrusions: each of the source's once, in its place, with its filament, feed and arcs",
    "commands: the source's, each once and between the same beads; settings and temperatures",
    "filament: what is pushed and pulled between every two beads, and how fast",
    "order: barriers, priming, contacts of the source",
    "moves: within the machine's and the source's extent, and none touches what is printed",
)
HEADS_RULES = (
    "files: each its head's actions, one after the other, with the source's commands for it",
    "signals: what all files' sync points order together is what must be",
)


@dataclass(frozen=True, slots=True)
class Sentence:
    """One thing that was checked or found."""

    about: str  # "checked": how much, "nearest", "rule", or "asked": what it was held to
    text: str
    where: str = ""  # of the nearest: what the one and the other did there

    def __str__(self) -> str:
        return self.text if self.about == "asked" else f"{self.about}: {self.text}"


def sentences(verdict: Verdict) -> list[Sentence]:
    """Return what was checked, how near it came, by which rules, and what was asked for."""
    counts, found = verdict.counts, []
    if counted := _counted(counts):
        found.append(Sentence("checked", counted))
    found += [Sentence("checked", line) for line in _timings(counts)]
    for gap, words in _gaps(verdict):
        least = "at least " if gap.at_least else ""
        text = f"{words}: {least}{millimetres(gap.mm)} mm ({gap.required_mm:g} mm required)"
        found.append(Sentence("nearest", text, " beside ".join(gap.at)))
    rules: tuple[str, ...] = PLAN_RULES if "actions" in counts else ()
    if "files" in counts:
        rules += HEADS_RULES
    elif "moves" in counts and not rules:
        rules = GCODE_RULES
    found += [Sentence("rule", rule) for rule in rules]
    return found + [Sentence("asked", line) for line in verdict.checked]


def checked_lines(verdict: Verdict, *, verbose: bool = False) -> list[str]:
    """Return these sentences, a line each; `verbose`: with all rules, and where it came nearest.

    Examples
    --------
    >>> checked_lines(Verdict((), {"moves": 1200, "segments": 900}))
    ['checked: 900 beads, 1,200 moves']
    """
    lines = []
    for sentence in sentences(verdict):
        if verbose or sentence.about != "rule":
            lines.append(str(sentence))
        if verbose and sentence.where:
            lines.append(f"  {sentence.where}")
    return lines


def nearest_facts(verdict: Verdict) -> dict[str, Any]:
    """Return how near it came as `--json` prints it."""
    found = {"heads": verdict.nearest.heads, "beside": verdict.nearest.beside}
    return {name: None if gap is None else asdict(gap) for name, gap in found.items()}


def _counted(counts: Mapping[str, float]) -> str:
    words = []
    for key, one, many in (
        ("files", "file", "files"),
        ("contours", "contour", "contours"),
        ("segments", "bead", "beads"),
        ("actions", "action", "actions"),
        ("moves", "move", "moves"),
        ("signals", "sync point", "sync points"),
    ):
        if key in counts:
            words.append(_many(counts[key], one, many))
            if key == "actions":
                words[-1] += f" of {_many(counts.get('heads', 1), 'head', 'heads')}"
    return ", ".join(words)


def _timings(counts: Mapping[str, float]) -> list[str]:
    """Return how heads were looked at beside each other; nothing of one head."""
    if counts.get("heads", 1) < 2:
        return []
    pairs = _many(counts.get("pairs", 0), "pair", "pairs")
    trials = f"{counts.get('trials', 0):,.0f} of them random"
    return [
        f"{pairs} of actions that may run at once, in any timing; "
        f"{_many(counts.get('replays', 0), 'timing', 'timings')} replayed, {trials}"
    ]


def _many(count: float, one: str, many: str) -> str:
    return f"{count:,.0f} {one if count == 1 else many}"


def _gaps(verdict: Verdict) -> list[tuple[Gap, str]]:
    """Return the least gaps that were measured, with what they are between."""
    found = []
    if (heads := verdict.nearest.heads) is not None:
        found.append((heads, f"heads {' and '.join(heads.heads)}"))
    if (beside := verdict.nearest.beside) is not None:
        found.append((beside, "head and print, where a bead stands higher beside it"))
    return found


def millimetres(value: float) -> str:
    """Return a distance to the µm, never rounded up.

    Examples
    --------
    >>> millimetres(10.0169), millimetres(5.0), millimetres(0.9999999)
    ('10.016', '5', '0.999')
    """
    return f"{int(value * 1000.0 + 1e-6) / 1000.0:g}"
