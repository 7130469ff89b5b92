"""Films that differ in one coordinate: what is computed once for all of them is what each has by itself."""

from itertools import combinations

import numpy as np
import pytest

from bayesmembrane.physics import composition
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.shared import Shared
from tests.physics.effects.protocols import measured

NAMES = ("clamp_slip", "hysteresis", "permanent_set", "prestretch", "tearing", "viscoelastic", "zero_offset")
PAIRS = (("clamp_slip", "clamp_bending"), ("force_drift", "friction"), ("mullins", "rate"))
SETS = (*list(combinations(NAMES, 3))[::3], *PAIRS)


@pytest.mark.parametrize("effects", SETS, ids="+".join)
def test_shared_stages_equal_those_of_each_film(effects: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    class Kept(Shared):
        def forces(self) -> list[np.ndarray]:
            seen.append((self, super().forces()))
            return seen[-1][1]

    monkeypatch.setattr(composition, "Shared", Kept)
    h, m, rng = hypothesis("yeoh", effects), measured(), np.random.default_rng(4)
    where = rng.uniform(0.4, 0.6, (3, h.curve_size))
    x = np.stack([p.prior.quantile(w) for p, w in zip(h.parameters, where.T, strict=False)], axis=1)
    f = Forward(h, m, m.deflection)
    f(x, sensitivities=True, reached=False)
    ((shared, forces),) = seen
    assert len(forces) == 1 + h.curve_size
    at = np.broadcast_to(f.path.deflection, (3, f.path.deflection.size))
    for law, point, force in zip(shared.laws, shared.points, forces, strict=True):
        assert np.array_equal(force, f.composition.film(law, point, at)[0], equal_nan=True)
