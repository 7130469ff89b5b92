"""What was found lately is found again, and what is older is made anew."""

from bayesmembrane.ground.lately import Lately


def test_what_is_known_is_not_made_again() -> None:
    made: list[int] = []
    known = Lately[int, int](2)
    for key in (1, 2, 1, 2, 1):
        assert known.of(key, lambda key=key: made.append(key) or 10 * key) == 10 * key
    assert made == [1, 2]


def test_the_oldest_is_forgotten_first() -> None:
    made: list[int] = []
    known = Lately[int, int](2)
    for key in (1, 2, 3, 2, 3, 1):
        known.of(key, lambda key=key: made.append(key) or key)
    assert made == [1, 2, 3, 1]


def test_a_value_may_be_nothing() -> None:
    made: list[int] = []
    known = Lately[int, None](1)
    for _ in range(3):
        assert known.of(1, lambda: made.append(1)) is None
    assert made == [1]
