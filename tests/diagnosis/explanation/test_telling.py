"""How the sum is told: what is flattened, and what is not."""

import pytest

from bayesmembrane.diagnosis.explanation import telling
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.telling import NOTHING


def test_no_effect_keeps_what_it_has_where_sets_are_flattened() -> None:
    """A hundred sets that are next to nothing each would else come to more than it."""
    sets = {"friction": 0.2, **{f"set {i}": 0.003 for i in range(100)}}  # all of one effect
    flat = telling._flattened({(NOTHING, NOTHING): 0.5, **{(name, NOTHING): p for name, p in sets.items()}}, {})
    assert flat[NOTHING, NOTHING] == pytest.approx(0.5)
    assert {name: p for (name, _), p in flat.items() if name != NOTHING} == pytest.approx(BELIEFS.flattened(sets))
    assert flat["friction", NOTHING] < 0.1
    assert list(flat.values()) == sorted(flat.values(), reverse=True)


VISIBLE = ["friction", "mullins", "rate", "tearing"]


@pytest.mark.parametrize(("name", "size"), [("rate", 1), ("mullins+rate", 2), ("friction+mullins+rate", 3)])
def test_of_several_effects_that_stand_out_a_part_is_told_of_those_next_to_them(name: str, size: int) -> None:
    """However sure the sum is: one of them may stand in for another, or for what is wrong with a law."""
    joint = {(NOTHING, NOTHING): 1e-6, (name, NOTHING): 1.0 - 1e-6}
    flat, told = telling.told(joint, VISIBLE, {})
    assert flat == pytest.approx(joint)
    away, kept = BELIEFS.stands_in[size], sum(q for (sets, _), q in told.items() if sets == name)
    assert 1 - away - 1e-5 < kept <= 1 - 0.8 * away  # of what goes two steps, some comes back
    assert sum(told.values()) == pytest.approx(1.0)
    less = [told.get(("+".join(sorted({*name.split("+")} - {n})), NOTHING), 0.0) for n in name.split("+")]
    assert size == 1 or min(less) > 0.05 * away


def test_nothing_is_told_of_more_effects_where_one_stands_out() -> None:
    joint = {(NOTHING, NOTHING): 0.001, ("rate", NOTHING): 0.98, ("rate+tearing", NOTHING): 0.019}
    _, told = telling.told(joint, VISIBLE, {})
    assert told["rate", NOTHING] >= joint["rate", NOTHING]
