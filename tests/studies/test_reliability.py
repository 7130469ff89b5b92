"""The reliability study: its plan is frozen and balanced, and its tables count what they say."""

from collections import Counter
from itertools import islice

import numpy as np
import pytest

from tests.generator.energies import DECLARED
from tests.generator.setups import setup
from tests.studies import reliability, second_plan
from tests.studies.reliability_plan import ROUND, Case, measured, plan
from tests.studies.reliability_rows import answer_row, beliefs, right_name, truth_row, wrong_name
from tests.studies.reliability_table import counted_firm, held, merged, of_truth, report


def row(probabilities=None, **other):
    """A row of a case with friction 20 and drift 2, the second of them faint."""
    truth = {
        "effects": {"friction": {}, "force_drift": {}},
        "snr": {"friction": 21.0, "force_drift": 4.0},
        "snr_own": {"friction": 20.0, "force_drift": 2.0},
        "family": "gent",
        "expected": ["named", "ambiguous"],
    }
    answer = {
        "verdict": "named",
        "effects": ["friction"],
        "material": "",
        "sentence": "",
        "error": {"heldout_coverage_90_after": 0.9, "after": {"reduced_chi2": 1.0}},
        "probabilities": probabilities,
    }
    head = {"number": 0, "group": "pair", "energy": "declared", "seed": 2, "seconds": 1.0}
    return head | truth_row(truth | other.pop("truth", {}), True) | answer_row(answer | other)


def test_the_halves_share_no_seed_and_every_prefix_is_balanced() -> None:
    one, two = list(plan("calibration")), list(plan("test"))
    assert {c.seed % 2 for c in one} == {0}
    assert {c.seed % 2 for c in two} == {1}
    assert [(c.group, c.kind) for c in one] == [(c.group, c.kind) for c in two]
    assert len({c.key for c in (*one, *two)}) == len(one) + len(two)
    assert one == list(plan("calibration"))
    for rounds in (1, 7, 60):
        found = Counter(c.group for c in one[: rounds * len(ROUND)])
        assert found == {g: rounds * n for g, n in Counter(ROUND).items()}
    singles = Counter(c.kind for c in islice((c for c in one if c.group == "single"), 26))
    assert set(singles.values()) == {2}
    for c in one:
        assert c.material in DECLARED
        assert c.kind.partition("+")[0] != f"typical:{c.material}"
        own = [s for k, s in zip(c.kind.split("+"), c.strengths, strict=False) if ":" not in k]
        assert not own or (min(own) >= max(own) / 5 * 0.999 and 0.25 <= max(own) <= 5.0)


@pytest.mark.parametrize("number", [2, 6, 19])
def test_a_case_is_one_measurement(number: int) -> None:
    case = next(islice(plan("calibration"), number, None))
    one, two = measured(case), measured(case)
    assert one.csv == two.csv
    assert sorted(one.truth["effects"]) == sorted(k for k in case.kind.split("+") if ":" not in k)
    assert f"{1e6 * one.bench.thickness:.6g}" in one.toml


def test_a_film_that_locks_is_pulled_less_far(monkeypatch) -> None:
    tried = []

    def further(faults, seed, shrink):
        tried.append(shrink)
        return setup(faults, seed, 4 * shrink)

    monkeypatch.setattr("tests.studies.reliability_plan.setup", further)
    d = measured(Case(0, "null", "null", "gent", (), 8))
    assert len(tried) > 1
    np.testing.assert_allclose(tried, 0.8 ** np.arange(len(tried)))
    assert d.path.largest == pytest.approx(max(further((), 8, tried[-1]).protocol.peaks))


def test_the_second_plan_is_balanced_and_made_by_the_second_generator() -> None:
    cases = list(second_plan.plan())
    for rounds in (1, 15):
        found = Counter(c.group for c in cases[: rounds * len(second_plan.ROUND)])
        assert found == {g: rounds * n for g, n in Counter(second_plan.ROUND).items()}
    assert len({c.key for c in cases}) == len(cases)
    assert {c.seed for c in cases}.isdisjoint(c.seed for h in ("calibration", "test") for c in plan(h))
    pair = next(c for c in cases if c.group == "pair")
    data = second_plan.measured(pair)
    assert sorted(data.truth["effects"]) == sorted(pair.kind.split("+")[1:])
    with pytest.raises(ValueError, match="tuned"):
        next(second_plan.plan("calibration"))


@pytest.mark.parametrize(("source", "half"), [("own", "calibration"), ("second", "second")])
def test_a_case_is_asked_as_it_says_and_kept(monkeypatch, tmp_path, capsys, source, half) -> None:
    asked = []

    def answered(measurement, material):
        asked.append(material)
        return None

    said = {"verdict": "unknown", "effects": [], "material": "", "sentence": "s"}
    said["error"] = {"heldout_coverage_90_after": None, "after": {"reduced_chi2": 2.0}}
    said["probabilities"] = {"effects": {"none": 0.7, "mullins": 0.3}, "energies": {"gent": 1.0}, "foreign": {}}
    monkeypatch.setattr(reliability, "diagnosed", answered)
    monkeypatch.setattr(reliability, "document", lambda found: said)
    monkeypatch.setattr(reliability, "warmed", lambda: None)
    monkeypatch.setattr(reliability, "terms", lambda found: [("gent", "none", -1.0)])
    file = tmp_path / "results.jsonl"
    halves = ["--half", half] if source == "own" else []
    call = ["--generator", source, *halves, "--count", "2", "--energy", "both", "--results", str(file)]
    assert reliability.main(call) == 0
    declared = [c.material for c in islice(reliability.SOURCES[source].plan(half, reliability.SOURCES[source].seed), 2)]
    assert asked == [declared[0], None, declared[1], None]
    assert "none 0.7, mullins 0.3 | gent 1" in capsys.readouterr().out
    assert reliability.main(call) == 0  # nothing is asked twice
    assert len(asked) == 4
    assert {r["half"] for r in reliability.stored(file).values()} == {half}
    assert reliability.main(["--summary", str(file)]) == 0
    assert "4 diagnoses of the plan" in capsys.readouterr().out


def test_faint_effects_are_no_truth_and_unknown_ones_are_foreign() -> None:
    r = row({"effects": {"force_drift+friction": 0.6, "friction": 0.3, "none": 0.1}, "energies": {}, "foreign": {}})
    assert (r["truth"], r["faint"], r["foreign"]) == (["friction"], ["force_drift"], [])
    assert merged(r) == pytest.approx({("friction",): 0.9, (): 0.1})
    assert of_truth(r) == pytest.approx(0.9)
    assert right_name(r)
    assert right_name(r | {"effects": ["force_drift", "friction"]})
    assert wrong_name(r | {"effects": ["friction", "mullins"]})
    assert wrong_name(r | {"effects": ["force_drift"]})
    assert not wrong_name(r | {"verdict": "ambiguous", "effects": ["mullins"]})
    strange = row(truth={"effects": {"ripple": {}}, "snr_own": {"ripple": 30.0}})
    assert strange["foreign"] == ["ripple"]
    assert wrong_name(strange)


def test_the_truth_is_held_where_the_most_probable_sets_reach_it() -> None:
    def with_(p: dict[str, float], **foreign: float):
        return row({"effects": p, "energies": {}, "foreign": foreign})

    assert held(with_({"mullins": 0.9, "friction": 0.1}))
    assert not held(with_({"mullins": 0.96, "friction": 0.04}))
    assert not held(with_({"mullins": 0.94, "none": 0.02, "friction": 0.01}))
    # Foreign faults are rivals of the sets where one sum holds them all, and otherwise a question of their own.
    assert not held(with_({"friction": 0.03, "none": 0.01}, ripple=0.96))
    assert held(with_({"friction": 0.4, "mullins": 0.6}, ripple=0.96))
    assert of_truth(with_({"friction": 0.4, "none": 0.1}, ripple=0.5)) == pytest.approx(0.4)


def test_no_effect_is_the_right_set_where_what_is_foreign_is_a_question_of_its_own() -> None:
    strange = {"effects": {"ripple": {}}, "snr_own": {"ripple": 30.0}}
    apart = row({"effects": {"none": 0.999}, "energies": {}, "foreign": {"ripple": 0.999}}, truth=strange)
    together = row({"effects": {"none": 0.001}, "energies": {}, "foreign": {"ripple": 0.999}}, truth=strange)
    for r in (apart, together):
        sets = report([r], "made up").split("## Sets of effects")[1].split("##")[0]
        assert "| 0.99 to 1 | 0.9990 | 1 / 1" in sets


def test_firm_effects_are_counted_where_there_is_no_name() -> None:
    some = [
        row(verdict="ambiguous", firm=["friction", "force_drift"]),
        row(verdict="unknown", firm=["mullins"]),
        row(verdict="named", firm=["hysteresis"]),
        row(verdict="ambiguous"),
    ]
    assert counted_firm(some).startswith("2 / 3 ")
    assert counted_firm(some[2:]) == counted_firm([])


def test_names_of_sets_are_in_one_order_and_nothing_is_lost() -> None:
    found = beliefs(
        {"effects": {"b+a": 0.2, "a+b": 0.3, "none": 0.5}, "energies": {"gent": 1.0}, "foreign": {"none": 1}}
    )
    assert found == {"effects": {"a+b": 0.5, "none": 0.5}, "energies": {"gent": 1.0}, "foreign": {}}
    assert beliefs(None) is None


def test_stated_probabilities_that_are_frequencies_pass_as_such() -> None:
    rng = np.random.default_rng(5)
    rows = []
    for i in range(400):
        p = float(rng.choice([0.3, 0.7, 0.97]))
        effects = {"friction": p, "mullins": 1 - p}
        named = {} if rng.random() < p else {"effects": {"mullins": {}}, "snr_own": {"mullins": 9.0}}
        rows.append(row({"effects": effects, "energies": {"gent": 1.0}, "foreign": {}}, truth=named) | {"number": i})
    text = report(rows, "made up")
    hits = sum(r["truth"] == ["friction"] for r in rows)
    assert f"| named and right | {hits} / 400" in text.replace("effects of the library: named", "named")
    lines = [x for x in text.split("## Sets of effects")[1].split("##")[0].splitlines() if " to " in x]
    for line in lines:
        _, _, mean, found, _ = (x.strip() for x in line.split("|"))
        low, high = (float(x) / 100 for x in found.split("[")[1].rstrip("]").split(", "))
        assert low - 0.1 <= float(mean) <= high + 0.1
    assert len(lines) == 4  # 0.01 to 0.05, 0.2 to 0.5, 0.5 to 0.8, 0.95 to 0.99


def test_an_answer_without_probabilities_is_counted_by_its_name_alone() -> None:
    text = report([row(), row() | {"effects": ["mullins"]}], "made up")
    assert "2 without probabilities" in text
    assert "| wrong unique names, of all names | 1 / 2" in text
