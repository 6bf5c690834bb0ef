"""Puts a file in place in one step, so that a failure leaves what was there before.

Nothing here knows what is in a file. A link is followed, so that it stays one;
devices and pipes are refused: putting a file in their place would destroy them.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from decmcts.errors import InputError

NAME_BYTES = 255  # of a name on most file systems
BEGIN_BYTES = 80  # of a file's name, which that of its draft begins with: it is no longer


def write_whole(path: Path | str, content: bytes) -> None:
    """Write a file wholly or not at all.

    Raises
    ------
    InputError
        When it cannot be written; what was there before is untouched.
    """
    try:
        target = Path(path).resolve()
        refuse_special(target)
        begin = target.name.encode("utf-8", "replace")[:BEGIN_BYTES].decode("utf-8", "ignore")
        handle, temporary = tempfile.mkstemp(prefix=f".{begin}.", dir=target.parent)
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle
        raise _unwritable(path, error) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(temporary, _mode(target))
        os.replace(temporary, target)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True)
        raise _unwritable(path, error) from error
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def refuse_special(path: Path) -> None:
    """Raise InputError for what exists and is neither a file nor a folder."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError("a device or pipe is no file to write", path=path, advice="name a file")


def refuse_long_name(path: Path) -> None:
    """Raise InputError for a name that is longer than the file system takes."""
    most = NAME_BYTES
    with contextlib.suppress(OSError, ValueError, AttributeError):  # Windows, or no such folder
        most = os.pathconf(path.parent, "PC_NAME_MAX")
    size = len(os.fsencode(path.name))
    if size > most:
        raise InputError(
            f"the name has {size} bytes, at most {most} are possible here", path=path,
            advice="name a shorter one",
        )  # fmt: skip


def _unwritable(path: Path | str, error: Exception) -> InputError:
    reason = error.strerror if isinstance(error, OSError) else "a link that leads to itself"
    return InputError(f"cannot be written ({reason})", path=path)


def _mode(path: Path) -> int:
    """Return the permissions the file has, or would get from an ordinary open."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
