"""Results of studies: what was written is read back, and an interruption costs a line at most."""

from pathlib import Path

import pytest

from tests.studies.results import Row, append, stored, until


def squared(number: int) -> Row:
    return {"key": str(number), "square": number**2}


def nothing() -> None:
    """There is nothing to warm."""


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_was_cut_short_is_done_again(jobs: int, tmp_path: Path) -> None:
    path = tmp_path / "study" / "results.jsonl"
    append(until(float("inf"), [1, 2], squared, 1, nothing), path, str)
    with path.open("a") as file:
        file.write('{"key": "3", "squ')
    assert list(stored(path)) == ["1", "2"]
    append(until(float("inf"), [3, 4], squared, jobs, nothing), path, str)
    assert {k: row["square"] for k, row in stored(path).items()} == {"1": 1, "2": 4, "3": 9, "4": 16}


def test_nothing_is_begun_after_the_end(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    append(until(-1.0, [1, 2], squared, 1, nothing), path, str)
    assert stored(path) == {}
    assert stored(tmp_path / "no.jsonl") == {}
