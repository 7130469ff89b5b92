"""Sets that were fitted with some energies only: what the others would add, by the sets that these grew from."""

from __future__ import annotations

from collections.abc import Mapping

from bayesmembrane.diagnosis.explanation.twins import Set

Key = tuple[str, Set]
"""Energy, and all effects."""


def unfitted(found: Mapping[Key, float]) -> dict[Key, float]:
    """ln Z of the energies that a set was not fitted with, where a set that is a part of it was:

        ln Z(set, e) = ln Z(set, e0) + min(ln Z(part, e) - ln Z(part, e0), 0),

    with e0 the best energy of the set, and of its parts with both energies the largest, and of those the most probable.
    A sum over energies in which most of them are missing is too small beside one that has all. Of 400 sets with all
    five energies on the calibration half of `make study-reliability` (cases 560 to 774), the energies without the first
    one bring the sum up by 1.4 in ln (weighed as there), and by 0.9 as it is foretold here.
    """
    energies = {energy for energy, _ in found}
    out: dict[Key, float] = {}
    for names in {names for _, names in found}:
        fitted = {e: found[e, names] for e in energies if (e, names) in found}
        first = max(fitted, key=fitted.__getitem__)
        for energy in energies - set(fitted):
            parts = [
                (len(part), log_evidence, found[energy, part] - log_evidence)
                for (e, part), log_evidence in found.items()
                if e == first and part < names and (energy, part) in found
            ]
            if parts:
                out[energy, names] = fitted[first] + min(max(parts)[2], 0.0)
    return out
