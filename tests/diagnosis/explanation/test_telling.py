"""How the sum is told: what is flattened, and what is not."""

import pytest

from bayesmembrane.diagnosis.explanation import telling
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.telling import NOTHING


def test_no_effect_keeps_what_it_has_where_sets_are_flattened() -> None:
    """A hundred sets that are next to nothing each would else come to more than it."""
    sets = {"friction": 0.2, **{f"set {i}": 0.003 for i in range(100)}}
    flat = telling._flattened({(NOTHING, NOTHING): 0.5, **{(name, NOTHING): p for name, p in sets.items()}}, {})
    assert flat[NOTHING, NOTHING] == pytest.approx(0.5)
    assert {name: p for (name, _), p in flat.items() if name != NOTHING} == pytest.approx(BELIEFS.flattened(sets))
    assert flat["friction", NOTHING] < 0.1
    assert list(flat.values()) == sorted(flat.values(), reverse=True)
