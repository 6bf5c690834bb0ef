"""Files in: what every reader refuses in the same words, whatever the file is for."""

from __future__ import annotations

import json
import os
import re
import stat
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_BYTES, refuse_larger
from decmcts.formats.files.fields import shown

_A_FILE = "save what it gives in a file, and name that"
_AT_LINE = re.compile(r"\(at line (\d+), column \d+\)")


def read_bytes(path: Path) -> bytes:
    """Return what a file holds, `LARGEST_BYTES` at the most.

    Raises InputError where it cannot be read or is no ordinary file: a device may never end, and a
    pipe waits for somebody to write.
    """
    try:
        require_file(path)
        with open(path, "rb", opener=_without_waiting) as file:
            size = os.fstat(file.fileno()).st_size
            refuse_larger(size, path)
            content = file.read(size + 1)
            if len(content) > size:  # it grows, or its size is not said
                content += file.read(LARGEST_BYTES + 1 - len(content))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", path=path) from error
    refuse_larger(len(content), path)
    return content


def require_file(path: Path) -> None:
    """Raise InputError for a device, pipe or socket, and OSError where nothing is there."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):  # a folder is said in the system's words
        raise InputError("is a device, pipe or socket and no file", path=path, advice=_A_FILE)


def _without_waiting(path: str, flags: int) -> int:
    """Open a file, also one that has become a pipe meanwhile."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def read_json(path: Path, kind: str) -> Mapping[str, Any]:
    """Return the object in a JSON file that should be a `kind`.

    Raises InputError when it cannot be read or holds no object.
    """
    content = read_bytes(path)
    with one_line(path, kind):
        values = json.loads(content)
    if not isinstance(values, dict):
        raise InputError(f"is no {kind}: expected an object", path=path)
    return values


def read_toml(
    path: Path, kind: str, *, page: str, content: bytes | None = None
) -> Mapping[str, Any]:
    """Return what a TOML file says that should be a `kind`, which `page` describes.

    Its `content` may be known already.

    Raises InputError when it cannot be read or is no TOML, with the line.
    """
    content = read_bytes(path) if content is None else content
    with one_line(path, kind):
        try:
            return tomllib.loads(content.decode("utf-8-sig"))
        except tomllib.TOMLDecodeError as error:
            found = _AT_LINE.search(str(error))
            raise InputError(
                _AT_LINE.sub("", str(error)).rstrip(),
                path=path,
                line=int(found[1]) if found else None,
                advice=f"see {page}",
            ) from error


def once(path: Path) -> Callable[[list[tuple[str, Any]]], dict[str, Any]]:
    """Return a hook for `json.loads` that refuses a key that stands twice in one table."""

    def table_of(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        table = dict(pairs)
        if len(table) < len(pairs):
            twice = first_twice(key for key, _ in pairs)
            raise InputError(f"the key {shown(twice)} stands twice in one table", path=path)
        return table

    return table_of


def first_twice(names: Iterable[str]) -> str | None:
    """Return the first name, in their order, that comes again; None where none does."""
    counts = Counter(names)  # keeps their order
    return next((name for name, count in counts.items() if count > 1), None)


@contextmanager
def one_line(path: Path, kind: str) -> Iterator[None]:
    """Turn what Python's readers raise of text that should be a `kind` into an InputError."""
    try:
        yield
    except UnicodeDecodeError as error:
        raise InputError(f"is no UTF-8 text, so no {kind}", path=path) from error
    except RecursionError as error:
        raise InputError(f"is nested too deeply to be a {kind}", path=path) from error
    except json.JSONDecodeError as error:
        raise InputError(f"is no JSON: {error.msg}", path=path, line=error.lineno) from error
    except ValueError as error:  # Python reads no integer of more digits than that
        digits = sys.get_int_max_str_digits()
        raise InputError(f"a number of more than {digits} digits", path=path) from error
