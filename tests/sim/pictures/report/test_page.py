"""The page is one file that needs nothing else, and holds what the plans hold."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from decmcts.planning.problem.source import is_foreign
from decmcts.print.plan import ActionKind
from sim.pictures.drawings import draw_plan
from sim.pictures.report import ReportDetails, write_report
from sim.pictures.report.blobs import Blobs
from sim.pictures.report.page import LIBRARIES, PAGE, SCRIPTS, STYLES
from tests.sim.pictures.report.unpacking import array_at, page_of

# of the files in npm's regl 2.1.1 and uplot 1.6.32, dist folders (page/vendor/package-lock.json)
LOCKED = {
    "regl.min.js": "6d14aa47e560de0d0f0d37ec7b4868274245125a6de4022010e9c0fdcc5a4b62",
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}


def test_the_libraries_are_those_of_the_lock_file():
    """Nobody reads 130 kB of small code: it must be what npm gave."""
    for name, digest in LOCKED.items():
        data = (files("sim.pictures.report") / "page" / "vendor" / name).read_bytes()
        assert hashlib.sha256(data).hexdigest() == digest


def test_every_piece_is_in_the_page():
    """A script nobody names would not be there."""
    there = {piece.name for piece in PAGE.iterdir() if piece.name.endswith((".js", ".css"))}
    assert there == {name for name in (*SCRIPTS, *STYLES) if "/" not in name}
    assert {name for name in LIBRARIES if (PAGE / name).is_file()} == set(LIBRARIES)


def test_the_name_of_the_source_may_be_no_text(make, tmp_path):
    """Bytes of another encoding ended `plan --report` with an internal error."""
    document = make.two_head_plan()
    details = ReportDetails(file="teil\udcfc.gcode")
    write_report(tmp_path / "r.html", before=document, after=document, details=details)
    assert "<title>teil?.gcode" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_the_page_needs_no_network(make, tmp_path):
    """A report opened on a print farm without internet must work."""
    document = make.two_head_plan()
    write_report(tmp_path / "r.html", before=document, after=document)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img)[^>]+src=", page)
    assert re.findall(r'<link[^>]+href="([^"]*)"', page) == ["data:,"]
    assert "<!--" not in page


def test_reports_and_pictures_say_who_made_them(make, tmp_path):
    """By that `post` knows what it may replace."""
    document = make.tower_plan()
    write_report(tmp_path / "r.html", before=document, after=document)
    for name in ("p.png", "p.svg"):
        draw_plan(tmp_path / name, document, document)
    for name in ("r.html", "p.png", "p.svg"):
        assert not is_foreign(tmp_path / name)


def test_names_cannot_break_the_page(make, tmp_path):
    """Names come from files; they are text, not markup."""
    document = make.tower_plan()
    evil = "</script><script>alert(1)</script>"
    actions = replace(document.plan.heads[0], head=evil)
    document = replace(document, plan=replace(document.plan, heads=(actions,)))
    write_report(tmp_path / "r.html", before=document, after=document, details=ReportDetails(evil))
    assert evil not in (tmp_path / "r.html").read_text(encoding="utf-8")
    assert page_of(tmp_path / "r.html")["plans"][1]["heads"][0]["name"] == evil


@pytest.mark.parametrize("name", ["tower_plan", "two_head_plan"])
def test_the_page_holds_the_plan(make, name, tmp_path):
    """Contours, order, direction and times are what plan.json has."""
    document = getattr(make, name)()
    write_report(tmp_path / "r.html", before=document, after=document)
    page = page_of(tmp_path / "r.html")
    points = np.stack([page["contours"][axis] for axis in "xyz"], axis=1)
    assert points == pytest.approx(document.contours.points, abs=0.006)
    assert page["contours"]["sizes"].tolist() == np.diff(document.contours.offsets).tolist()
    for actions, head in zip(document.plan.heads, page["plans"][1]["heads"], strict=True):
        assert head["name"] == actions.head
        for column in ("kind", "contour", "reversed", "entry"):
            assert head[column].tolist() == getattr(actions, column).astype(int).tolist()
        end = np.cumsum(head["idle"] + head["lasts"])
        assert end / 1e3 == pytest.approx(actions.end_s, abs=0.002)
        assert (end - head["lasts"]) / 1e3 == pytest.approx(actions.begin_s, abs=0.002)
        travels = actions.kind != ActionKind.PRINT
        told = np.diff(actions.path_offsets)[travels].sum() - head["kept"].sum()
        known = (head["known"].astype(int)[:, None] >> [0, 1]) & 1
        assert told == known[travels].sum() > 0  # ends beside contours are known from these
        assert head["kept"][~travels].sum() == 0


def test_the_page_is_json_that_browsers_read(make, tmp_path):
    """NaN and numpy numbers would stop the page's script."""
    document = make.tower_plan()
    after = replace(document, metrics={"bound_mm": None, "gap_percent": None, "seed": 3})
    history = [(0.0, 9, 2.0), (1.0, 99, 1.0)]
    write_report(tmp_path / "r.html", before=document, after=after, history=history)
    page = page_of(tmp_path / "r.html")
    assert page["history"]["cost"] == [2.0, 1.0]
    plain = json.loads(json.dumps(page, default=lambda array: array.tolist()), parse_constant=str)
    assert plain["facts"]["settings"] == [["seed", 3]]


@pytest.mark.parametrize("delta", [False, True])
@pytest.mark.parametrize("high", [3, 300, 70_000])
def test_arrays_come_back_as_steps(high, delta):
    """As narrow as their values allow, and never another value."""
    values = np.random.default_rng(5).uniform(-high, high, 500)
    blobs = Blobs()
    blobs.add(np.arange(7))
    place = blobs.add(values, step=0.01, delta=delta)
    raw = b"".join(blobs._parts)
    assert array_at(place, raw) == pytest.approx(values, abs=0.0051)
    wide = high == 70_000 or (delta and high == 300)
    assert place["type"] == ("i32" if wide else "i16")
