"""arviz, imported in one place.

Once a day its import warns of a coming rewrite, which is no user's concern: that warning alone is kept silent, and the
user's own filters stay as they are. It notes the day in a file; of two processes that do so at the same moment one
finds its file gone, and its import fails: by then the day is noted, and a second try passes. Where it cannot write at
all, as in a home that is closed or on a disk that is full, it notes nothing.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from unittest.mock import DEFAULT, patch

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing a major refactor", FutureWarning)
    try:
        import arviz
    except OSError:
        try:
            import arviz
        except OSError:
            with patch.multiple(Path, mkdir=DEFAULT, write_text=DEFAULT, replace=DEFAULT):
                import arviz

__all__ = ["arviz"]
