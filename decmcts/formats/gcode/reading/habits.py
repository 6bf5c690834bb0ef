"""How the source retracts, hops, wipes and travels, read from its gaps.

Whether it leaves travels inside the part bare is learned too. Cura's combing shows in nothing
else; PrusaSlicer's and Slic3r's settings name it (`only_retract_when_crossing_perimeters`), and
then a single such travel is enough.
"""

from __future__ import annotations

import re
from dataclasses import astuple, dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode.controller.limits import FirmwareRetraction, commanded, stated_limits
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.dialects.stated_times import silent_share
from decmcts.formats.gcode.document import Habits
from decmcts.formats.gcode.reading.beads import Parsed
from decmcts.formats.gcode.reading.gaps import PULLED, Gaps
from decmcts.formats.slicers.known import either, every
from decmcts.print.contours import Contours
from decmcts.print.job import ProcessSettings, Retraction
from decmcts.print.motion_kernels import TRAVELLING
from decmcts.print.walls import bare_pairs, outer_walls
from decmcts.print.walls_kernels import SAME_Z_MM

ALIKE = 0.01  # share by which the habits of two tools may differ and be one
LONGEST_BARE_MM = 5.0  # travel without retraction, for a source that retracts at all
_RULE = re.compile(rb"^;\s*(?:%b) *[=,] *([\d., ]+)" % either("layer_time"), re.M)
_RULE_ON = re.compile(rb"^;\s*(?:%b) *[=,] *([01, ]+)" % either("slows"), re.M)
_FOLDED_RULE = re.compile(rb"(?:%b)\s*=\s*([\d.]+)" % either("folded_layer_time"))
_FOLD = re.compile("|".join(every("folds")).encode())
CONFIG_BYTES = 2**20  # of a file's beginning and end: slicers write their settings there
LONGEST_RULE_S = 600.0  # what is beyond this is no layer time
_DIAMETER = re.compile(rb"filament_?\s*diameter\s*[=:,]\s*(\d*+\.?\d*+)", re.I)
HABIT_SHARE = 0.8  # of the long travels inside the part that must be bare
LEAST_SEEN = 5  # of them, where no setting names the habit; of changes to a next layer, always
ROUNDED_MM = 5e-4  # of a length; travels as long as one that is retracted are too
LAYERS = 2.0  # layer heights a change to a next layer may climb
_BARE_INSIDE = re.compile(rb"^; *(?:%b) *= *1" % either("bare_inside"), re.M)


def filament_diameter(text: bytes) -> float:
    """Return the filament diameter a file names, 1.75 mm when it names none."""
    match = _DIAMETER.search(text)
    value = float(match.group(1).strip(b".") or 0) if match else 0.0
    return value if 0.5 < value < 10.0 else 1.75


def min_layer_time(text: bytes) -> float:
    """Return the layer time in seconds below which the slicer slows down, 0 when it never does.

    With several filaments the longest of those that are slowed for.
    """
    if len(text) > 2 * CONFIG_BYTES:
        text = text[:CONFIG_BYTES] + text[-CONFIG_BYTES:]
    rule, on = _last_of(_RULE, text), _last_of(_RULE_ON, text)
    if rule is None:
        rule = _last_of(_FOLDED_RULE, _FOLD.sub(b"", text))
    if rule is None:
        return 0.0
    on = [1.0] if on is None else on
    slowed = [s for k, s in enumerate(rule) if on[min(k, len(on) - 1)] > 0.0]
    longest = max(slowed, default=0.0)
    return longest if longest <= LONGEST_RULE_S else 0.0


def _last_of(pattern: re.Pattern[bytes], text: bytes) -> list[float] | None:
    """Return the numbers of the last match of a setting, None when there is none."""
    found = pattern.findall(text)
    numbers = re.findall(rb"\d+\.?\d*|\.\d+", found[-1]) if found else []
    return [float(number) for number in numbers] or None


def _usual(values: Floats, weights: Floats | None = None) -> float:
    """Return the value with the most weight, 0 for none."""
    if not len(values):
        return 0.0
    kinds, index = np.unique(np.round(values, 6), return_inverse=True)
    return float(kinds[np.argmax(np.bincount(index, weights))])


def infer_settings(parsed: Parsed, gaps: Gaps) -> tuple[ProcessSettings, Habits]:
    """Return the retraction, lift, wipe and travel of a print as its gaps show them."""
    text, motion = parsed.lines.text, parsed.motion
    moves = _GapMoves.of(parsed)
    delta = np.diff(motion.points, axis=0)
    travel = moves.gap & ~moves.still & ~moves.pull & ~moves.push
    upright = moves.gap & moves.still & ~moves.pull & ~moves.push & (np.abs(delta[:, 2]) > 1e-9)
    pulled = gaps.pulled
    length = np.linalg.norm(motion.points[gaps.end] - motion.points[gaps.begin], axis=1)
    of_tool = _retractions(parsed, gaps, moves)
    usual = max(of_tool, key=lambda tool: (of_tool[tool][1], -tool))
    has = [t for t, (one, _) in of_tool.items() if one.firmware_retraction or one.retract_mm > 0.0]
    retracts = np.isin(gaps.tool, has)
    settings = ProcessSettings(
        travel_feed=_usual(motion.feed[travel], moves.across[travel]),
        retract_min_travel_mm=_threshold(length[retracts], pulled[retracts]),
        z_feed=_usual(motion.feed[upright]),
        travel_acceleration=_usual_acceleration(parsed, travel, np.linalg.norm(delta, axis=1)),
        min_layer_time_s=min_layer_time(text),
        of_tools=((usual, of_tool[usual][0]),),
    ).for_tool(usual)
    main = of_tool[usual][0]
    others = [(tool, one) for tool, (one, _) in of_tool.items() if not _alike(one, main)]
    settings = replace(settings, of_tools=tuple(sorted(others, key=lambda each: each[0])))
    return settings, _habits(parsed)


@dataclass(frozen=True, slots=True)
class _GapMoves:
    """What the moves of a file do between contours, each (m,)."""

    gap: Flags  # between the first contour and the last, of none
    still: Flags  # not across the bed
    pull: Flags
    push: Flags
    across: Floats  # mm
    tool: Ints

    @staticmethod
    def of(parsed: Parsed) -> _GapMoves:
        motion, runs = parsed.motion, parsed.runs
        gap = np.zeros(len(motion.extrusion), np.bool_)
        gap[runs.first[0] : runs.last[-1] + 1] = True
        delta = np.diff(motion.points, axis=0)
        across = np.hypot(delta[:, 0], delta[:, 1])
        return _GapMoves(
            gap & (runs.contour < 0), across < 1e-9, motion.extrusion < -1e-5,
            motion.extrusion > 1e-5, across, motion.tool(),
        )  # fmt: skip


def _alike(one: Retraction, other: Retraction) -> bool:
    """Tell whether two tools retract the same way; wipes are measured, and vary a little."""
    return bool(np.allclose(astuple(one), astuple(other), rtol=ALIKE, atol=1e-6))


def _retractions(parsed: Parsed, gaps: Gaps, moves: _GapMoves) -> dict[int, tuple[Retraction, int]]:
    """Return how each tool retracts between contours of its own, and how many it prints.

    A tool that shows no retraction there has none: what it pulls for a change of tools is no
    habit, and no more may be pulled than the source does.
    """
    motion, runs = parsed.motion, parsed.runs
    of_contour = motion.tool(runs.first)
    found: dict[int, tuple[Retraction, int]] = {}
    for tool in np.unique(of_contour).tolist():
        own, made = (gaps.tool == tool) & ~gaps.changes, moves.tool == tool
        feeds = tuple(
            _usual(motion.feed[moves.gap & made & moves.still & way]) or 40.0
            for way in (moves.pull, moves.push)
        )
        pulled = gaps.depth[own & (gaps.depth > PULLED)]
        amount = round(float(np.median(pulled)), 6) if len(pulled) else 0.0
        by_firmware = bool(gaps.firmware[own].sum() * 2 > max(1, gaps.pulled[own].sum()))
        if by_firmware:  # moves show neither its length nor its feeds
            last = int(motion.line[runs.last[np.flatnonzero(of_contour == tool)[-1]]])
            firmware = FirmwareRetraction.of(parsed.lines.text, parsed.track)
            pull, push = (firmware.at(last, pull=way) for way in (True, False))
            amount, feeds = -pull[0], (pull[1], push[1])
        wiping = moves.gap & made & ~moves.still & moves.pull
        habit = Retraction(
            amount, feeds[0], feeds[1], _hop(motion, gaps, gaps.pulled & own), by_firmware,
            **_wipe(motion, gaps, wiping, moves.across, gaps.pulled & own),
        )  # fmt: skip
        found[tool] = habit, int((of_contour == tool).sum())
    return found


def _usual_acceleration(parsed: Parsed, travel: Flags, length: Floats) -> float:
    """Return the acceleration most travel is made with as commands set it, 0 for none."""
    track, stated = parsed.track, stated_limits(parsed.lines.text)
    acceleration = commanded(track.table, TRAVELLING, stated)[track.at(parsed.motion.line[travel])]
    known = ~np.isnan(acceleration)
    return _usual(acceleration[known], length[travel][known])


def _habits(parsed: Parsed) -> Habits:
    """Return what commands between the first bead and the last show."""
    lines, motion, runs = parsed.lines, parsed.motion, parsed.runs
    first, last = int(motion.line[runs.first[0]]), int(motion.line[runs.last[-1]])
    rows = np.flatnonzero(lines.are("M", (730,))[first:last]) + first
    words = b"".join({lines.raw(k).split(b";")[0].upper() for k in rows.tolist()})
    return Habits(
        resets_e=bool(lines.are("G", (920,))[first:last].any()),
        progress="".join(letter for letter in "PRQS" if letter.encode() in words),
        silent_share=silent_share(lines.text),
    )


def _threshold(length: Floats, pulled: Flags) -> float:
    """Return the travel length that best parts retracted from plain travels.

    At most `LONGEST_BARE_MM`: a source that retracts only where it crosses a
    wall leaves long travels bare inside its own parts; ours lead elsewhere.
    """
    if not pulled.any():
        return 2.0
    order = np.argsort(length, kind="stable")
    kept = np.concatenate([[0], np.cumsum(pulled[order])])  # retracted but shorter
    wrong = kept + np.concatenate([np.cumsum(~pulled[order][::-1])[::-1], [0]])
    cut = int(np.argmin(wrong))
    best = float(length[order[cut]]) - ROUNDED_MM if cut < len(length) else np.inf
    return float(min(max(0.0, round(best, 4)), LONGEST_BARE_MM))


def _hop(motion: Motion, gaps: Gaps, pulled: Flags) -> float:
    """Return how far retracted travels rise above both their ends."""
    begin, end = gaps.begin, gaps.end  # points: where a gap starts and stops
    pairs = np.stack([begin, end + 1], axis=1).ravel()
    if not len(pairs) or not pulled.any():
        return 0.0
    z = np.append(motion.points[:, 2], -np.inf)
    highest = np.maximum.reduceat(z, pairs)[::2]
    rise = highest - np.maximum(z[begin], z[end])
    return max(0.0, float(round(np.median(rise[pulled]), 4)))


def _wipe(
    motion: Motion, gaps: Gaps, wiping: Flags, across: Floats, pulled: Flags,
) -> dict[str, float]:  # fmt: skip
    """Return the settings of the usual wipe; none when most gaps have none."""
    run = np.concatenate([[0.0], np.cumsum(np.where(wiping, across, 0.0))])
    taken = np.concatenate([[0.0], np.cumsum(np.where(wiping, -motion.extrusion, 0.0))])
    begin, end = gaps.begin, gaps.end
    length, filament = run[end] - run[begin], taken[end] - taken[begin]
    has = length > 1e-3
    if not has.any() or has.sum() * 2 < pulled.sum():
        return {}
    return {
        "wipe_mm": float(np.median(length[has])),
        "wipe_filament_mm": float(np.median(filament[has])),
        "wipe_feed": _usual(motion.feed[wiping], across[wiping]),
    }


def with_bare_travels(
    text: bytes, contours: Contours, settings: ProcessSettings, pulled: Flags
) -> ProcessSettings:
    """Return the settings with the travels inside the part that the source leaves bare.

    Their greatest length is learned, and their greatest climb to a next layer; 0 for no such habit.
    `pulled` says whether the source retracts between a contour and the next, (n - 1,).
    """
    if not pulled.any():
        return settings
    start, goal = contours.end[:-1], contours.start[1:]
    length = np.linalg.norm(goal - start, axis=1)
    long = np.flatnonzero(length >= settings.retract_min_travel_mm)
    most = LAYERS * float(np.median(contours.height))
    walls = outer_walls(contours)
    inside = long[bare_pairs(walls, np.inf, start[long], goal[long], climb_mm=most)]
    rise = goal[inside, 2] - start[inside, 2]
    climbs = rise > SAME_Z_MM
    least = 1 if _BARE_INSIDE.search(text) else LEAST_SEEN
    longest = _longest(inside[~climbs], length, pulled, least)
    if longest == 0.0:
        return settings
    bare = ~pulled[inside[climbs]]
    if bare.sum() < max(LEAST_SEEN, HABIT_SHARE * len(bare)):
        return replace(settings, bare_inside_mm=longest)
    return replace(
        settings,
        bare_inside_mm=max(longest, _longest(inside, length, pulled, least)),
        bare_climb_mm=float(np.ceil(1000.0 * rise[climbs][bare].max() - 1e-3) / 1000.0),
    )


def _longest(inside: Ints, length: Floats, pulled: Flags, least: int) -> float:
    """Return the longest bare one of these travels, 0 if too few of the long ones are bare."""
    order = inside[np.argsort(length[inside], kind="stable")]
    bare = ~pulled[order]
    # up to where the source most often does as the rule would: bare before, retracted beyond
    right = np.concatenate([[0], np.cumsum(np.where(bare, 1, -1))])
    kept = int(np.argmax(right))
    seen = int(bare[:kept].sum())
    if seen < least or seen < HABIT_SHARE * kept:
        return 0.0
    return float(np.ceil(1000.0 * length[order[:kept][bare[:kept]]].max()) / 1000.0)
