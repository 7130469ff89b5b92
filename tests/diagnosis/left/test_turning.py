"""What begins at a turn beside a law of loops is told, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.turning import at_a_turn
from bayesmembrane.physics.hypothesis import hypothesis
from tests.diagnosis.curves import SD, measured, triangle, white_noise


@pytest.mark.parametrize(
    ("names", "moment", "told"),
    [
        (["tearing", "hysteresis"], 40.5, True),  # the second peak; the first is at 10 s
        (["tearing", "hysteresis"], 10.4, True),
        (["tearing", "hysteresis"], 33.0, False),
        (["tearing", "force_offset"], 40.5, False),
        (["tearing"], 40.5, False),
        (["hysteresis", "friction"], 40.5, False),
    ],
)
def test_a_tear_at_a_turn_beside_loops_is_told(names: list[str], moment: float, told: bool) -> None:
    d = triangle(60)
    m = measured(8 * d, d)
    h = hypothesis("neo_hookean", names).on(m)
    turns = m.path.clock[np.flatnonzero(np.diff(m.path.leg))]
    assert np.min(np.abs(turns - 40.5)) < 1
    assert np.min(np.abs(turns - 10.4)) < 1
    search = Search(m, white_noise(m, SD))
    (start,) = search.material_starts(hypothesis("neo_hookean"))[:1]
    fit = search.at(h, np.concatenate([start, *(e.typical for e in h.effects)]))
    assert fit is not None
    x = fit.x.copy()
    if "tearing" in names:
        x[h.names.index("tearing.moment")] = moment
    assert (at_a_turn(replace(fit, x=x), m) is not None) is told
