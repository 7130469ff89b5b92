"""A family of curves read on a rig whose zeros are off."""

from __future__ import annotations

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.base import CurveFamily

SHIFT = 2e-3  # m, prior standard deviation of the offset of the deflection zero: wide, for it is looked for
OFFSET = 0.03  # N, that of the force zero


class Displaced(CurveFamily):
    """g = inner(x - shift) + offset, with an inner family of curves through zero."""

    def __init__(self, inner: CurveFamily) -> None:
        self.inner = inner
        self.name, self.title = f"{inner.name}_displaced", f"{inner.title}, with offsets of both zeros"

    @property
    def sizes(self) -> tuple[float, ...]:
        return self.inner.sizes

    @property
    def middle(self) -> float:
        return self.inner.middle

    @property
    def size(self) -> int:
        return self.inner.size + 2

    @property
    def free(self) -> slice:
        return self.inner.free

    def force(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        shift, offset = SHIFT * c[:, -2:-1], OFFSET * c[:, -1:]
        force, slope, moved = self.inner.force(c[:, :-2], size, x - shift)
        rates = np.stack([-SHIFT * slope, np.full_like(x, OFFSET)], axis=2)
        return force + offset, slope, np.concatenate([moved, rates], axis=2)
