"""Meshes: STL, 3MF and OBJ, which a slicer makes G-code of.

`slicers` has the commands of slicers, `load` reads a mesh for one that cannot place it itself.
`gcode_text` writes beads without a slicer.
"""

from decmcts.formats.mesh.options import MESH_SUFFIXES, SliceOptions, is_mesh, refuse_other_shape

__all__ = ["MESH_SUFFIXES", "SliceOptions", "is_mesh", "refuse_other_shape"]
