"""arviz, imported in one place, and only when something of it is used: that takes a second, and a fit needs none of it.

Once a day its import warns of a coming rewrite, which is no user's concern: that warning alone is kept silent, and the
user's own filters stay as they are. It notes the day in a file; of two processes that do so at the same moment one
finds its file gone, and its import fails: by then the day is noted, and a second try passes. Where it cannot write at
all, as in a home that is closed or on a disk that is full, it notes nothing.
"""

from __future__ import annotations

import warnings
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import DEFAULT, patch


@cache
def _imported() -> Any:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing a major refactor", FutureWarning)
        for _ in range(2):
            try:
                return import_module("arviz")
            except OSError:
                continue
        with patch.multiple(Path, mkdir=DEFAULT, write_text=DEFAULT, replace=DEFAULT):
            return import_module("arviz")


class _Arviz:
    """What `arviz` has, imported with the first name that is asked for."""

    def __getattr__(self, name: str) -> Any:
        return getattr(_imported(), name)


if TYPE_CHECKING:
    import arviz
else:
    arviz = _Arviz()

__all__ = ["arviz"]
