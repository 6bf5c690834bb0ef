"""G-code in and out: dialects of a dozen slicers, one head or several.

Planners see the `PrintJob`; the `GcodeDocument` keeps the text and the machine
state that the writer puts back.
"""

from decmcts.formats.gcode.document import Block, Cursor, GcodeDocument, Motions, StateTable
from decmcts.formats.gcode.reading.reader import read_gcode, read_motions, read_written
from decmcts.formats.gcode.writing.head_files import write_head_gcode
from decmcts.formats.gcode.writing.head_refusals import refuse_for_heads, unprimed_note
from decmcts.formats.gcode.writing.writer import write_gcode

__all__ = [
    "Block", "Cursor", "GcodeDocument", "Motions", "StateTable",
    "read_gcode", "read_motions", "read_written", "refuse_for_heads",
    "unprimed_note", "write_gcode", "write_head_gcode",
]  # fmt: skip
