"""A small print on two heads, as in the tests of replanning."""

from tests.planning.replanning.conftest import cut, made

__all__ = ["cut", "made"]
