"""Least squares of several hypotheses, side by side: each step asks for the films of all of them at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.descent import Descent, Patience
from bayesmembrane.diagnosis.candidates.standard import Standard
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.thresholds import SEARCH
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.hypothesis import Hypothesis

Asked = tuple[Hypothesis, Array]
"""A hypothesis, and coordinates x (B, k)."""
Batches = Callable[[Sequence[Asked]], Sequence[tuple[Array, Array]]]
"""r (B, N) N, fitted less measured, and dr/dx (B, N, k) of each that is asked; nan where there is no curve."""


@dataclass(frozen=True, eq=False)
class Freeing:
    """W v with W (S + U U^T) W^T = 1: values freed of noise S and of a form error with the columns U.

    With U = Q s V^T freed of noise, W = 1 - Q (1 - 1 / sqrt(1 + s^2)) Q^T after that.
    """

    noise: OwnNoise
    axes: Array
    shrink: Array

    def __call__(self, values: Array) -> Array:
        white = self.noise.white(values)
        along = self.axes.T @ white.reshape(len(white), -1)
        return white - (self.axes @ (self.shrink[:, None] * along)).reshape(white.shape)


class Searching:
    """Searches for one hypothesis from u (B, k), the prior's pull included.

    u, size : where they end, and the roots of their sums of squares (B,); inf without a curve
    """

    def __init__(self, hypothesis: Hypothesis, axes: Standard, freeing: Freeing, starts: Array, most: int) -> None:
        self.hypothesis, self.axes, self.freeing = hypothesis, axes, freeing
        patience = Patience(SEARCH.given_up, slow_by=SEARCH.slow_by, settled=SEARCH.settled)
        self._descent = Descent(starts, axes.bounds, most, patience=patience)
        self._won: list[list[float]] = [[] for _ in starts]
        self._idle = np.zeros(len(starts), dtype=int)

    @property
    def u(self) -> Array:
        return self._descent.x

    @property
    def size(self) -> Array:
        return self._descent.size

    @property
    def asked(self) -> Asked:
        """What it wants to know next: no coordinates once it is done."""
        return self.hypothesis, self.axes.to_x(self._descent.asked)

    @property
    def done(self) -> bool:
        return not len(self._descent.asked)

    @property
    def least(self) -> float:
        """The least sum of squares so far."""
        return float(np.min(self._descent.square))

    def hopeless(self, least: float) -> bool:
        """True if no start that goes on would come near a search that has ``least`` by the steps that are left."""
        near = max(least + SEARCH.behind, SEARCH.times_behind * least)
        return all(self._foretold(row) > near for row in self._descent.rows.tolist())

    def _foretold(self, row: int) -> float:
        """Where a start would end, by steps as long as its last few that won something, or where it has won nothing for
        long; -inf where nobody knows yet. One that is good at first says nothing of the others.
        """
        won = self._won[row][-SEARCH.last_falls :]
        if self._idle[row] >= SEARCH.idle:
            return won[-1]
        if len(won) < SEARCH.last_falls:
            return -np.inf
        return won[-1] - (won[0] - won[-1]) / (len(won) - 1) * self._descent.left

    def give_up(self) -> None:
        """Stay where it is."""
        self._descent.give_up()

    def told(self, r: Array, j: Array) -> None:
        """Go on with residuals (B, N) N and their slopes (B, N, k) in x."""
        u = self._descent.asked
        r, j = _freed(self.freeing, r, j)
        pull, steep = self.axes.pull(u)
        diagonal = steep[:, :, None] * np.eye(u.shape[1])
        self._descent.told(
            np.concatenate([r, pull], axis=1), np.concatenate([j * self.axes.slope(u)[:, None, :], diagonal], axis=1)
        )
        self._idle += 1
        for row in np.flatnonzero([not w or v < w[-1] for w, v in zip(self._won, self._descent.square, strict=True)]):
            self._won[row].append(float(self._descent.square[row]))
            self._idle[row] = 0


def run(searches: Sequence[Searching], batches: Batches) -> None:
    """Until all of them are done, or far behind the best of those that judge by the same noise and form error."""
    going, best = list(searches), dict[Freeing, float]()
    while going:
        found = batches([s.asked for s in going])
        for search, (r, j) in zip(going, found, strict=True):
            search.told(r, j)
            best[search.freeing] = min(best.get(search.freeing, np.inf), search.least)
        for search in going:
            if search.hopeless(best[search.freeing]):
                search.give_up()
        going = [s for s in going if not s.done]


def _freed(freeing: Freeing, r: Array, j: Array) -> tuple[Array, Array]:
    """Residuals (B, N) and slopes (B, N, k) freed; a start without a curve is nan, and only that one."""
    wide = np.moveaxis(np.concatenate([r[:, :, None], j], axis=2), 1, 0)
    out = np.full(wide.shape, np.nan)
    good = np.all(np.isfinite(wide), axis=(0, 2))
    out[:, good] = freeing(wide[:, good])
    out = np.moveaxis(out, 0, 1)
    return out[:, :, 0], out[:, :, 1:]
