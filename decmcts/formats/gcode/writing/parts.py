"""A source whose contours are cut into pieces, or of which only a part is left.

The text of contours that are printed goes; start code, end code and the blocks between stay.
Which stretches are left is decided in `decmcts.planning.replanning`, where contours are cut in
`decmcts.team.cutting`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.errors import InputError
from decmcts.formats.gcode.document import NO_ARC, Block, GcodeDocument
from decmcts.print.contours import PER_CONTOUR, Contours
from decmcts.print.job import Barrier, PrintJob


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of one contour of the source, printed as the source runs."""

    of: int  # contour of the source
    points: Floats  # (k, 3) mm
    extrusion: Floats  # (k,) mm of filament of the segment ending here; 0 at first
    feed: Floats  # (k,) mm/s
    row: Ints  # (k,) point of the source whose segment each is a part of
    whole: bool  # it is all of the contour


def contours_of(source: Contours, stretches: Sequence[Stretch]) -> Contours:
    """Return stretches as contours; only whole ones may be loops."""
    of = np.array([s.of for s in stretches], np.int64)
    whole = np.array([s.whole for s in stretches], np.bool_)
    sizes = [len(s.points) for s in stretches]
    values = {name: getattr(source, name)[of] for name in PER_CONTOUR}
    return Contours(
        points=np.concatenate([np.empty((0, 3)), *(s.points for s in stretches)]),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        extrusion=np.concatenate([np.empty(0), *(s.extrusion for s in stretches)]),
        feed=np.concatenate([np.empty(0), *(s.feed for s in stretches)]),
        **{**values, "closed": values["closed"] & whole},
    )


def with_stretches(
    job: PrintJob, document: GcodeDocument, stretches: Sequence[Stretch]
) -> tuple[PrintJob, GcodeDocument]:
    """Return the source with these stretches and nothing else.

    Raises InputError where lines that stay move the head by themselves: they would do so once
    more, through what is printed.
    """
    stretches = [_in_words(stretch, document) for stretch in stretches]
    contours = contours_of(job.contours, stretches)
    first = int(contours.epoch.min(initial=np.iinfo(np.int32).max))
    for block in document.blocks:
        if block.moves and block.epoch <= first:
            raise InputError(
                "these lines move the head and have been run: it would move so once more, through "
                "what is printed", path=document.path, line=block.line,
                advice="take them out of the source",
            )  # fmt: skip
    row = np.concatenate([np.empty(0, np.int64), *(s.row for s in stretches)])
    size = np.diff(contours.offsets)
    whole = np.repeat([s.whole for s in stretches], size)
    of = np.array([s.of for s in stretches], np.int64)
    begins = row[contours.offsets[:-1]] == job.contours.offsets[of]
    rate = None if job.acceleration is None else job.acceleration[row]
    text = replace(
        document,
        point_state=document.point_state[row],
        point_arc=np.where(whole, document.point_arc[row], NO_ARC).astype(np.int32),
        owed=np.where(begins, document.owed[of], 0.0),
    )
    return replace(job, contours=contours, acceleration=rate), text


def _in_words(stretch: Stretch, document: GcodeDocument) -> Stretch:
    """Return a part of arcs, which is written in chords, with filament that E words can say.

    Else each contour would leave what they round off to its retraction.
    """
    if stretch.whole or (document.point_arc[stretch.row] == NO_ARC).all():
        return stretch
    steps = 10.0 ** document.decimals[1] * (document.e_area or 1.0)
    laid = np.round(np.cumsum(stretch.extrusion) * steps) / steps
    return replace(stretch, extrusion=np.diff(laid, prepend=0.0))


def cut_document(document: GcodeDocument, pieces: Contours, row: Ints) -> GcodeDocument:
    """Return the document of pieces.

    Parameters
    ----------
    pieces : Contours
        Of a cut print, with `of` and `along`.
    row : (n_points,)
        Point of the source at the end of the segment that each segment is a part of.
    """
    begins = pieces.offsets[:-1]
    hops = pieces.extrusion == 0.0
    arc = document.point_arc[row]
    arc[hops] = NO_ARC  # so is the first point of each piece
    owed = document.owed[pieces.sources]
    if pieces.along is not None:
        owed[pieces.along[begins] > 0.0] = 0.0
    return replace(document, point_state=document.point_state[row], owed=owed, point_arc=arc)


def has_stiff_arc(document: GcodeDocument, contours: Contours) -> Flags:
    """Tell which contours have an arc that does not read back as the same chords once cut, (n,)."""
    arcs = document.point_arc
    stiff = arcs != NO_ARC
    stiff[stiff] = ~document.arcs.partible[arcs[stiff]]
    return np.asarray(np.logical_or.reduceat(stiff, contours.offsets[:-1]))


def without_blocks(
    job: PrintJob, document: GcodeDocument, left: Collection[int]
) -> tuple[PrintJob, GcodeDocument]:
    """Return a source without some of its blocks, which are no walls then, nor is their text there.

    An epoch that begins at one of them for another reason too stays one.
    """
    last = max(int(job.contours.epoch.max(initial=0)), *(b.epoch for b in document.blocks), 0)
    stays = np.ones(last + 1, np.bool_)
    stays[0] = False
    for k in left:
        stays[document.blocks[k].epoch] = document.blocks[k].edge
    anew = np.cumsum(stays).astype(np.int32)
    gone = {document.blocks[k].epoch for k in left}
    kept = [block for k, block in enumerate(document.blocks) if k not in left]
    blocks = tuple(replace(block, epoch=int(anew[block.epoch])) for block in kept)
    refills = tuple(int(anew[epoch]) for epoch in job.refills if epoch not in gone)
    contours = replace(job.contours, epoch=anew[job.contours.epoch])
    barriers = tuple(_barriers_left(job, [document.blocks[k] for k in sorted(left)], blocks))
    job = replace(job, contours=contours, refills=refills, barriers=barriers)
    return job, replace(document, blocks=blocks)


def _barriers_left(
    job: PrintJob, gone: Sequence[Block], blocks: Sequence[Block]
) -> Iterator[Barrier]:
    """Yield the barriers of a job without those in blocks that are `gone`.

    Of barriers that are alike a job has the first: another takes the place of one that is gone.
    """
    for barrier in job.barriers:
        if not any(block.line <= barrier.line <= block.last_line for block in gone):
            yield barrier
            continue
        word = (barrier.text.split(None, 1) or [""])[0]
        for block in (b for b in blocks if barrier.reason in b.reasons):
            rows = block.text.decode("utf-8", "replace").splitlines()
            texts = [row.split(";", 1)[0].strip() for row in rows]
            alike = [k for k, text in enumerate(texts) if (text.split(None, 1) or [""])[0] == word]
            if alike:
                yield replace(barrier, text=texts[alike[0]], line=block.line + alike[0])
                break
