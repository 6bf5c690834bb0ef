"""A secret of the tests, and what follows from it."""

from __future__ import annotations

from agents.messages.seal import Seal

SECRET = bytes(range(32))
SEAL = Seal.of(SECRET)
OTHER = Seal.of(SECRET[::-1])
