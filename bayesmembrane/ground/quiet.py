"""arviz, imported in one place: once a day its import warns of a coming rewrite, which is no user's concern."""

from __future__ import annotations

import warnings

with warnings.catch_warnings():
    warnings.simplefilter("ignore", FutureWarning)
    import arviz

__all__ = ["arviz"]
