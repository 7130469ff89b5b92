"""The one place where arviz is imported.

Once a day arviz 0.23 warns of its coming refactoring and notes the day in a file. The warning says nothing to those who
use this program: it alone is kept silent, and the user's own filters stay as they are. Of two processes that note the
day at the same moment one finds its file gone, and its import fails: by then the day is noted, and a second try passes.
"""

from __future__ import annotations

import warnings

__all__ = ["arviz"]

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing a major refactor", FutureWarning)
    try:
        import arviz
    except FileNotFoundError:
        import arviz
