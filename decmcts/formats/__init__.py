"""Files in and out: G-code, meshes, plan files, machine files."""
