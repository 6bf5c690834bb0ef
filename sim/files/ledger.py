"""The judge's book of filament: what each tool pushes and pulls, from move to move of the file.

The source is the measure; docs/gcode.md (*What the judge accepts*) has the rules. A stretch is what
lies between two beads, or between a bead and lines that stand word for word as in the source. What
its moves push less what they pull is its *net*. A bead that is begun unretracted in the source is
not begun retracted by the firmware.

All this is counted in running sums of the moves. Nothing that the reader or the writer has found
out about retraction is asked for.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode import GcodeDocument, Motions
from sim.faults import Fault, FaultKind, listed
from sim.files.changes import Taken, gap_filament
from sim.files.commands import Verbatim
from sim.files.extent import tools_of
from sim.files.unretracted import SAME_MM, Spans, Ways, enough_of, farther_unretracted

TOTAL_MM = 1e-4  # by which the filament of a tool may differ in all
NET_MM = 2.1e-3  # of filament; a millesimal may wait for the next retraction, on both sides
NONE = -1
MORE_MM = 0.01  # of filament pushed or pulled at once beyond the source's

LineSpans = Sequence[tuple[int, int] | None]


def check_filament(
    motions: Motions, source: Motions, document: GcodeDocument, places: Verbatim,
    laid: tuple[Ints, Ints], taken: Taken | None = None,
) -> list[Fault]:  # fmt: skip
    """Check the filament of a one-head file against its source's; linear in their moves.

    What the source pushes and pulls for a change of tools goes with that change, as often as the
    file makes it. `places` says where the file has the source's own lines, `laid` which moves of it
    lay beads, (k,), and the source's contour each is of, -1: of none.
    """
    given = document if taken is None else taken.given
    laid = _contours_of(motions, *laid)
    if not len(laid[0]):
        return []
    theirs = np.flatnonzero(np.asarray(source.contour) >= 0)
    spans = lines_in_source(given)
    own = Book.of(source, theirs, np.asarray(source.contour)[theirs], spans)
    book = Book.of(motions, *laid, [(1, places.begin - 1), *places.blocks])
    if taken is not None:
        numbers = np.concatenate([[0], taken.block + 1, [NONE]])  # the last: of no lines
        book = replace(book, lines=numbers[book.lines])
    ways = ways_of(own, source)
    found = farther_unretracted(ways_of(book, motions, ways), ways)
    unretracted = [f"above line {motions.line[book.bead[k + 1]]} {t}" for k, t in found.items()]
    # what is behind a source's last bead is of its end code
    own_places = Verbatim(spans[0][1] + 1, int(source.line[-1]) + 1, tuple(spans[1:]))
    return [
        *_check_totals(motions, source, taken),
        *_check_nets(book, own, motions),
        *_check_depths(book, own, motions),
        *_check_firmware(book, own, motions, source),
        *listed(FaultKind.STATE, unretracted),
        *_check_outer_ways(
            _outer_ways(motions, laid[0], places, ways.enough),
            _outer_ways(source, theirs, own_places, ways.enough),
            ways,
            (int(motions.line[laid[0][0]]), places.end),
        ),
    ]


@dataclass(frozen=True, slots=True)
class NetFilament:
    """What is pushed less what is pulled in stretches of moves, mm."""

    tool: Ints  # (n,) in use there
    net: Floats  # (n,) in all
    low: Floats  # (n,) least running sum within each, 0 or below
    high: Floats  # (n,) greatest, 0 or above

    @staticmethod
    def of(tool: Ints, total: Floats, begin: Ints, end: Ints) -> NetFilament:
        """Take the moves begin..end - 1; `total` is pushed before each move, and by all."""
        pairs = np.stack([begin, end + 1], axis=1).ravel()
        padded = np.append(total, total[-1:])
        low = np.minimum.reduceat(padded, pairs)[::2] - total[begin]
        high = np.maximum.reduceat(padded, pairs)[::2] - total[begin]
        return NetFilament(tool, total[end] - total[begin], low, high)


@dataclass(frozen=True, slots=True)
class Book:
    """The stretches of a file in order: of each contour one before it; two where lines stand."""

    bead: Ints  # (n,) the move each contour begins with
    behind: Ints  # (n,) the move behind the contour before
    contour: Ints  # (n,) of the source
    tool: Ints  # (n,) it is printed with
    lines: Ints  # (n,) which of the source's own lines stand before it: -1 none, 0 the start code
    before: NetFilament  # (n,) between the lines, or else the bead above, and the bead
    above: (
        NetFilament  # (n,) between the bead above and the lines; nothing happens where none stand
    )
    kept: Flags  # (n,) one tool is in use from bead to bead
    deepest: Floats  # (n,) least running sum from bead to bead, the source's own lines included

    @staticmethod
    def of(motions: Motions, laid: Ints, contour: Ints, spans: LineSpans) -> Book:
        """Return the book of the moves between beads; `spans` are the source's own lines."""
        first = np.concatenate([[True], np.diff(contour) != 0])
        bead, behind = laid[first], np.concatenate([[-1], laid[:-1][first[1:]]]) + 1
        line, tools = np.asarray(motions.line), tools_of(motions)
        above, since = behind.copy(), behind.copy()  # a stretch ends, the next begins
        stands = np.full(len(bead), -1, np.int64)
        for number, span in enumerate(spans):
            if span is None:
                continue
            a, b = np.searchsorted(line, (span[0], span[1] + 1)).tolist()
            k = int(np.searchsorted(bead, b))
            if k < len(bead) and b >= behind[k]:
                above[k], since[k], stands[k] = max(a, int(behind[k])), b, number
        total = np.concatenate([[0.0], np.cumsum(np.asarray(motions.extrusion))])
        changes = np.cumsum(np.diff(tools, prepend=tools[:1]) != 0)
        tool, last = tools[bead], tools[np.maximum(behind - 1, 0)]
        upper = NetFilament.of(last, total, behind, above)
        if stands[0] == 0:  # what the start code does is its own
            upper.net[0] = upper.low[0] = upper.high[0] = 0.0
        return Book(
            bead, behind, contour[first], tool, stands,
            NetFilament.of(tool, total, since, bead), upper,
            changes[np.maximum(behind - 1, 0)] == changes[bead],
            NetFilament.of(tool, total, behind, bead).low,
        )  # fmt: skip


def _contours_of(motions: Motions, laid: Ints, contour: Ints) -> tuple[Ints, Ints]:
    """Return the moves of known contours, pauses within them too, and the source's of each."""
    of_run = np.full(int(np.asarray(motions.contour).max(initial=-1)) + 2, -1, np.int64)
    known = contour >= 0
    of_run[np.asarray(motions.contour)[laid[known]]] = contour[known]
    of_run[-1] = -1  # moves of no contour
    each = of_run[np.asarray(motions.contour)]
    rows = np.flatnonzero(each >= 0)
    return rows, each[rows]


def lines_in_source(document: GcodeDocument) -> list[tuple[int, int]]:
    """Return the lines of start code and blocks in the source, first and last, from 1."""
    above = document.preamble.count(b"\n")
    spans = [(b.line, b.last_line) for b in document.blocks]
    return [(1, above), *spans]


def _check_totals(motions: Motions, source: Motions, taken: Taken | None) -> list[Fault]:
    ours, theirs = tools_of(motions), tools_of(source)
    most = int(max(ours.max(initial=0), theirs.max(initial=0))) + 1
    has = np.bincount(ours, np.asarray(motions.extrusion), most)
    due: Floats = np.bincount(theirs, np.asarray(source.extrusion), most).astype(np.float64)
    if taken is not None:
        made = Counter(taken.block.tolist())
        for k in sorted(taken.loose):
            of_change = gap_filament(source, taken.given.blocks[k], theirs, most)
            due = due + (made[k] - 1) * of_change
    lines = [
        f"tool {tool} gives {has[tool]:.5f} mm of filament in all, in the source {due[tool]:.5f}"
        for tool in np.flatnonzero(np.abs(has - due) > TOTAL_MM).tolist()
    ]
    return listed(FaultKind.E_TOTAL, lines)


def _check_nets(book: Book, own: Book, motions: Motions) -> list[Fault]:
    """Compare what the stretches before contours, and around the source's lines, push in all."""
    n = int(max(own.contour.max(initial=0), book.contour.max(initial=0))) + 1
    of_contour, stands = np.zeros(n), _lines_of(book, own)
    of_contour[own.contour] = np.where(own.lines >= 0, 0.0, own.before.net)
    due = of_contour[book.contour] + _by_lines(own, own.before.net)[stands]
    due_above = _by_lines(own, own.above.net)[stands]
    line, at = np.asarray(motions.line), book.bead
    off = np.flatnonzero(np.abs(book.before.net - due) > NET_MM)
    above = np.flatnonzero(np.abs(book.above.net - due_above) > NET_MM)
    lines = [
        f"line {line[at[k]]} begins a bead with {in_words(book.before.net[k])}, "
        f"the source with {in_words(due[k])}"
        for k in off.tolist()
    ]
    lines += [
        f"above line {line[at[k]]} the source's own lines are begun with "
        f"{in_words(book.above.net[k])}, in the source with {in_words(due_above[k])}"
        for k in above.tolist()
    ]
    return listed(FaultKind.STATE, lines)


def _by_lines(own: Book, values: Floats) -> Floats:
    """Return the value at each of the source's own lines, and at last 0, for none of them."""
    found, parted = np.zeros(int(own.lines.max(initial=-1)) + 2), own.lines >= 0
    found[own.lines[parted]] = values[parted]
    return found


def _lines_of(book: Book, own: Book) -> Ints:
    """Return the place in `_by_lines` of what stands before each contour, (n,)."""
    return np.minimum(book.lines, int(own.lines.max(initial=-1)) + 1)  # -1, the last: none


def in_words(net: float) -> str:
    """Return in words what moves leave retracted, or pushed on the spot."""
    if net > 0.0:
        return f"{net:.4g} mm pushed on the spot"
    return f"{abs(net):.4g} mm retracted"


def _check_depths(book: Book, own: Book, motions: Motions) -> list[Fault]:
    """Check that nowhere more is pulled, or pushed beyond it, than the source does with that tool.

    What it does for a change of tools holds above and below that change only.
    """
    every = (own.before, own.above, book.before, book.above)
    n = 1 + int(max(each.tool.max() for each in every))
    kept, stands = own.kept & (np.arange(len(own.bead)) > 0), _lines_of(book, own)
    retracts, pushes = np.zeros(n), np.zeros(n)
    np.maximum.at(retracts, own.tool[kept], np.abs(own.deepest[kept]))
    np.maximum.at(pushes, own.tool[kept], own.before.high[kept])
    texts = list[str]()
    for ours, theirs in ((book.before, own.before), (book.above, own.above)):
        tool, low, high = ours.tool, ours.low, ours.high
        most = np.maximum(retracts[tool], _by_lines(own, -theirs.low)[stands])
        highest = pushes[tool] + _by_lines(own, theirs.high)[stands]
        deep, up = -low - most > MORE_MM, high - highest > MORE_MM
        wrong = np.flatnonzero(deep | up)
        texts += [
            f"above line {motions.line[book.bead[k]]} tool {tool[k]} "
            + (
                f"retracts {-low[k]:.4g} mm, in the source {most[k]:.4g} at most"
                if deep[k]
                else f"pushes {high[k]:.4g} mm on the spot, in the source {highest[k]:.4g} at most"
            )
            for k in wrong.tolist()
        ]
    return listed(FaultKind.STATE, texts)


def _check_firmware(book: Book, own: Book, motions: Motions, source: Motions) -> list[Fault]:
    """Check that the firmware retracts only for tools for which it does in the source.

    And that no bead is begun retracted by it which in the source is not.
    """
    if motions.withdrawn is None:
        return []
    within = slice(int(book.bead[0]), int(book.bead[-1]))
    theirs = np.unique(tools_of(source)[_withdrawn(source)])
    foreign = within.start + np.flatnonzero(
        _withdrawn(motions)[within] & ~np.isin(tools_of(motions)[within], theirs)
    )
    texts = [
        f"above line {motions.line[k]} the firmware retracts, in the source it does not for tool "
        f"{tools_of(motions)[k]}"
        for k in foreign.tolist()
    ]
    due = np.zeros(int(max(own.contour.max(), book.contour.max())) + 1, np.bool_)
    due[own.contour] = _withdrawn(source)[own.bead]
    wrong = np.flatnonzero(_withdrawn(motions)[book.bead] & ~due[book.contour])
    texts += [
        f"line {motions.line[book.bead[k]]} begins a bead retracted by the firmware"
        for k in wrong.tolist()
    ]
    return listed(FaultKind.STATE, texts)


def ways_of(book: Book, motions: Motions, source: Ways | None = None) -> Ways:
    """Return the ways from each contour to the next; None: of the source itself."""
    extrusion, plain = np.asarray(motions.extrusion), book.kept & (book.lines < 0)
    spans = Spans(book.behind[1:], book.bead[1:], book.tool[1:], plain[1:])
    enough = enough_of(extrusion, spans) if source is None else source.enough
    return Ways.of(np.asarray(motions.points), extrusion, _withdrawn(motions), spans, enough)


def _check_outer_ways(ways: Ways, usual: Ways, theirs: Ways, lines: tuple[int, int]) -> list[Fault]:
    """Check the ways from the start code to the first bead and from the last to the end code.

    As all others; but the first may go as the source's own first way does, and where that does not
    retract it is not judged. `usual` are the source's, `lines` those at which ours end.
    """
    found = farther_unretracted(ways, theirs)
    as_source = ways.retracts[0] and ways.unretracted[0] <= usual.unretracted[0] + SAME_MM
    if as_source or not (usual.plain[0] and usual.retracts[0]):
        found.pop(0, None)
    return listed(FaultKind.STATE, [f"above line {lines[k]} {text}" for k, text in found.items()])


def _outer_ways(
    motions: Motions, laid: Ints, places: Verbatim, enough: Mapping[int, float]
) -> Ways:
    """Return the way from the start code to the first bead, and that from the last one to the end.

    They are plain where one tool is in use and no block stands in them.
    """
    line, tools = np.asarray(motions.line), tools_of(motions)
    extrusion = np.asarray(motions.extrusion)
    first, behind = int(laid[0]), int(laid[-1]) + 1
    begin = min(int(np.searchsorted(line, places.begin)), first)
    bounds = [(begin, first), (behind, max(behind, int(np.searchsorted(line, places.end))))]
    stand = [int(np.searchsorted(line, span[0])) for span in places.blocks if span is not None]
    tool = [int(tools[max(a - 1, 0)]) for a, _ in bounds]
    plain = [
        bool((tools[a : b + 1] == t).all()) and not any(a <= k <= b for k in stand)
        for (a, b), t in zip(bounds, tool, strict=True)
    ]
    given = np.cumsum(np.where(tools[:begin] == tool[0], extrusion[:begin], 0.0))
    already = np.zeros(len(bounds))
    already[0] = given.max(initial=0.0) - (given[-1] if begin else 0.0)
    starts, ends = np.array(bounds, np.int64).T
    spans = Spans(starts, ends, np.array(tool, np.int64), np.array(plain, np.bool_))
    return Ways.of(
        np.asarray(motions.points), extrusion, _withdrawn(motions), spans, enough, already=already
    )


def _withdrawn(motions: Motions) -> Flags:
    """Tell before which moves the firmware has retracted, (m,)."""
    n = len(motions.line)
    return np.zeros(n, np.bool_) if motions.withdrawn is None else np.asarray(motions.withdrawn)
