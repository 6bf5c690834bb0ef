"""Where a machine comes from: a preset, a file, a profile of a slicer, or the G-code."""
