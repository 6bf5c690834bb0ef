"""The judge's book of filament over the files of several heads.

The source is the measure, as in `sim.files.ledger`; docs/gcode.md has the rules (*Files of several
heads*). A bead takes with it what the source's moves push less what they pull in the gap before it
(its *net*), whichever head prints it. What stands beside lines of the source that are kept word for
word (blocks) belongs to the contour behind them, or, where a block may move filament unseen, to
each head that has its lines. Each head begins with as much retracted as the start code leaves.

How much is retracted is counted here, from the moves of the files and of the source.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.formats.gcode import GcodeDocument, Motions
from decmcts.formats.gcode.document import Block
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from sim.content.pieces import beginnings
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.files.extent import tools_of
from sim.files.ledger import (
    MORE_MM,
    NET_MM,
    TOTAL_MM,
    Book,
    in_words,
    lines_in_source,
    ways_of,
)
from sim.files.unretracted import Spans, Ways, farther_unretracted
from sim.heads.changes import NO_GAP, behind, belongs_to_bead, gaps_of_tools
from sim.heads.file import ContourMoves
from sim.heads.one_file import Walked


@dataclass(frozen=True, slots=True)
class Dues:
    """What the source does with filament around its contours and its own lines, mm.

    Where contours are cut, each row is a piece: what goes with a contour goes with the piece that
    has its beginning.
    """

    net: Floats  # (n,) goes with each contour
    extrusion: Floats  # (n,) of each contour or piece
    above: Floats  # (b,) pushed less pulled above each block since the bead before; NaN: unknown
    left: Floats  # (b,) pushed behind each block beyond what is retracted there
    usual: dict[int, float]  # most that each tool retracts from bead to bead while it is in use
    beside: Floats  # (b,) most that is retracted above each block, or behind it
    shared: bool  # several tools print
    starts: dict[int, float]  # likewise, by tool, behind the start code or a change left out
    ways: Ways  # from contour to contour


def dues_of(job: PrintJob, document: GcodeDocument) -> Dues:
    """Return the source's own account; linear in its moves.

    The moves have the source's numbers of contours, `job` may have pieces of them.
    """
    source, begins = document.moves, beginnings(job.contours)
    contour, extrusion = np.asarray(source.contour), np.asarray(source.extrusion)
    laid = np.flatnonzero(contour >= 0)
    spans = lines_in_source(document)
    book = Book.of(source, laid, contour[laid], spans)
    n, tools, line = len(begins), tools_of(source), np.asarray(source.line)
    owed = {t: _owed(np.where(tools == t, extrusion, 0.0)) for t in np.unique(tools).tolist()}
    left, above = np.zeros(len(document.blocks)), np.full(len(document.blocks), np.nan)
    net, start = np.zeros(n), 0.0
    for k, c in enumerate(book.contour.tolist()):
        stands = int(book.lines[k])
        if stands < 0:
            net[c] = book.before.net[k]
            continue
        at = int(np.searchsorted(line, spans[stands][1] + 1))
        pushed = float(book.before.net[k] - owed[tools[book.bead[k]]][at])
        if stands == 0:
            start = pushed
        else:
            above[stands - 1], left[stands - 1] = book.above.net[k], pushed
            net[c] = pushed if belongs_to_bead(document.blocks[stands - 1]) else 0.0
    beside = np.zeros(len(document.blocks))
    parted = book.lines > 0
    deep = -np.minimum(np.minimum(book.before.low, book.above.low), book.deepest)
    beside[book.lines[parted] - 1] = deep[parted]
    kept = book.kept & (np.arange(len(book.bead)) > 0)
    usual = {t: float(-book.deepest[kept & (book.tool == t)].min(initial=0.0)) for t in owed}
    given = np.asarray(np.bincount(contour[laid], extrusion[laid], n), np.float64)
    number = job.contours.tool[begins].astype(np.int64)
    shared = len(np.unique(job.contours.tool)) > 1
    starts = dict[int, float]()
    if document.own_starts:
        primes = {tool: practice.prime_mm for tool, practice in job.practices}
        starts = _without_changes(source, number, document, owed, net, book, primes)
    starts[document.start.tool if shared else int(number[0])] = start
    net, given = _of_pieces(job.contours, begins, net, given)
    return Dues(net, given, above, left, usual, beside, shared, starts, ways_of(book, source))


def _without_changes(
    source: Motions, number: Ints, document: GcodeDocument, owed: dict[int, Floats], net: Floats,
    book: Book, primes: Mapping[int, float],
) -> dict[int, float]:  # fmt: skip
    """Put into `net` what belongs to contours behind changes that are left out.

    `number` is the tool of each contour, `primes` what primes each tool. Returns what the source
    pushes behind the first change to each tool, beyond what is retracted.
    """
    since = gaps_of_tools(source, number)
    free = [c for k, c in enumerate(book.contour.tolist()) if book.lines[k] < 0]
    for c in free:
        changed = c > 0 and number[c] != number[c - 1] and c in since
        net[c] = since.get(c, NO_GAP).net - (primes.get(int(number[c]), 0.0) if changed else 0.0)
    starts, line = dict[int, float](), np.asarray(source.line)
    tools, given = tools_of(source), np.asarray(source.extrusion)
    for own in document.own_starts:
        at = int(np.searchsorted(line, own.line + 1))
        first = int(np.flatnonzero(number == own.tool)[0])
        bead = int(book.bead[book.contour == first][0])
        pushed = float(given[at:bead][tools[at:bead] == own.tool].sum())
        starts[own.tool] = pushed - float(owed[own.tool][at])
    return starts


def _of_pieces(
    contours: Contours, begins: Ints, net: Floats, given: Floats
) -> tuple[Floats, Floats]:
    """Return net and filament of each piece, of those of the source's contours.

    Filament of a contour that is not cut is what the source's moves give; what the pieces of a cut
    one have was held against the contour before (`sim.content.pieces`).
    """
    of, first = contours.sources, np.zeros(len(contours))
    first[begins] = net
    parted = np.bincount(of, minlength=len(begins))[of] > 1
    own = np.add.reduceat(contours.extrusion, contours.offsets[:-1])
    return first, np.where(parted, own, given[of])


def _owed(extrusion: Floats) -> Floats:
    """Return what is retracted before each move and behind all, (m + 1,) mm."""
    pulled = np.concatenate([[0.0], np.cumsum(-extrusion)])
    return np.asarray(pulled - np.minimum.accumulate(pulled))


def check_filament(walked: Sequence[Walked], job: PrintJob, document: GcodeDocument) -> list[Fault]:
    """Check the filament of all heads' files against the source's; linear in their moves."""
    printing = [each for each in walked if each.walk.laid]
    if not printing:
        return []
    dues, texts, over = dues_of(job, document), list[str](), dict[int, float]()
    for each in printing:
        account = _Account(each, dues, job, document)
        texts += [f"head {each.file.name}, {text}" for text in account.run()]
        over[account.tool] = over.get(account.tool, 0.0) + account.over
    lines = [
        f"the files of all heads give {abs(much):.5f} mm of filament of tool {tool} "
        f"{'more' if much > 0.0 else 'less'} than the source does"
        for tool, much in over.items()
        if abs(much) > TOTAL_MM
    ]
    return [*listed(FaultKind.STATE, texts), *listed(FaultKind.E_TOTAL, lines)]


class _Account:
    """Goes through one file from bead to bead and keeps what is retracted."""

    def __init__(self, walked: Walked, dues: Dues, job: PrintJob, document: GcodeDocument) -> None:
        self.dues, self.job, self.document = dues, job, document
        self.motion, self.part, self.idling = walked.file.motion, walked.part, walked.idling
        self.beads = walked.walk.laid
        self.tool = int(job.contours.tool[self.beads[0].contour])
        total = np.concatenate([[0.0], np.cumsum(self.motion.extrusion)])
        self.total: list[float] = total.tolist()  # given before each move, and by all
        self.parked = float(_owed(self.motion.extrusion[: self.part.begin])[-1])
        self.retracted = self.parked
        self.retracted += dues.starts.get(self.tool, 0.0)
        self.parked = max(self.parked, self.retracted)  # or as the source left its tool before
        self.most = max(0.0, self.retracted)  # that may be, beyond what is usual
        self.at = self.part.begin  # the move behind the last bead, or the source's own lines
        self.last = -1  # the move behind the last bead
        self.over = 0.0  # mm given beyond what is due
        self.changed = False  # whether the source's own change of tools stands before the next bead
        self.texts: list[str] = []
        self.between: list[tuple[int, int]] = []  # moves from bead to bead, begin and end

    def run(self) -> list[str]:
        """Return what is wrong, in words."""
        mine = {bead.contour for bead in self.beads}
        blocks = list(zip(self.document.blocks, self.part.blocks, strict=True))
        crossed = 0
        for bead in self.beads:
            epoch, self.changed = int(self.job.contours.epoch[bead.contour]), False
            while crossed < len(blocks) and blocks[crossed][0].epoch <= epoch:
                block, lines = blocks[crossed]
                self._cross(crossed, block, lines, behind(block, self.job) in mine)
                self.changed |= "tool change" in block.reasons
                crossed += 1
            self._begin(bead)
        self.texts += self._unretracted()
        pushed = self.total[max(self.part.end, self.at)] - self.total[self.at]
        for _, lines in blocks[crossed:]:  # the source's own lines, which stand behind all beads
            if lines:
                first, last = (self.motion.before[k] for k in (lines[0] - 1, lines[-1]))
                pushed -= float(self.total[last] - self.total[first])
        if pushed > NET_MM:
            self.texts.append(f"{pushed:.4g} mm are pushed on the spot behind the last bead")
        elif pushed > 0.0:  # what was too little to stop for, and is due to earlier beads
            self.over += pushed
        return self.texts[:LIMIT]

    def _begin(self, bead: ContourMoves) -> None:
        """Check the stretch before a bead, and the bead."""
        dues = self.dues
        due = self.retracted + float(dues.net[bead.contour])
        leaves = self.parked >= dues.ways.enough.get(self.tool, np.inf)  # retracted
        from_park = leaves and self.last < 0 and self.at == self.part.begin
        if (from_park or self.last == self.at) and self.at <= bead.begin:
            self.between.append((self.at, bead.begin))
        if self.at > bead.begin:  # lines in another order, which is a fault of its own
            self.at = bead.begin
        pulled = self.idling.pulled is None or bead.contour in self.idling.pulled
        deep = self.idling.practice.retract_mm if pulled else 0.0
        net = self._stretch(bead.begin, f"bead of contour {bead.contour}", deep)
        prime = 0.0 if self.changed else self.idling.practice.prime_mm
        if self.idling.primed is None:  # files tell no times
            due += prime if abs(net - due - prime) <= NET_MM else 0.0
        elif bead.contour in self.idling.primed:
            due += prime
        if abs(net - due) > NET_MM:
            self.texts.append(
                f"line {self._line(bead.begin)} begins contour {bead.contour} with "
                f"{in_words(net - self.retracted)}, the source with "
                f"{in_words(due - self.retracted)}"
            )
        given = self.total[bead.end] - self.total[bead.begin]
        self.over += net - due + given - float(dues.extrusion[bead.contour])
        self.at = self.last = bead.end
        self.retracted = self.most = 0.0

    def _unretracted(self) -> list[str]:
        """Check that the head travels unretracted no farther than the source does.

        From its park, if it is retracted there, and back to it too.
        """
        if 0 <= self.last <= self.part.end:
            self.between.append((self.last, self.part.end))
        begin, end = np.array(self.between, np.int64).reshape(-1, 2).T
        motion, n = self.motion, len(begin)
        spans = Spans(begin, end, np.full(n, self.tool), np.ones(n, np.bool_))
        theirs, pulled = self.dues.ways, motion.withdrawn
        already = np.where(begin == self.part.begin, self.parked, 0.0)
        ways = Ways.of(
            motion.points, motion.extrusion, pulled, spans, theirs.enough, parted=True,
            already=already,
        )  # fmt: skip
        found = farther_unretracted(ways, theirs, parted=True).items()
        return [f"above line {self._line(int(end[k]))} {text}" for k, text in found]

    def _cross(self, number: int, block: Block, lines: Sequence[int], mine: bool) -> None:
        """Check the stretch above a block's lines, and take over what they do."""
        own = mine or not belongs_to_bead(block)
        if own:
            self.most = max(self.most, float(self.dues.beside[number]))
        if lines:
            motion = self.motion
            first, last = (int(motion.before[k]) for k in (lines[0] - 1, lines[-1]))
            if first < self.at:
                return  # moved, which is a fault of its own
            net = self._stretch(first, f"block of line {block.line}")
            above = float(self.dues.above[number])
            if own and self._mine(block.begin.tool) and np.isfinite(above):
                due = self.retracted + above
                if abs(net - due) > NET_MM:
                    self.texts.append(
                        f"above line {lines[0]} the source's line {block.line} is begun with "
                        f"{in_words(net - self.retracted)}, in the source with {in_words(above)}"
                    )
                self.over += net - due
                self.retracted = -above
            else:
                feeds = bool(motion.extrusion[first:last].any())  # as its tool was left, then
                if net > (max(0.0, self.retracted) if feeds else 0.0) + NET_MM:
                    self.texts.append(
                        f"above line {lines[0]} {net:.4g} mm are pushed on the spot for no bead"
                    )
                self.retracted -= net
            for filament in motion.extrusion[first:last].tolist():
                self.retracted = max(0.0, self.retracted - filament)
            self.at = last
        runs = bool(lines) or block.begin.tool != block.end.tool
        if not belongs_to_bead(block) and runs and self._mine(block.end.tool):
            self.retracted += float(self.dues.left[number])

    def _stretch(self, end: int, what: str, deep_mm: float = 0.0) -> float:
        """Return the net of the moves up to `end`; notes where they retract too much.

        As much as `deep_mm` may be retracted there.
        """
        begun = self.total[self.at]
        least = min(self.total[self.at : end + 1]) - begun
        most = max(self.most, self.dues.usual.get(self.tool, 0.0), deep_mm)
        if least < -MORE_MM and (deep := max(self.retracted, 0.0) - least) > most + MORE_MM:
            self.texts.append(
                f"above line {self._line(end)}, before the {what}, tool {self.tool} has "
                f"{deep:.4g} mm retracted, in the source {most:.4g} at most"
            )
        return self.total[end] - begun

    def _mine(self, tool: int) -> bool:
        return not self.dues.shared or tool == self.tool

    def _line(self, move: int) -> int:
        lines = self.motion.line
        return int(lines[min(move, len(lines) - 1)]) + 1
