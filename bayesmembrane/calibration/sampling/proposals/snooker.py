"""The snooker move: along the line through another walker, by the difference of two more seen on that line."""

from __future__ import annotations

from typing import Any

import emcee
import numpy as np

from bayesmembrane.ground.parameters import Array

GAMMA = 1.7  # "the optimal choice" of the reference


class Snooker(emcee.moves.RedBlueMove):  # type: ignore[misc]
    """y = x + gamma e (e . (z1 - z2)),   e = (x - z) / |x - z|,   ln factor = (k - 1) ln(|y - z| / |x - z|).

    z, z1, z2 are three walkers of the other half. The point z is an anchor: seen from it the move changes the distance
    alone, and the factor is the ratio of the surfaces of two spheres about it (C. J. F. ter Braak and J. A. Vrugt,
    Stat. Comput. 18 (2008) 435, eq. 4). emcee 3.1.6 divides x - z by the root of its length and halves the factor,
    which breaks detailed balance (dfm/emcee pull request 531).
    """

    def get_proposal(self, sample: Array, complement: list[Array], random: Any) -> tuple[Array, Array]:
        """(B, k) proposals y for the walkers (B, k), and the logarithms (B,) of their factors."""
        others = np.concatenate(complement)
        count, size = sample.shape
        # Three different walkers for each: the first three of a random order.
        chosen = np.argsort(random.rand(count, len(others)), axis=1)[:, :3]
        z, z1, z2 = np.moveaxis(others[chosen], 1, 0)
        line = sample - z
        length = np.linalg.norm(line, axis=1)
        with np.errstate(all="ignore"):
            e = line / length[:, None]
            y = sample + GAMMA * e * np.sum(e * (z1 - z2), axis=1)[:, None]
            factor = (size - 1) * np.log(np.linalg.norm(y - z, axis=1) / length)
        # A walker that lies on its anchor has no line: it stays.
        lost = length == 0.0
        return np.where(lost[:, None], sample, y), np.where(lost, -np.inf, factor)
