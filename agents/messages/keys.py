"""Key expressions, built and parsed in this one place.

`decmcts/v2/{session}/{head}/msg/{kind}` carries messages and
`decmcts/v2/{session}/{head}/alive/{epoch}` is the liveliness token of one
incarnation of a head. Docs: docs/protocol.md.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from agents.messages.kinds import MAX_HEADS, MessageError

ROOT = "decmcts/v2"
_SESSION = re.compile(r"[A-Za-z0-9_-]{1,64}")
_NUMBER = re.compile(r"0|[1-9][0-9]{0,18}")


@dataclass(frozen=True, slots=True)
class Keys:
    """All keys of one session.

    Raises
    ------
    MessageError
        If `session` is not 1 to 64 letters, digits, `_` or `-`.
    """

    session: str

    def __post_init__(self) -> None:
        if not _SESSION.fullmatch(self.session):
            raise MessageError(f"session {self.session!r} is not 1..64 of A-Z a-z 0-9 _ -")

    def message(self, head: int, kind: str) -> str:
        """Return the key a head publishes one kind of message on."""
        return f"{ROOT}/{self.session}/{head}/msg/{kind}"

    def alive(self, head: int, epoch: int) -> str:
        """Return the liveliness token of one incarnation of a head."""
        return f"{ROOT}/{self.session}/{head}/alive/{epoch}"

    def all_messages(self, kind: str) -> str:
        """Return the key expression of every message of one kind in the session."""
        return f"{ROOT}/{self.session}/*/msg/{kind}"

    @property
    def all_alive(self) -> str:
        """Key expression of every liveliness token of the session."""
        return f"{ROOT}/{self.session}/*/alive/*"

    def parse_message(self, key: str) -> tuple[int, str]:
        """Return (head, kind) of a message key; raises MessageError."""
        head, what, kind = self._tail(key)
        if what != "msg":
            raise MessageError(f"key {key!r} carries no message")
        return head, kind

    def parse_alive(self, key: str) -> tuple[int, int]:
        """Return (head, epoch) of a liveliness key; raises MessageError."""
        head, what, epoch = self._tail(key)
        if what != "alive" or not _NUMBER.fullmatch(epoch):
            raise MessageError(f"key {key!r} is no liveliness token")
        return head, int(epoch)

    def _tail(self, key: str) -> tuple[int, str, str]:
        prefix = f"{ROOT}/{self.session}/"
        parts = key[len(prefix) :].split("/") if key.startswith(prefix) else []
        if len(parts) != 3 or not _NUMBER.fullmatch(parts[0]) or int(parts[0]) >= MAX_HEADS:
            raise MessageError(f"key {key[:200]!r} is not of session {self.session}")
        return int(parts[0]), parts[1], parts[2]
