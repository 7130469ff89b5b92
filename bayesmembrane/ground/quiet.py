"""arviz, imported in one place.

Once a day its import warns of a coming rewrite, which is no user's concern: that warning alone is kept silent, and the
user's own filters stay as they are. It notes the day in a file; of two processes that do so at the same moment one
finds its file gone, and its import fails: by then the day is noted, and a second try passes.
"""

from __future__ import annotations

import warnings

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing a major refactor", FutureWarning)
    try:
        import arviz
    except FileNotFoundError:
        import arviz

__all__ = ["arviz"]
