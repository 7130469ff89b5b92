"""What a load cell scatters: heavy tails, more under load, steps of its digits, and readings gone astray at turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_two.course import Course


@dataclass(frozen=True)
class Scatter:
    """sd : N without load; load : of the force, added in squares; freedom : degrees of Student's t; digit : N;
    astray : by what part of the force readings at turns are wrong, 0 for none.
    """

    sd: float
    load: float
    freedom: float
    digit: float
    astray: float

    def deviations(self, force: Any) -> Any:
        """(N,) N, rounding included."""
        return np.sqrt(self.sd**2 + (self.load * force) ** 2 + self.digit**2 / 12)

    def read(self, force: Any, course: Course, rng: np.random.Generator) -> tuple[Any, list[int]]:
        """(the readings (N,) N, numbers of those that went astray)."""
        scale = np.sqrt(self.sd**2 + (self.load * force) ** 2) * np.sqrt(1 - 2 / self.freedom)
        out = force + scale * rng.standard_t(self.freedom, force.size)
        lost = []
        if self.astray:
            for turn in course.turns:
                if rng.random() < 0.3:
                    lost.append(turn)
                    out[turn] += self.astray * rng.uniform(-1.0, 0.3) * (force[turn] + 5 * self.sd)
        return np.round(out / self.digit) * self.digit if self.digit else out, lost


def drawn(top: float, rng: np.random.Generator) -> Scatter:
    """For a film that carries at most ``top`` N."""
    sd = top * float(np.exp(rng.uniform(np.log(4e-4), np.log(3e-3))))
    return Scatter(
        sd,
        load=float(rng.uniform(0.0, 2.0)) * sd / top,
        freedom=float(rng.uniform(3.0, 8.0)),
        digit=sd * float(rng.choice([0.0, 0.5, 2.0])),
        astray=float(rng.uniform(0.02, 0.1)) if rng.random() < 0.35 else 0.0,
    )
