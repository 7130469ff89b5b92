"""Which effects are sought in a test."""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate, available
from bayesmembrane.diagnosis.candidates.speeds import one_speed
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.stored import read, store
from bayesmembrane.physics.hypothesis import hypothesis
from tests.physics.effects.protocols import measured, staircase, timeless


@pytest.mark.parametrize("comes_back", [True, False])
def test_hysteresis_is_sought_where_a_leg_comes_back(comes_back: bool) -> None:
    """On a single loading it is a power of the deflection, as an energy is that differs a little."""
    m = measured() if comes_back else measured(np.linspace(1e-3, float(np.max(staircase())), 60), np.arange(60) + 1.0)
    assert ("hysteresis" in {e.name for e in available(m, hypothesis("gent"))}) == comes_back


@pytest.mark.parametrize(("held", "timed", "seen"), [(6, True, True), (6, False, False), (0, True, False)])
def test_relaxation_is_sought_on_stairs_whose_steps_are_held_for_few_readings(
    held: int, timed: bool, seen: bool
) -> None:
    """Up, and not back; waiting at zero before the test is no hold on the way."""
    step, foot = np.linspace(0.0, 2e-3, 6)[1:], 2e-3 * np.arange(6)
    way = np.concatenate([np.zeros(8), *[np.append(x + step, np.full(held, x + step[-1])) for x in foot]])
    m = measured(way, np.arange(way.size) + 1.0)
    m = m if timed else timeless(m)
    assert not m.holds
    assert m.has_pauses is seen
    assert ("viscoelastic" in {e.name for e in available(m, hypothesis("gent"))}) is seen
    assert not (seen and one_speed(m))


def test_what_was_stored_of_an_effect_with_other_parameters_is_told_so(tmp_path: Path) -> None:
    claim, none = hypothesis("gent", ["rate"]), np.zeros(0)
    for size, known in ((claim.curve_size, True), (3, False)):  # as many as it had when it was a power of the speed
        held = Candidate(claim, np.zeros(size), none, none, 0.0, (), none, none, none)
        folder = store(tmp_path / str(size), "diagnosis", held, {})
        if known:
            assert read(folder, "diagnosis").parameters["rate.exponent"] == 0.0
        else:
            with pytest.raises(StorageError, match=r"another version.*gent\+rate has \d parameters, and 3 are stored"):
                read(folder, "diagnosis")
