"""Where the agents of one team meet, and the secret that lets them in.

A launcher hands a meeting to its agents through their pipes, never as arguments or in
the environment, which others may read. Agents started by hand have addresses and a file.
No network here.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from agents.messages.kinds import MessageError
from agents.messages.seal import Seal
from decmcts.errors import InputError

TCP, UNIX = "tcp/", "unixsock-stream/"  # zenoh's words for the two kinds of place
_PLACE = re.compile(rf"(?:{TCP}[^/\s?#]+:[0-9]{{1,5}}|{UNIX}[^?#]+)")
_LARGEST_FILE = 4096


@dataclass(frozen=True, slots=True)
class Meeting:
    """Places, one a head, and the seal of the team."""

    places: tuple[str, ...]  # zenoh locators
    secret: bytes = field(repr=False)

    @property
    def seal(self) -> Seal:
        """What follows from the secret."""
        return Seal.of(self.secret)

    def to_dict(self) -> dict[str, Any]:
        """Return what goes through an agent's pipe."""
        return {"places": list(self.places), "secret": self.secret.hex()}

    @classmethod
    def from_dict(cls, stated: object) -> Self:
        """Return what a launcher handed over; raises `InputError`."""
        match stated:
            case {"places": [*places], "secret": str(secret)}:
                try:
                    return cls(checked_places(places), bytes.fromhex(secret))
                except ValueError:
                    pass
        raise InputError("the launcher names no place to meet")


def checked_places(places: Sequence[object]) -> tuple[str, ...]:
    """Return these places; raises ValueError for what is none."""
    found = tuple(str(place) for place in places)
    if wrong := [place for place in found if not _PLACE.fullmatch(place)]:
        raise ValueError(f"no place: {wrong[0][:80]!r}")
    return found


def addresses(text: str) -> tuple[str, ...]:
    """Return the places of a list `HOST:PORT,HOST:PORT`; a port alone is one of this host."""
    words = [word.strip() for word in text.split(",") if word.strip()]
    return checked_places([f"{TCP}{w}" if ":" in w else f"{TCP}127.0.0.1:{w}" for w in words])


def secret_of(file: Path) -> bytes:
    """Return the secret in a file.

    InputError if it cannot be read, is too short or too large, or others may read it.
    """
    advice = "make one: python -c 'import secrets; print(secrets.token_hex())' > FILE"
    try:
        with file.open("rb") as stream:
            secret = stream.read(_LARGEST_FILE + 1).strip()
            mode = file.stat().st_mode
        Seal.of(secret)
    except (OSError, MessageError) as error:
        what = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"no secret here: {what}", path=file, advice=advice) from error
    if len(secret) > _LARGEST_FILE:
        raise InputError(f"a secret has at most {_LARGEST_FILE} bytes", path=file, advice=advice)
    if mode & 0o077 and os.name == "posix":  # elsewhere a mode says nothing of this
        raise InputError("other users may read this secret", path=file, advice=f"chmod 600 {file}")
    return secret
