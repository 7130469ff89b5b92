"""What is believed of the measured curve before the losses are seen: one family of curves per file.

A family is a prior over force curves g(x): unknown numbers with independent standard normal priors, and a size of
what is smooth and unknown in it, which is marginalised over a few values. Everything else, from trilateration to the
evidence, is the same for all families.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from bayesmembrane.ground.parameters import Array

ROUNDS = 12
NEAR = 0.02  # of each force: how well a curve is to be met at first


class CurveFamily(ABC):
    """A prior over force curves.

    name, title : how answers call it, how reports print it
    """

    name: str
    title: str

    @property
    @abstractmethod
    def sizes(self) -> tuple[float, ...]:
        """Values of the size of its smooth unknown part, all equally probable beforehand."""

    @property
    @abstractmethod
    def middle(self) -> float:
        """The one of them that is used where one must do."""

    @property
    def ready(self) -> bool:
        """Whether it is good for any curve as it is, and needs not be made ready for those near one."""
        return True

    @property
    @abstractmethod
    def size(self) -> int:
        """J, the number of unknowns."""

    @property
    @abstractmethod
    def free(self) -> slice:
        """Which of the unknowns are measured in the size of the smooth part."""

    @abstractmethod
    def force(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        """g (B, N) in N at x (B, N) in m, dg/dx (B, N) in N/m, dg/dc (B, N, J); unknowns c (B, J), sizes (B,)."""

    def stride(self, moved: Array, force: Array, step: Array) -> float:
        """The part of a step (J,) that is safe where ``moved`` (N, J) are the derivatives of the forces (N,).

        No force changes by more than half of itself and a fiftieth of the largest.
        """
        scale = np.abs(force) + 0.02 * float(np.max(np.abs(force))) + 1e-6
        return min(1.0, 0.5 / max(float(np.max(np.abs(moved @ step) / scale)), 1e-12))

    def nearest(self, x: Array, force: Array, start: Array, rounds: int = ROUNDS) -> Array:
        """Unknowns (J,) of the curve through ``force`` (N,) at ``x`` (N,), met to `NEAR` of each; from ``start``."""
        c, sizes, sd = start, np.array([self.middle]), NEAR * (np.abs(force) + 0.02 * float(np.max(force)))
        for _ in range(rounds):
            y, _, moved = (v[0] for v in self.force(c[None], sizes, x[None]))
            a = moved / sd[:, None]
            new = np.linalg.solve(a.T @ a + np.eye(self.size), a.T @ ((force - y) / sd + a @ c))
            c = c + self.stride(moved, y, new - c) * (new - c)
        return c

    def placed(self, x: Array, force: Array) -> tuple[CurveFamily, Array]:
        """The family made ready for curves near ``force`` (N,) at ``x`` (N,), and the unknowns (J,) of the nearest."""
        return self, self.nearest(x, force, np.zeros(self.size))

    def settled(self, c: Array) -> tuple[CurveFamily, bool]:
        """The family made ready for curves near unknowns c (J,), and whether it was already."""
        return self, True
