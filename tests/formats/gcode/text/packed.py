"""Files that G-code is packed in, made as slicers make them: .gcode.3mf and .gx."""

from __future__ import annotations

import hashlib
import io
import struct
import zipfile
from collections.abc import Iterable, Mapping

WHEN = (2024, 5, 17, 12, 34, 56)
PICTURE = b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 20
SUM_OF = {"upper": str.upper, "lower": str.lower}
BITMAP = b"BM" + bytes(range(250)) * 4
GX_FIELDS = (754, 1234, 0, 11, 200, 20, 3, 60, 60, 210, 210, 1)  # time, filament, ...


def squares_text(places: Iterable[tuple[float, float]], *, layers: int = 2) -> bytes:
    """Return G-code as OrcaSlicer makes it for Bambu's printers: a square loop at each place."""
    lines = [
        "; HEADER_BLOCK_START", "; OrcaSlicer 2.3.1 on 2025-01-01",
        "; model printing time: 12m 34s; total estimated time: 18m 40s",
        "; total layer number: 2", "; HEADER_BLOCK_END", "",
        "; CONFIG_BLOCK_START", "; printer_model = Bambu Lab P1S", "; nozzle_diameter = 0.4",
        "; extruder_clearance_radius = 68", "; extruder_clearance_height_to_rod = 36",
        "; nozzle_height = 4.2", "; printable_area = 0x0,256x0,256x256,0x256",
        "; filament_diameter = 1.75", "; CONFIG_BLOCK_END", "", "; EXECUTABLE_BLOCK_START",
        "M104 S220", "G90", "M83", "G28", "G1 Z5 F600",
    ]  # fmt: skip
    for layer in range(layers):
        z = 0.2 * (layer + 1)
        lines += ["; CHANGE_LAYER", f"; Z_HEIGHT: {z:.1f}", "; LAYER_HEIGHT: 0.2", f"G1 Z{z:.1f}"]
        for x, y in places:
            lines += [
                "G1 E-.8 F1800", f"G1 X{x} Y{y} F30000", "G1 E.8 F1800", "; FEATURE: Outer wall",
                "; LINE_WIDTH: 0.42", f"G1 X{x + 8} Y{y} E.3 F6000", f"G1 X{x + 8} Y{y + 8} E.3",
                f"G1 X{x} Y{y + 8} E.3", f"G1 X{x} Y{y + 0.2} E.29",
            ]  # fmt: skip
    lines += ["M104 S0", "G1 E-.8 F1800", "; EXECUTABLE_BLOCK_END"]
    return ("\n".join(lines) + "\n").encode()


ZIGZAG = [(20.0 + 20 * (k % 5), 40.0 + 60 * (k % 2)) for k in range(10)]
POOR = squares_text(ZIGZAG)  # a better order is soon found
GOOD = squares_text([(60.0, 60.0)])


class _Stream(io.BytesIO):
    """A stream that cannot go back: sizes then stand behind the data, as Bambu Studio has it."""

    def seekable(self) -> bool:
        return False


def gcode_3mf(texts: Mapping[int, bytes], *, sums: str = "upper", large: bool = False) -> bytes:
    """Return a .gcode.3mf with the G-code of these plates.

    Parameters
    ----------
    sums : str
        How checksums are written: upper, lower; else there are none.
    large : bool
        With the sizes of members in 64 bits.
    """
    stream = _Stream()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content, packing in _members(texts, sums):
            info = zipfile.ZipInfo(name, WHEN)
            info.compress_type = packing
            with archive.open(info, "w", force_zip64=large) as member:
                member.write(content)
        archive.comment = b"made by a test"
    return stream.getvalue()


def _members(texts: Mapping[int, bytes], sums: str) -> Iterable[tuple[str, bytes, int]]:
    stored, deflated = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED
    yield "[Content_Types].xml", b"<Types/>", deflated
    yield "Metadata/plate_1.png", PICTURE, stored
    yield "3D/3dmodel.model", b"<model><resources/><build/></model>", deflated
    for plate, text in texts.items():
        name = f"Metadata/plate_{plate}.gcode"
        yield name, text, deflated
        if sums in SUM_OF:
            digest = hashlib.md5(text, usedforsecurity=False).hexdigest()
            yield f"{name}.md5", SUM_OF[sums](digest).encode(), deflated
    yield "Metadata/slice_info.config", b'<metadata key="prediction" value="754"/>', deflated


def gx(text: bytes, *, second_picture: bytes = b"") -> bytes:
    """Return a .gx with this G-code."""
    picture, begin = 58 + len(BITMAP), 58 + len(BITMAP) + len(second_picture)
    header = b"xgcode 1.0\n\0" + struct.pack("<4I", 0, 58, picture, begin)
    header += struct.pack("<3I8HH", *GX_FIELDS)
    assert len(header) == 58
    return header + BITMAP + second_picture + text
