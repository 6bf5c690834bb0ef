"""Pieces part their contours exactly, or the judge says what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.print.contours import PER_CONTOUR, Contours, Role
from decmcts.print.cut import CutLines, Grid, cut_job
from decmcts.print.job import PrintJob
from decmcts.print.walls import outer_walls
from sim.content.pieces import parted_source
from sim.faults import FaultKind
from tests.prints import slab

Spoil = Callable[[Contours], Contours]


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> PrintJob:
    return read_gcode(slab(tmp_path_factory.mktemp("slab") / "slab.gcode", layers=2))[0]


@pytest.fixture(scope="module")
def pieces(job: PrintJob) -> Contours:
    return cut_at(job, [90.0, 130.0, 171.3]).contours


def cut_at(job: PrintJob, places: list[float], hop_mm: float | None = None) -> PrintJob:
    """Cut all contours of a job at places along X."""
    n = len(job.contours)
    lines = CutLines(0, np.tile(places, n), len(places) * np.arange(n + 1, dtype=np.int64))
    whole = np.zeros(len(job.contours.points), np.bool_)
    if hop_mm is None:
        hop_mm = 0.999 * job.settings.retract_min_travel_mm
    walls = outer_walls(job.contours)
    return cut_job(
        job, lines, walls=walls, hop_mm=hop_mm, hop_feed=150.0, whole=whole, grid=Grid()
    )[0]


@pytest.mark.parametrize("seed", range(8))
def test_pieces_part_their_contours_exactly(job: PrintJob, seed: int) -> None:
    """Wherever contours are cut: every point, all filament, nothing twice."""
    random = np.random.default_rng(seed)
    places = np.sort(random.uniform(45.0, 255.0, int(random.integers(1, 12)))).tolist()
    cut = cut_at(job, places, hop_mm=float(random.uniform(0.0, job.settings.retract_min_travel_mm)))
    parted = parted_source(cut.contours, job, "all")
    assert parted.faults == () and parted.row is not None
    assert len(cut.contours) > len(job.contours)
    for c in range(len(job.contours)):
        laid = cut.contours.extrusion[np.isin(_owner(cut.contours), np.flatnonzero(_of(cut) == c))]
        due = job.contours.extrusion[_owner(job.contours) == c].sum()
        assert laid.sum() == pytest.approx(due, abs=1e-12)
        assert np.abs(laid * 1e5 - np.round(laid * 1e5)).max() < 1e-6  # as a file has it


def test_strips_are_what_lies_between_lines(pieces: Contours) -> None:
    """A piece of infill is all of one strip that the slicer would not retract between."""
    low = np.minimum.reduceat(pieces.points[:, 0], pieces.offsets[:-1])
    high = np.maximum.reduceat(pieces.points[:, 0], pieces.offsets[:-1])
    edges = np.array([0.0, 90.0, 130.0, 171.3, 300.0])
    strip = np.searchsorted(edges, (low + high) / 2) - 1
    assert (low >= edges[strip] - 1.1).all() and (high <= edges[strip + 1] + 1.1).all()


def test_pieces_are_listed_by_where_they_begin(job: PrintJob, pieces: Contours) -> None:
    """As the format has it; what comes first in the source has the smaller number."""
    begin = pieces.along[pieces.offsets[:-1]]  # type: ignore[index]  # the pieces are cut
    pair = int(np.flatnonzero(np.diff(pieces.sources) == 0)[0])
    assert begin[pair] < begin[pair + 1]
    faults = parted_source(exchanged(pieces, pair), job, "all").faults
    assert [f.text for f in faults] == [f"piece {pair + 1} begins before piece {pair} on contour 0"]


def exchanged(pieces: Contours, first: int) -> Contours:
    """Exchange two pieces that stand one behind the other in the list."""
    order = np.arange(len(pieces))
    order[[first, first + 1]] = [first + 1, first]
    sizes = np.diff(pieces.offsets)[order]
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    rows = np.concatenate([np.arange(pieces.offsets[k], pieces.offsets[k + 1]) for k in order])
    each = {name: getattr(pieces, name)[order] for name in (*PER_CONTOUR, "of")}
    names = ("points", "extrusion", "feed", "along")
    points = {name: getattr(pieces, name)[rows] for name in names}
    return replace(pieces, offsets=offsets, **each, **points)


def test_a_hop_is_as_fast_as_a_travel(job: PrintJob) -> None:
    """By the source, or where it states nothing by the machine."""
    cut = cut_at(job, [90.0, 130.0, 171.3], hop_mm=30.0).contours
    far = replace(job, settings=replace(job.settings, retract_min_travel_mm=40.0))
    silent = replace(far, settings=replace(far.settings, travel_feed=0.0))
    assert parted_source(cut, far, "all").faults == ()
    assert parted_source(cut, silent, "all").faults == ()
    assert parted_source(cut, silent, "all", travel_feed=150.0).faults == ()
    for source, feed in ((far, None), (silent, 100.0)):
        spoilt = cut if feed else replace(cut, feed=np.where(cut.extrusion > 0, cut.feed, 200.0))
        faults = parted_source(spoilt, source, "all", travel_feed=feed).faults
        assert faults and "hops" in faults[0].text


def _owner(contours: Contours) -> np.ndarray:
    return np.repeat(np.arange(len(contours)), np.diff(contours.offsets))


def _of(job: PrintJob) -> np.ndarray:
    return job.contours.sources


def altered(name: str, at: int, by: float) -> Spoil:
    """Return what adds to one number of the pieces."""

    def spoil(pieces: Contours) -> Contours:
        values = np.array(getattr(pieces, name), dtype=np.float64)
        values.reshape(-1)[at] += by
        return replace(pieces, **{name: values.astype(getattr(pieces, name).dtype)})

    return spoil


def without_one(pieces: Contours) -> Contours:
    """Drop the second piece."""
    begin, end = pieces.offsets[1], pieces.offsets[2]
    kept = np.delete(np.arange(len(pieces.points)), np.arange(begin, end))
    offsets = np.delete(np.where(np.arange(len(pieces) + 1) > 1, pieces.offsets - (end - begin),
                                 pieces.offsets), 1)  # fmt: skip
    rows = {
        name: np.delete(getattr(pieces, name), 1)
        for name in ("width", "height", "role", "closed", "layer", "tool", "reversible", "epoch",
                     "line", "of")
    }  # fmt: skip
    points = {
        name: getattr(pieces, name)[kept] for name in ("points", "extrusion", "feed", "along")
    }
    return replace(pieces, offsets=offsets, **rows, **points)


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (altered("extrusion", 1, 2e-5), FaultKind.EXTRUSION),
        (altered("extrusion", 1, -0.5), FaultKind.EXTRUSION),
        (altered("feed", 1, 1.0), FaultKind.EXTRUSION),
        (altered("points", 0, 0.01), FaultKind.CONTOUR),
        (altered("along", 1, 0.01), FaultKind.CONTOUR),
        (altered("of", 0, 1), FaultKind.CONTOUR),
        (altered("of", -1, 99), FaultKind.CONTOUR),
        (altered("width", 0, 0.1), FaultKind.CONTOUR),
        (altered("layer", 0, 1), FaultKind.CONTOUR),
        (altered("role", 0, 3), FaultKind.CONTOUR),
        (altered("closed", 0, 1), FaultKind.CONTOUR),
        (without_one, FaultKind.MISSING),
    ],
)
def test_what_is_spoilt_is_found(
    job: PrintJob, pieces: Contours, spoil: Spoil, kind: FaultKind
) -> None:
    """Of pieces that were right; each by the rule it breaks."""
    assert parted_source(pieces, job, "all").faults == ()
    faults = parted_source(spoil(pieces), job, "all").faults
    assert kind in {fault.kind for fault in faults}


def test_what_must_not_be_reversed_stays_so(job: PrintJob, pieces: Contours) -> None:
    """A piece may be reversed only if its contour may."""
    never = replace(job.contours, reversible=np.zeros(len(job.contours), np.bool_))
    faults = parted_source(pieces, replace(job, contours=never), "all").faults
    assert any("may be reversed" in fault.text for fault in faults)


def test_outside_is_cut_only_if_allowed(job: PrintJob, pieces: Contours) -> None:
    """`inside` leaves outer walls whole; without a word nothing may be cut."""
    names = {
        cut: {f.text.split(" (")[1].split(")")[0] for f in parted_source(pieces, job, cut).faults
              if "is cut" in f.text}
        for cut in ("none", "inside", "all")
    }  # fmt: skip
    outer, inner = Role.EXTERNAL_PERIMETER.name.lower(), Role.PERIMETER.name.lower()
    assert names["all"] == set() and names["inside"] == {outer}
    assert {outer, inner} <= names["none"]


def hops_of(pieces: Contours) -> np.ndarray:
    """Return how long the hops within pieces are."""
    begins = np.isin(np.arange(len(pieces.points)), pieces.offsets[:-1])
    hop = np.flatnonzero((pieces.extrusion == 0.0) & ~begins)
    return np.linalg.norm(pieces.points[hop] - pieces.points[hop - 1], axis=1)


def test_lines_of_infill_are_one_piece_though_the_slicer_would_retract_between_them(
    job: PrintJob,
) -> None:
    """They lie 4 mm apart, the source retracts from 2 mm on: what oozes inside does not show."""
    pieces = cut_at(job, [90.0, 130.0, 171.3]).contours
    assert job.settings.retract_min_travel_mm < hops_of(pieces).max() < 5.0
    assert parted_source(pieces, job, "all").faults == ()


def test_a_long_hop_is_found(job: PrintJob) -> None:
    """The slicer would have retracted for it, and it shows."""
    wall = np.where(job.contours.role == Role.INFILL, Role.PERIMETER, job.contours.role)
    shown = replace(job, contours=replace(job.contours, role=wall))
    far = cut_at(shown, [90.0, 130.0], hop_mm=30.0).contours
    assert any("hops" in fault.text for fault in parted_source(far, shown, "all").faults)
    short = cut_at(shown, [90.0, 130.0]).contours
    assert hops_of(short).max(initial=0.0) < job.settings.retract_min_travel_mm


def test_no_hop_leads_over_an_outer_wall(job: PrintJob) -> None:
    """Of infill either: a wall between two of its lines is another island's, or a hole's."""
    points, contours = job.contours.points.copy(), job.contours
    for c in np.flatnonzero(contours.role == Role.EXTERNAL_PERIMETER):
        points[contours.offsets[c] : contours.offsets[c + 1], 1] = 151.0  # through the infill
    crossed = replace(job, contours=replace(contours, points=points))
    far = cut_at(crossed, [90.0, 130.0], hop_mm=4.9).contours
    assert any("hops" in fault.text for fault in parted_source(far, crossed, "all").faults)
    assert parted_source(cut_at(crossed, [90.0, 130.0]).contours, crossed, "all").faults == ()


def test_hops_in_infill_are_short_too(job: PrintJob) -> None:
    points = job.contours.points.copy()
    points[:, 1] = 150.0 + 2.0 * (points[:, 1] - 150.0)  # lines 8 mm apart
    wide = replace(job, contours=replace(job.contours, points=points))
    far = cut_at(wide, [90.0, 130.0], hop_mm=30.0).contours
    assert any("hops" in fault.text for fault in parted_source(far, wide, "all").faults)
    assert parted_source(cut_at(wide, [90.0, 130.0]).contours, wide, "all").faults == ()


@pytest.mark.parametrize("seed", range(4))
def test_hops_that_just_miss_a_wall_or_the_longest_are_judged_alike(
    job: PrintJob, seed: int
) -> None:
    """Cuts are rounded to the file's digits behind the planner's look at them."""
    random = np.random.default_rng(seed)
    contours, points = job.contours, job.contours.points.copy()
    for c in np.flatnonzero(contours.role == Role.EXTERNAL_PERIMETER):
        rows = slice(contours.offsets[c], contours.offsets[c + 1])
        points[rows, 0] = 90.0 + random.uniform(-1e-3, 1e-3, rows.stop - rows.start)
    points[:, 1] = 150.0 + (5.0 + random.uniform(-2e-3, 2e-3)) / 4.0 * (points[:, 1] - 150.0)
    near = replace(job, contours=replace(contours, points=points))
    for place in 90.0 + random.uniform(-2e-3, 2e-3, 8):
        pieces = cut_at(near, [place, 130.0]).contours
        assert parted_source(pieces, near, "all").faults == ()
