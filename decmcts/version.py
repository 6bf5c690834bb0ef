"""The version, where every room may read it: `decmcts` itself knows the rooms above."""

__version__ = "0.1.0"
