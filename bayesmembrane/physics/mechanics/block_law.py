"""The law of a homogeneous test in compression: that of a strip with both signs turned, Q(u) = -F(-u), l = 1 - u / L.

Compression u and push Q are positive, as deflection and force of a lifted disc are, so that histories (the largest so
far, loading and unloading) mean the same. Plates do not pull: there is no force where u is below zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.solution import Curves, Status
from bayesmembrane.physics.mechanics.strip_law import StripLaw, strip_curves

MOST = 0.9
"""Of a specimen's length: the most that it may have lost for good."""
FLAT = 0.99
"""Of a specimen's length: pressed so far there is no force."""


@dataclass(frozen=True)
class BlockLaw:
    """Q(u) of B specimens; ``strip`` is the law of the same ones in tension, told that they push."""

    strip: StripLaw

    @property
    def status(self) -> NDArray[np.int8]:
        """(B,) `Status` where there is no force."""
        return self.strip.status

    def __call__(self, deflection: Array, excess: Array | None = None) -> tuple[Array, Array]:
        """((B, N) N, (B, N) N/m): push and dQ/du at compressions (B, N) m; nan where there is none.

        With ``excess`` e (B, N) the specimen is shorter by that part: l = (1 - u / L) / (1 - e).
        """
        shorter = 0.0 if excess is None else np.minimum(excess, MOST)
        free = self.strip.rig.length * shorter
        pressed = np.maximum(deflection, free)
        force, slope = self.strip(-pressed, -shorter + 0.0 * deflection)
        touches, gone = deflection > free, pressed >= FLAT * self.strip.rig.length
        push = np.where(gone, np.nan, np.where(touches, -force, 0.0 * force))
        return push, np.where(touches, slope, 0.0 * slope) + 0.0 * push

    def varied(self, change: Array) -> BlockLaw:
        """The law of specimens whose parameters differ by ``change`` (B, n)."""
        return BlockLaw(self.strip.varied(change))

    def of(self, rows: NDArray[np.intp] | slice) -> BlockLaw:
        """The law of some of the specimens."""
        return BlockLaw(self.strip.of(rows))

    @staticmethod
    def stack(laws: Sequence[BlockLaw]) -> BlockLaw:
        """The specimens of all laws, one after the other."""
        return BlockLaw(StripLaw.stack([law.strip for law in laws]))


def block_curves(law: BlockLaw, deflection: Array, sensitivities: bool = False) -> Curves:
    """Curves of the specimens of ``law`` at compressions ``deflection`` (N,) m."""
    found = strip_curves(law.strip, -np.maximum(deflection, 0.0), sensitivities)
    force, slope = law(np.broadcast_to(deflection, found.force.shape))
    return replace(
        found,
        deflection=np.broadcast_to(deflection, found.force.shape),
        force=force,
        slope=slope,
        status=np.where(np.isfinite(force), found.status, Status.LOCKED).astype(np.int8),
        sensitivity=None if found.sensitivity is None else -found.sensitivity,
    )
