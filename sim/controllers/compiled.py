"""The simulator's compiled functions go through this one decorator."""

from __future__ import annotations

from pathlib import Path

from decmcts.jit import compiler

compiled = compiler(Path(__file__).parent)
"""Compile a function on first use and keep the machine code on disk."""
