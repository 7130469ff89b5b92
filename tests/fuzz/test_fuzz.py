"""Calls of the command line at random: no traceback, refusals in one sentence, answers that are whole."""

import json
from pathlib import Path

import pytest

from tests.fuzz import calls
from tests.fuzz.calls import GOOD, Row, call, contradiction, judged
from tests.fuzz.cases import Case, case
from tests.fuzz.run import page, run, stored, table

CALLS = 500
# Quick ones of every rig and verb, among them those that once failed and have been mended.
FIXED = (
    1,
    2,
    4,
    5,
    6,
    13,
    16,
    20,
    22,
    23,
    27,
    31,
    34,
    39,
    44,
    47,
    52,
    57,
    66,
    67,
    70,
    75,
    76,
    84,
    247,
    21010,
    21035,
    22217,
)


@pytest.mark.parametrize("seed", FIXED)
def test_a_call_is_answered_or_refused(seed: int, tmp_path: Path) -> None:
    row = call(case(seed), tmp_path)
    assert row.outcome in GOOD, f"{row.outcome}: {row.sentence} ({row.verb} {row.arguments})"


@pytest.mark.study
def test_every_call_is_answered_or_refused(tmp_path: Path) -> None:
    results = tmp_path / "results.csv"
    run(map(case, range(CALLS)), results, 1)
    rows = stored(results).values()
    assert len(rows) == CALLS
    assert all(r.outcome in GOOD for r in rows), table(rows)


def test_a_seed_is_a_call() -> None:
    assert case(3) == case(3)
    assert len({case(seed).files for seed in range(20)}) == 20


@pytest.mark.parametrize(
    ("code", "out", "err", "outcome"),
    [
        (1, "", "curve.csv: the file is empty and has no rows; export it again.", "refused"),
        (1, "", "the file is empty and has no rows at all", "no sentence"),
        (1, "{}", "curve.csv: the file is empty and has no rows; export it again.", "no sentence"),
        (1, "", "the shift is nan and no shift at all; export it again.", "no sentence"),
        (3, "", "curve.csv: the file is empty and has no rows; export it again.", "no sentence"),
        (2, "", "Usage: bayesmembrane\n Error  Invalid value for --seed", "refused"),
        (0, '{"rmse_N": NaN}', "", "wrong answer"),
        (0, "", "", "wrong answer"),
    ],
)
def test_the_judge_knows_a_sentence(code: int, out: str, err: str, outcome: str) -> None:
    assert judged(Case(0, "fit", (), (), ""), code, out, err)[0] == outcome


def test_the_judge_knows_a_contradiction() -> None:
    good = {"rmse_N": 1.0, "loss_N": 2.0, "max_N": 1.5, "status": "converged", "parameters": {"c1": {"value": 1.0}}}
    good["parameters"]["c1"]["sd"] = None
    assert contradiction("fit", good) == ""
    assert "converged" in contradiction("fit", good | {"rmse_N": None})
    assert "nan" in contradiction("fit", good | {"status": "stopped at nan"})
    assert "converged" in contradiction("fit", good | {"constrained": good | {"loss_N": None}})
    found = {"verdict": "adequate", "effects": [], "material": "", "sentence": "Fine.", "p_value": 0.5}
    found["error"] = {"before": {"rmse_N": 1.0}}
    assert contradiction("diagnose", json.loads(json.dumps(found))) == ""
    assert "mullins" in contradiction("diagnose", found | {"effects": ["mullins"]})
    assert "p-value" in contradiction("diagnose", found | {"p_value": None})


@pytest.mark.parametrize("compiled", [False, True])
def test_a_call_that_is_given_up_is_no_traceback(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, compiled: bool
) -> None:
    """Where compiled code is interrupted, Python raises another error from the one that was meant."""

    def main() -> None:
        try:
            raise calls.TimeUpError
        except calls.TimeUpError as error:
            if compiled:
                raise SystemError("returned a result with an exception set") from error
            raise

    monkeypatch.setattr(calls, "main", main)
    row = call(Case(7, "fit", (("curve.csv", ""), ("film.toml", "")), (), "empty"), tmp_path)
    assert (row.outcome, row.sentence.partition(",")[0]) == ("timeout", "no answer in 60 s")


def test_a_run_goes_on_where_it_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = tmp_path / "results.csv"
    refused = Case(7, "fit", (("curve.csv", ""), ("film.toml", "")), ("--material", "gent"), "empty")
    results.touch()  # as an interruption before the first row leaves it
    run([refused], results, 1)
    first = results.read_text()
    run([refused], results, 1)
    assert results.read_text() == first
    assert stored(results)[7].outcome == "refused"
    assert "| fit | 1 | " in table(stored(results).values())


def test_no_call_is_begun_once_the_time_is_over(tmp_path: Path) -> None:
    results = tmp_path / "results.csv"
    run([Case(7, "fit", (("curve.csv", ""), ("film.toml", "")), (), "empty")], results, 1, seconds=0)
    assert stored(results) == {}


def test_the_page_says_how_many_ran_and_what_failed() -> None:
    rows = [
        Row(7, "fit", "a film", 0, 1.0, "answered", ""),
        Row(8, "sample", "a film", 1, 2.0, "traceback", "ZeroDivisionError: nobody foresaw this"),
    ]
    told = page(rows, 7, 500, "The first ran before it was mended.")
    assert "given up.\n\nThe first ran before it was mended.\n\n| verb |" in told
    assert "2 of 500 seeds were run; 1 calls were answered or refused, 0 given up." in told
    assert "traceback: ZeroDivisionError: nobody foresaw this\n  seeds 8" in told
