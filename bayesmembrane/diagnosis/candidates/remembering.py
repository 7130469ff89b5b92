"""A hypothesis at the readings of one measurement, and what was found lately at single points of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from bayesmembrane.calibration.objective import Objective
from bayesmembrane.ground.lately import Lately
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.in_step import in_step

ROWS = 8
"""Points that are remembered: a search ends at one of its last few, and that is asked for again at once."""


@dataclass(frozen=True, eq=False)
class RememberingObjective:
    """r (B, N) N and dr/dx (B, N, k) of an objective without weights; it does not solve its last few points again."""

    objective: Objective
    _rows: Lately[bytes, tuple[Array, Array]] = field(default_factory=lambda: Lately(ROWS), init=False, repr=False)

    def batch(self, x: Array) -> tuple[Array, Array]:
        """As `Objective.batch`, at x (B, k)."""
        return together([(self, x)])[0]

    def known(self, x: Array) -> tuple[Array, Array] | None:
        """What is remembered of x (1, k); None if nothing is, or more points are asked for."""
        found = self._rows.get(x.tobytes()) if len(x) == 1 else None
        return None if found is None else (found[0][None], found[1][None])

    def keep(self, x: Array, found: tuple[Array, Array]) -> tuple[Array, Array]:
        """Remember what was ``found`` at x (B, k)."""
        for row, r, j in zip(x, *found, strict=True):
            self._rows.keep(row.tobytes(), (r, j))
        return found


def together(asked: Sequence[tuple[RememberingObjective, Array]]) -> list[tuple[Array, Array]]:
    """r (B, N) and dr/dx (B, N, k) of each, at x (B, k), solved side by side; all are of one measurement."""
    found = {i: known for i, (e, x) in enumerate(asked) if (known := e.known(x)) is not None}
    rest = [i for i in range(len(asked)) if i not in found]
    shown = in_step([(asked[i][0].objective.forward, asked[i][1]) for i in rest])
    for i, prediction in zip(rest, shown, strict=True):
        e, x = asked[i]
        assert prediction.sensitivity is not None
        found[i] = e.keep(x, (prediction.force - e.objective.measurement.force, prediction.sensitivity))
    return [found[i] for i in range(len(asked))]
