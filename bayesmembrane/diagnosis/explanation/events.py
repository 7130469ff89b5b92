"""Second events of effects that come at once: looked for beside a fit with one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.weighing import Sought, Weighing
from bayesmembrane.diagnosis.explanation.promise import of_changes
from bayesmembrane.diagnosis.thresholds import GROWTH
from bayesmembrane.ground.parameters import Array


def with_second_events(search: Weighing, every: Sequence[Candidate]) -> list[Candidate]:
    """Of these candidates those that a second event makes more probable, with it.

    Films slide out of a clamp, and tear, in steps. Two of them told as one are a poor law, and the other is told as
    another effect: what slid twice, as a film that slid and tore.
    """
    sought = [Sought(c.hypothesis, starts, c) for c in every if (starts := list(_promising(search, c)))]
    if not sought:
        return []
    found = [(s.parent, c) for s, c in zip(sought, search.fits(sought), strict=True) if c is not None]
    after = search.all_polished([c for _, c in found])
    return [c for (before, _), c in zip(found, after, strict=True) if before and c.log_evidence > before.log_evidence]


def _promising(search: Weighing, c: Candidate) -> Iterator[Array]:
    """Coordinates (k,) with a second event where it promises most, of each effect that has none yet."""
    for one, rows in _second_events(c):
        before, *after = search.misfits(c.hypothesis, np.concatenate([one[None, :], rows]))
        changes = np.array(after) - before
        good = np.all(np.isfinite(changes), axis=1)
        if good.any():
            gains = of_changes(search, c, changes[good].T)
            first = np.argsort(-gains)[: GROWTH.second_events]
            yield from (rows[good][i] for i in first if gains[i] > GROWTH.promise)


def _second_events(c: Candidate) -> Iterator[tuple[Array, Array]]:
    """For each effect without a second event, (coordinates (k,) of ``c``, the same with one at each place (m, k))."""
    begin = c.hypothesis.material_size
    for effect in c.hypothesis.effects:
        if effect.second is not None:
            names = [p.name for p in effect.coordinates]
            part, place, second = (begin + names.index(name) for name in effect.second)
            one = c.x.copy()
            if one[part] > 1 - GROWTH.no_event:  # all of it comes in the second
                one[part], one[place] = 0.0, one[second]
            if one[part] < GROWTH.no_event:
                rows = np.tile(one, (len(effect.second_places), 1))
                rows[:, part], rows[:, second] = GROWTH.second_part, effect.second_places
                yield one, rows
        begin += len(effect.coordinates)
