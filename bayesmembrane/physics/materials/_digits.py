"""ln(1 + u) and exp(x) - 1 with all digits where u and x are small, from what compiled closed forms may call."""

from __future__ import annotations

from typing import Any

import numpy as np

from bayesmembrane.physics.materials.invariants import compilable


@compilable
def ln_one_plus(u: Any) -> Any:
    """ln(1 + u): the rounding error of 1 + u is put back."""
    t = 1.0 + u
    return np.log(t) + (u - (t - 1.0)) / t


@compilable
def exp_minus_one(x: Any) -> Any:
    """exp(x) - 1: the rounding error of exp(x), which its logarithm shows, is put back."""
    e = np.exp(x)
    return (e - 1.0) + e * (x - np.log(e))
