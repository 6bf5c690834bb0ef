"""Slicers export to a temporary name: what stands beside a file has the name it gets later."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.planning.problem.source import HOST, NAME, beside, exported_file, is_foreign


def test_the_final_name_is_the_slicers(tmp_path: Path) -> None:
    """PrusaSlicer's graphical program hands over a copy and renames it at the end."""
    copy, final = tmp_path / ".1234.gcode.pp", tmp_path / "my part.gcode"
    assert exported_file(copy, {}) == copy
    assert exported_file(copy, {NAME: str(final)}) == final
    assert exported_file(copy, {NAME: str(final), HOST: "File"}) == final


@pytest.mark.parametrize(
    ("said", "host", "name"),
    [
        ("part.gcode", "OctoPrint", "part.gcode"),  # to a printer: a name, no place
        ("folder/part.gcode", "PrusaLink", "part.gcode"),
        ("/no/such/folder/part.gcode", "File", "part.gcode"),
        ("part.gcode", "File", "part.gcode"),  # relative to nobody knows what
        ("..", "File", "copy.gcode"),
        ("/", "", "copy.gcode"),
        ("/tmp/", "", "copy.gcode"),
        ("a\0b", "", "copy.gcode"),
        ("", "File", "copy.gcode"),
    ],
)
def test_a_place_that_is_none_costs_only_the_place(
    tmp_path: Path, said: str, host: str, name: str
) -> None:
    """Then the folder is that of the file that was handed over."""
    copy = tmp_path / "copy.gcode"
    found = exported_file(copy, {NAME: said, HOST: host})
    assert found.parent == tmp_path
    assert found.name == name


@pytest.mark.parametrize(
    ("name", "stem"),
    [("a.gcode", "a"), ("a.b.gcode.gz", "a.b"), ("a.gcode.3mf", "a"), ("A.GCODE", "A"),
     ("a.bgcode", "a"), ("a.gx", "a"), ("a", "a"), (".gcode", ".gcode"), ("a.g", "a")],
)  # fmt: skip
def test_what_stands_beside_a_file_has_its_name(name: str, stem: str) -> None:
    """Without what says that it is G-code; nothing is left without a name."""
    assert beside(Path("x") / name, ".report.html") == Path("x") / f"{stem}.report.html"


def test_what_others_made_is_known(tmp_path: Path) -> None:
    """A name that follows from another must not cost a file that somebody wrote."""
    assert not is_foreign(tmp_path / "none")
    for content, foreign in ((b"precious", True), (b'<meta content="decmcts">', False)):
        (tmp_path / "a.report.html").write_bytes(content)
        assert is_foreign(tmp_path / "a.report.html") is foreign
    (tmp_path / "link").symlink_to(tmp_path / "a.report.html")
    assert is_foreign(tmp_path / "link") and is_foreign(tmp_path)
