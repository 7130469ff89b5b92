"""All random streams of the tests can be moved to others, and stay where they are without being asked."""

import numpy as np
import pytest

from tests.seeds import NAME, NUMPY, move, moved
from tests.studies.seeds import GROUPS, ROOT, Heard, Row, missing, page


def test_an_offset_moves_every_seed_of_whole_numbers() -> None:
    other = moved(3)
    for seed in (5, [5, 7], (5, 7), np.int64(5)):
        assert other(seed).random() != NUMPY(seed).random()
        assert other(seed).random() == other(seed).random()
    assert moved(4)(5).random() != other(5).random()
    assert other(5).random() == NUMPY([3, 5]).random()


def test_generators_and_sequences_of_seeds_stay() -> None:
    generator = NUMPY(5)
    assert moved(3)(generator) is generator
    assert moved(3)(np.random.SeedSequence(5)).random() == NUMPY(5).random()
    assert moved(3)(None).random() != moved(3)(None).random()


@pytest.mark.parametrize("offset", ["0", "7"])
def test_the_environment_asks_for_it(monkeypatch: pytest.MonkeyPatch, offset: str) -> None:
    monkeypatch.setattr(np.random, "default_rng", np.random.default_rng)
    monkeypatch.setenv(NAME, offset)
    assert move() == int(offset)
    assert (np.random.default_rng is NUMPY) == (offset == "0")


def test_the_files_of_the_study_exist_and_its_table_counts() -> None:
    for _, files in GROUPS.values():
        assert all((ROOT / f).exists() for f in files), files
    rows = [Row("quick", s, "wide", "a::b", "failed" if s == 2 else "passed", 0.5) for s in (1, 2, 3)]
    assert "| quick | `a::b` | 3 | 2 | 0 | - | 0.5 |" in page(rows)


def test_seeds_go_on_where_they_were_by_group_and_arithmetic() -> None:
    rows = [Row("quick", s, "wide", "a::b", "passed", 0.5) for s in (1, 2, 4)]
    assert missing("quick", "wide", 5, rows) == [3, 5]
    assert missing("quick", "off", 2, rows) == missing("slow", "wide", 2, rows) == [1, 2]
    assert len(missing("quick", "off", None, rows)) == GROUPS["quick"][0]


def test_a_test_is_as_bad_as_the_worst_of_its_parts() -> None:
    heard = Heard()
    for outcome in ("passed", "failed", "passed"):
        heard.pytest_runtest_logreport(
            pytest.TestReport("a.py::b", ("a.py", 1, "b"), {}, outcome, None, "call", duration=0.5)  # type: ignore[arg-type]
        )
    assert heard.outcomes == {"a.py::b": "failed"}
    assert heard.seconds == {"a.py::b": 1.5}
