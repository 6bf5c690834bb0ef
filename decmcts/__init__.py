"""Finds a better, proven-safe order for the extrusions of a 3D print.

`decmcts` computes; `agents` communicates; `sim` judges. See ARCHITECTURE.md.
"""

__version__ = "0.1.0"
