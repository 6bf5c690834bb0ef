"""Who may speak in a team: one secret, and all that follows from it.

A launcher makes a new secret for each launch and hands it to its agents through their
pipes; agents started by hand read it from a file. From it follow the name of the session,
the password of every link, and the key of the seals. A **seal** is a keyed BLAKE2b hash
(RFC 7693) in front of each message and at the end of each liveliness token: who lacks the
secret can copy what was said, but say nothing of its own. No network here.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass, field
from hashlib import blake2b

from agents.messages.kinds import MessageError

SEAL_BYTES = 16  # in front of each message: a forgery passes once in 2^128 trials
LEAST_SECRET = 16  # bytes of a secret; of a shorter one a listener could try all


class ForgedError(MessageError):
    """A seal is wrong: whoever said this lacks the secret."""


@dataclass(frozen=True, slots=True)
class Seal:
    """What follows from one secret; nothing of it shows the secret."""

    session: str  # name of the session, in keys
    password: str = field(repr=False)  # of links
    _key: bytes = field(repr=False)

    @classmethod
    def of(cls, secret: bytes) -> Seal:
        """Return the seal of a secret; MessageError if it is too short."""
        if len(secret) < LEAST_SECRET:
            raise MessageError(f"a secret of {len(secret)} bytes, least {LEAST_SECRET}")
        root = blake2b(secret, person=b"decmcts-secret-1").digest()

        def made(purpose: bytes, size: int) -> bytes:
            return blake2b(purpose, key=root, digest_size=size).digest()

        return cls(made(b"session", 8).hex(), made(b"link", 24).hex(), made(b"seal", 32))

    def close(self, payload: bytes) -> bytes:
        """Return a message with its seal in front."""
        return self._tag(b"message", payload) + payload

    def open(self, sealed: bytes) -> bytes:
        """Return the message behind a seal; raises `ForgedError` if the seal is wrong."""
        tag, payload = sealed[:SEAL_BYTES], sealed[SEAL_BYTES:]
        if not hmac.compare_digest(tag, self._tag(b"message", payload)):
            raise ForgedError("a message with a wrong seal")
        return payload

    def of_token(self, head: int, epoch: int) -> str:
        """Return the seal of one incarnation's liveliness token, hexadecimal."""
        return self._tag(b"token", b"%d/%d" % (head, epoch)).hex()

    def check_token(self, head: int, epoch: int, seal: str) -> None:
        """Raise `ForgedError` if this is not the seal of that token."""
        if not hmac.compare_digest(seal.encode(), self.of_token(head, epoch).encode()):
            raise ForgedError(f"a token of head {head} with a wrong seal")

    def _tag(self, what: bytes, content: bytes) -> bytes:
        return blake2b(content, key=self._key, digest_size=SEAL_BYTES, person=what).digest()
