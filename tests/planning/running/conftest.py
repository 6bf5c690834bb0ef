"""A small print on two heads, as in the tests of replanning."""

from tests.planning.replanning.conftest import made

__all__ = ["made"]
