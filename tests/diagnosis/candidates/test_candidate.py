"""Which effects are sought in a test."""

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import available
from bayesmembrane.physics.hypothesis import hypothesis
from tests.physics.effects.protocols import measured, staircase


@pytest.mark.parametrize("comes_back", [True, False])
def test_hysteresis_is_sought_where_a_leg_comes_back(comes_back: bool) -> None:
    """On a single loading it is a power of the deflection, as an energy is that differs a little."""
    m = measured() if comes_back else measured(np.linspace(1e-3, float(np.max(staircase())), 60), np.arange(60) + 1.0)
    assert ("hysteresis" in {e.name for e in available(m, hypothesis("gent"))}) == comes_back
