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


MISTAKEN = {"force_offset": 0.01, "friction": 0.01, "mullins": 0.25, "tearing": 0.25}


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("force_offset", 0.99, 1.0),
        ("mullins", 0.96, 0.97),
        ("force_offset+friction", 0.97, 0.99),
        ("force_offset+mullins", 0.73, 0.76),
        ("friction+mullins+tearing", 0.54, 0.57),
    ],
)
def test_what_stands_out_is_told_as_surely_as_its_effects_are_seldom_mistaken(
    name: str, least: float, most: float
) -> None:
    joint = {(NOTHING, NOTHING): 1e-6, (name, NOTHING): 1.0 - 1e-6}
    flat, told = telling.told(joint, MISTAKEN, {})
    assert flat == pytest.approx(joint)
    assert least < told[name, NOTHING] < most
    assert sum(told.values()) == pytest.approx(1.0)
    assert told[NOTHING, NOTHING] == pytest.approx(1e-6)


def test_beside_what_is_foreign_effects_stand_in_for_others_too() -> None:
    joint = {("mullins+friction", "lost_steps"): 0.7, ("mullins+friction", NOTHING): 0.3}
    _, told = telling.told(joint, MISTAKEN, {})
    for kind, p in (("lost_steps", 0.7), (NOTHING, 0.3)):
        beside = {name: q for (name, k), q in told.items() if k == kind}
        assert sum(beside.values()) == pytest.approx(p)
        assert beside["friction+tearing"] > beside["force_offset+friction"] > 0
