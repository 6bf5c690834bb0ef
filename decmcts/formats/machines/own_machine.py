"""The machine of a print that names none: its printer's preset, or a head of its clearances.

The printer's name and the clearances are what a slicer wrote into the G-code. Presets with
Prusa's own shapes of a head stand for their printer whatever the clearances.

Slicers write settings as comments, ``; name = value``, at the beginning or the end of a file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.heads.clearances import SETTINGS, Setting, clearance_machine, read_clearances
from decmcts.formats.machines.machine_file import load_machine, preset_for_printer
from decmcts.print.machine import Machine

PAGE = "docs/measure-your-head.md"


def machine_of_text(
    text: bytes, path: Path | str | None = None, *, printer: str = ""
) -> tuple[Machine, str]:
    """Return the machine a G-code text is for, and one line on where it comes from.

    The slicer's `printer` model may be known from elsewhere; else the text's counts.

    Raises InputError when it names no printer we know and states no clearances, or some that can't
    be.
    """
    settings = comment_settings(text, SETTINGS, path)
    printer = printer or (settings["printer_model"].text if "printer_model" in settings else "")
    shape = preset_for_printer(printer)
    if shape is not None:
        return load_machine(shape), f"machine {shape}, the preset of printer {printer}"
    found = read_clearances(settings, path)
    if found is None:
        raise InputError(
            "the file names no printer we know and states no clearances of its head",
            path=path,
            advice="add --machine NAME (`decmcts machines` lists them; `paper` is the box of the "
            f"literature), a profile of your slicer, or measure your head: {PAGE}",
        )
    note = f"machine by the file's clearances: {found}"
    if found.unchanged:
        note += "; radius and height are the slicer's defaults, so compare them with your printer"
    machine = clearance_machine(found, source="clearances in the G-code")
    return machine, f"{note} ({PAGE} shows how to gain more)"


def comment_settings(
    text: bytes, names: Iterable[str], path: Path | str | None = None
) -> dict[str, Setting]:
    """Return the settings of these names in a G-code text.

    Raises InputError when one of them stands there twice with different values.
    """
    wanted = b"|".join(re.escape(name.encode()) for name in sorted(names))
    found: dict[str, Setting] = {}
    for match in re.finditer(rb"^;[ \t]*(" + wanted + rb")[ \t]*=([^\r\n]*)", text, re.M):
        name, value = match[1].decode(), match[2].decode("utf-8", "replace").strip()
        if name not in found:
            found[name] = Setting(value, text.count(b"\n", 0, match.start()) + 1)
        elif found[name].text != value:
            raise InputError(
                f"{name} is {value[:40]!r} here and {found[name].text[:40]!r}"
                f" in line {found[name].line}",
                path=path,
                line=text.count(b"\n", 0, match.start()) + 1,
                advice="name the head with --machine",
            )
    return found
