"""Key expressions, built and parsed in this one place.

`decmcts/v3/{session}/{head}/msg/{kind}` carries messages and
`decmcts/v3/{session}/{head}/alive/{epoch}/{seal}` is the liveliness token of one
incarnation of a head. Docs: docs/protocol.md.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from agents.messages.kinds import MAX_HEADS, MessageError
from agents.messages.seal import Seal

ROOT = "decmcts/v3"
_NUMBER = re.compile(r"0|[1-9][0-9]{0,18}")


@dataclass(frozen=True, slots=True)
class Keys:
    """All keys of one session."""

    seal: Seal

    def message(self, head: int, kind: str) -> str:
        """Return the key a head publishes one kind of message on."""
        return f"{ROOT}/{self.seal.session}/{head}/msg/{kind}"

    def alive(self, head: int, epoch: int) -> str:
        """Return the liveliness token of one incarnation of a head."""
        return f"{ROOT}/{self.seal.session}/{head}/alive/{epoch}/{self.seal.of_token(head, epoch)}"

    def all_messages(self, kind: str) -> str:
        """Return the key expression of every message of one kind in the session."""
        return f"{ROOT}/{self.seal.session}/*/msg/{kind}"

    @property
    def all_alive(self) -> str:
        """Key expression of every liveliness token of the session."""
        return f"{ROOT}/{self.seal.session}/*/alive/**"

    def parse_message(self, key: str) -> tuple[int, str]:
        """Return (head, kind) of a message key; raises MessageError."""
        head, what, *kind = self._tail(key)
        if what != "msg" or len(kind) != 1:
            raise MessageError(f"key {key[:200]!r} carries no message")
        return int(head), kind[0]

    def parse_alive(self, key: str) -> tuple[int, int]:
        """Return (head, epoch) of a liveliness key; raises MessageError, `ForgedError` too."""
        head, what, *token = self._tail(key)
        if what != "alive" or len(token) != 2 or not _NUMBER.fullmatch(token[0]):
            raise MessageError(f"key {key[:200]!r} is no liveliness token")
        found = int(head), int(token[0])
        self.seal.check_token(*found, token[1])
        return found

    def _tail(self, key: str) -> list[str]:
        prefix = f"{ROOT}/{self.seal.session}/"
        parts = key[len(prefix) :].split("/") if key.startswith(prefix) else []
        if len(parts) < 2 or not _NUMBER.fullmatch(parts[0]) or int(parts[0]) >= MAX_HEADS:
            raise MessageError(f"key {key[:200]!r} is not of session {self.seal.session}")
        return parts
