"""The judge's own compiled functions go through this one decorator.

It is kept apart from the planner's kernels on purpose: the judge shares data
types with the planner, not algorithms.
"""

from __future__ import annotations

from pathlib import Path

from decmcts.jit import compiler

compiled = compiler(Path(__file__).parent)
"""Compile a function on first use and keep the machine code on disk."""
