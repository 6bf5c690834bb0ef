"""Settings as slicers write them into the comments of their G-code files.

``; name = value``, at the beginning or the end of a file; which settings mean
what lives with those who ask for them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.heads.clearances import Setting


def comment_settings(
    text: bytes, names: Iterable[str], path: Path | str | None = None
) -> dict[str, Setting]:
    """Return the settings of these names in a G-code text.

    Raises
    ------
    InputError
        When one of them stands there twice with different values.
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
