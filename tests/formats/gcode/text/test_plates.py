"""G-code in a .gcode.3mf and in a .gx: there and back, and what is refused."""

from __future__ import annotations

import hashlib
import io
import struct
import zipfile

import pytest

from decmcts.errors import InputError
from decmcts.formats.files.archive import Archive
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.text import flashprint, plates
from decmcts.formats.gcode.text.source_text import has_plates, load_text, packed_text
from decmcts.formats.mesh import is_mesh
from tests.formats.gcode.text.packed import BITMAP, GOOD, POOR, gcode_3mf, gx


def in_zip(raw: bytes, name: str) -> bytes:
    return zipfile.ZipFile(io.BytesIO(raw)).read(name)


@pytest.mark.parametrize("sums", ["upper", "lower"])
def test_the_checksum_is_that_of_the_new_gcode_in_the_source_s_letters(sums):
    """A printer refuses a file whose sum is wrong."""
    made = plates.pack(GOOD, gcode_3mf({1: POOR}, sums=sums))
    due = hashlib.md5(GOOD, usedforsecurity=False).hexdigest()
    stated = in_zip(made, "Metadata/plate_1.gcode.md5").decode()
    assert stated == (due.upper() if sums == "upper" else due)
    assert plates.unpack(made) == GOOD


def test_no_checksum_is_invented():
    """Where the source has none the result has none."""
    made = plates.pack(GOOD, gcode_3mf({1: POOR}, sums=""))
    assert "Metadata/plate_1.gcode.md5" not in zipfile.ZipFile(io.BytesIO(made)).namelist()


def test_a_wrong_checksum_in_the_source_is_refused():
    """The G-code was changed behind the printer's back: who knows by whom."""
    whole = gcode_3mf({1: POOR})
    changed = Archive(whole).replaced({"Metadata/plate_1.gcode": GOOD})
    with pytest.raises(InputError, match=r"is not what .*md5 is the checksum of"):
        plates.unpack(changed)


def test_one_of_several_plates_is_named_and_the_others_stay():
    """Another plate's G-code in the place of this one would be printed."""
    whole = gcode_3mf({2: POOR, 11: GOOD})
    assert plates.plates_in(whole) == [2, 11]
    with pytest.raises(InputError, match=r"the G-code of plates 2 and 11; add --plate N"):
        plates.unpack(whole)
    with pytest.raises(InputError, match=r"plate 1 has no G-code in this file, plates 2 and 11"):
        plates.unpack(whole, plate=1)
    made = plates.pack(b"G28\n", whole, plate=11)
    assert plates.unpack(made, plate=2) == POOR
    assert plates.unpack(made, plate=11) == b"G28\n"


def test_a_project_is_a_mesh_and_a_sliced_file_is_none(tmp_path):
    """By what is in it; a file called .gcode.3mf must have been sliced."""
    for name, whole, sliced in (
        ("project.3mf", gcode_3mf({}), False),
        ("sliced.3mf", gcode_3mf({1: POOR}), True),
        ("none.gcode.3mf", gcode_3mf({}), True),
        ("damaged.3mf", gcode_3mf({1: POOR})[:-40], False),
    ):
        path = tmp_path / name
        path.write_bytes(whole)
        assert (has_plates(path), is_mesh(path)) == (sliced, not sliced), name
    with pytest.raises(InputError, match="no plate in this archive has G-code"):
        load_text(tmp_path / "none.gcode.3mf")


def test_a_plate_of_a_plain_file_is_refused(tmp_path):
    """Whoever names one has another file in mind."""
    path = tmp_path / "part.gcode"
    path.write_bytes(POOR)
    with pytest.raises(InputError, match=r"no plate 2: only a \.gcode\.3mf has plates"):
        load_text(path, 2)


def test_packed_files_read_as_the_text_in_them(tmp_path):
    """Same extrusions, and a name without what stands around them."""
    for name, whole in (("a.gcode.3mf", gcode_3mf({1: POOR})), ("a.gx", gx(POOR))):
        path = tmp_path / name
        path.write_bytes(whole)
        job, document = read_gcode(path)
        assert len(job.contours) == 20
        assert job.name == "a"
        assert document.preamble.startswith(b"; HEADER_BLOCK_START")


@pytest.mark.parametrize("name", ["out.gcode.3mf", "out.gx"])
def test_what_has_no_packed_source_is_not_packed(name, tmp_path):
    """There would be no thumbnail, no settings: a file that no printer takes."""
    plain = tmp_path / "in.gcode"
    plain.write_bytes(POOR)
    with pytest.raises(InputError, match="is only made of another one"):
        packed_text(POOR, tmp_path / name, plain)


@pytest.mark.parametrize("second_picture", [b"", b"PNG" * 99])
def test_the_header_of_a_gx_stays_but_for_its_time(second_picture):
    """The time is on the printer's screen; pictures and temperatures stay."""
    whole = gx(POOR, second_picture=second_picture)
    assert flashprint.unpack(whole) == POOR
    made = flashprint.pack(GOOD, whole, time_ratio=0.5)
    begin = len(whole) - len(POOR)
    assert struct.unpack_from("<I", made, 28)[0] == 377
    assert made[:28] + made[32:begin] == whole[:28] + whole[32:begin]
    assert BITMAP in made
    assert made[begin:] == GOOD


@pytest.mark.parametrize("cut", [11, 30, 57, 700])
def test_a_damaged_gx_is_refused(cut):
    """In one line, not with an error of struct."""
    with pytest.raises(InputError, match=r"damaged \.gx file"):
        flashprint.unpack(gx(POOR)[:cut])


def test_a_gx_whose_header_points_elsewhere_is_refused():
    """At itself, or behind the end."""
    for begin in (0, 57, 2**31):
        whole = bytearray(gx(POOR))
        struct.pack_into("<I", whole, 24, begin)
        with pytest.raises(InputError, match="does not say where"):
            flashprint.unpack(bytes(whole))
