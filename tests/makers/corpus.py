"""Where the corpus of real prints is; tests that read it are marked `shared`."""

from __future__ import annotations

import os
from pathlib import Path

CORPUS = Path(os.environ.get("DECMCTS_CORPUS", Path(__file__).parents[3] / "shared"))
