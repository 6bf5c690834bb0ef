"""Where results are written: refusing a place before the work, and writing to it."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from decmcts.errors import InputError, VerificationError
from decmcts.formats.files.atomic import (
    refuse_foreign_letters,
    refuse_long_name,
    refuse_special,
    write_whole,
)
from decmcts.formats.gcode.text.source_text import (
    PACKED_SUFFIXES,
    load_text,
    packed_text,
    save_text,
)
from decmcts.formats.mesh import is_mesh
from decmcts.formats.plans.plan_json import SUFFIXES as PLAN_SUFFIXES
from sim.faults import Verdict

STDOUT = Path("-")  # as an output: standard output


def refuse_unwritable(
    paths: Sequence[Path | None], source: Path, *read: Path, edits: bool = False
) -> None:
    """Fail before the long work: each output needs an existing folder we may write to.

    No output may be the input, another file that is `read`, or another output. With `edits`
    the message says that `decmcts post` edits the input in place.
    """
    if source == STDOUT:
        raise InputError("standard input is not read", advice="give the name of a file")
    taken: set[Path] = set()
    for path in (p for p in paths if p is not None and p != STDOUT):
        refuse_place(path)
        place = Path(os.path.realpath(path))
        if _same(path, source):
            raise InputError(
                "the output is the input",
                path=path,
                advice="name another file"
                + (", or use `decmcts post` to edit in place" if edits else ""),
            )
        if any(_same(path, other) for other in read):
            raise InputError("the output is read too", path=path, advice="name another file")
        if place in taken:
            raise InputError("two outputs have this name", path=path, advice="name another file")
        taken.add(place)


def _same(path: Path, other: Path) -> bool:
    return path.exists() and other.exists() and path.samefile(other)


def refuse_place(path: Path, *, advice: str = "name another output") -> None:
    """Raise InputError where no file can be written under this name."""
    refuse_foreign_letters(path)
    folder = Path(os.path.realpath(path)).parent
    if not folder.is_dir():
        raise InputError("no such folder", path=folder, advice="make it, or name another output")
    refuse_long_name(path)
    if path.is_dir():
        raise InputError("the output is a folder", path=path, advice="name a file")
    refuse_special(path)
    if not os.access(folder, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise InputError("cannot write here", path=path, advice=advice)


def refuse_stdout(path: Path | None, option: str) -> None:
    """Raise InputError where an option that takes a file names standard output."""
    if path == STDOUT:
        raise InputError(f"{option} - is no file", advice=f"name one with {option} FILE")


def refuse_two_on_stdout(output: Path | None, *, as_json: bool) -> None:
    """Raise InputError where result and summary both want standard output."""
    if output == STDOUT and as_json:
        raise InputError(
            "-o - and --json both want standard output", advice="name a file with -o FILE"
        )


def name_of(path: Path) -> str:
    """Return an output's name for messages."""
    return "standard output" if path == STDOUT else str(path)


def put(content: bytes, path: Path, *, packed: bool = False) -> None:
    """Write a result to its file, whole or not at all, or to standard output (`-`).

    Text becomes gzipped or binary G-code as the name's suffix says, unless it is `packed` already.
    Raises InputError when it cannot be written.
    """
    if path != STDOUT:
        if packed:
            write_whole(path, content)
        else:
            save_text(content, path)
        return
    try:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is closed"
        raise InputError(f"standard output cannot be written ({reason})") from error


def refuse_unpackable(output: Path | None, source: Path, plate: int | None = None) -> None:
    """Raise InputError for a .bgcode, .3mf or .gx that the source cannot be packed into."""
    if output is None or output.suffix.lower() not in PACKED_SUFFIXES:
        return
    if is_mesh(source):
        raise InputError(
            f"what is made of a mesh is not written as {output.suffix.lower()}",
            path=output,
            advice="name a .gcode file",
        )
    packed_text(load_text(source, plate), output, source, plate)


def refuse_other_suffixes(plan: Path | None, report: Path | None, picture: Path | None) -> None:
    """Raise InputError for an output whose name says it is of another kind."""
    known = (
        (plan, PLAN_SUFFIXES),
        (report, (".html", ".htm")),
        (picture, (".png", ".svg")),
    )
    for path, ends in known:
        if path is not None and not path.name.lower().endswith(ends):
            raise InputError(
                f"the name of this output must end in {' or '.join(ends)}",
                path=path,
                advice="rename it",
            )


def require_sound(verdict: Verdict, path: Path) -> None:
    """Raise VerificationError if a text that was to be written to `path` has faults."""
    if not verdict.ok:
        raise VerificationError(
            f"{path} was not written: its G-code failed verification with "
            f"{len(verdict.faults)} faults: {verdict.shown}"
        )
