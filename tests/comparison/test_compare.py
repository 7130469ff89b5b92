"""Hypotheses side by side: rows, ranking, and what is stored and used again."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.sampling.proposals import mixture
from bayesmembrane.comparison import jobs as comparison_jobs
from bayesmembrane.comparison.compare import claimed, compare, ranges_of
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, Disagreement, together
from bayesmembrane.comparison.evidence.target import Coverage, EvidenceEstimate
from bayesmembrane.comparison.jobs import Judging
from bayesmembrane.comparison.leave_out.score import LeaveOneOut
from bayesmembrane.comparison.parts import kept
from bayesmembrane.comparison.prior_widths import Unknown, Widened
from bayesmembrane.comparison.result import Row, probabilities, ranked
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.thinning import MOST
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.stored import read, store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words.comparison import document, no_ranking, preferred
from tests.ground.values import stored_equals_given
from tests.short_walks import shorten

FEW = (1, 2, 4)  # components of a density beside so plain a posterior


def film(name: str = "gent", parameters: tuple[float, ...] = (7.0, 20.0), end: float = 0.06) -> Measurement:
    deflection = np.linspace(end / 10, end, 10)
    kind = material(name)
    force = api.solve(api.request(kind, np.array([parameters]), deflection, 0.01, 0.035)).force[0]
    noise = 0.005 * np.max(force) * np.random.default_rng(401).standard_normal(10)
    return Measurement(deflection, force + noise, Annulus(0.01, 0.035), Specimen("film", 5e-5))


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    out, told = tmp_path_factory.mktemp("chains"), []
    claims = [hypothesis(n) for n in ("neo_hookean", "gent")]
    whole = film()
    judging = Judging(402, 300, False, out, 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mixture, "COUNTS", FEW)
        found = compare(whole.up_to(0.049), claims, judging, whole=whole, progress=lambda *words: told.append(words))
    return found, out, told, claims, whole


def test_the_right_material_wins_and_every_field_is_there(compared):
    found, _, told, _, _ = compared
    assert found.agreed, no_ranking(found)
    rows = {r.label: r for r in found.rows}
    assert list(rows) == ["neo_hookean", "gent"]
    assert [r.label for r in found.ranking] == ["gent", "neo_hookean"]
    assert sum(r.posterior_probability for r in found.rows) == pytest.approx(1.0)
    assert rows["gent"].posterior_probability > 0.9
    assert rows["gent"].prior_mass.value > 0.5
    assert rows["gent"].rest.rmse_N < rows["neo_hookean"].rest.rmse_N
    assert preferred(found).startswith("The evidence prefers Gent to neo-Hookean by ")
    assert {label for label, _ in told} == set(rows)
    assert any("nested sampling" in text for _, text in told)
    answer = document(found)
    json.dumps(answer, allow_nan=False)
    row = answer["table"][1]
    assert set(row["log_evidence"]) == set(row["log_evidence_sd"]) == {NESTED, BRIDGE}
    for name in ("elpd_loo", "loo_se", "prior_mass", "posterior_probability"):
        assert isinstance(row[name], float)
    assert len(row["prior_widths"]) == 3 * len(rows["gent"].hypothesis.parameters)


def test_what_is_stored_is_used_again(compared, monkeypatch):
    found, out, _, claims, whole = compared

    def never(*_args, **_options):
        raise AssertionError("computed again")

    for name in ("nested", "bridge", "leave_one_out", "prior_widths", "leave_range_out"):
        monkeypatch.setattr(comparison_jobs, name, never)
    again = compare(whole.up_to(0.049), claims, Judging(402, 300, False, out, 1), whole=whole)
    assert again.summary() == found.summary()
    shorten(monkeypatch.setattr)
    with pytest.raises(AssertionError, match="computed again"):
        compare(whole.up_to(0.049), claims, Judging(403, 300, False, None, 1))


def test_a_damaged_part_is_made_again(tmp_path):
    calls = []

    def make():
        calls.append(1)
        return Widened("x", 2.0, np.nan, np.inf, 3.0, np.nan, Unknown.FEW)

    first = kept(tmp_path, "piece", "a", make)
    stored_equals_given(first, kept(tmp_path, "piece", "a", make))
    assert len(calls) == 1
    (tmp_path / "comparison" / "piece.json").write_text("{")
    stored_equals_given(first, kept(tmp_path, "piece", "a", make))
    assert len(calls) == 2
    kept(tmp_path, "piece", "b", make)
    assert len(calls) == 3


def test_a_comparison_is_stored_as_it_is(compared, tmp_path):
    found = compared[0]
    store(tmp_path, "comparison", {"whole": found}, {})
    stored_equals_given({"whole": found}, read(tmp_path, "comparison"))


def test_a_hypothesis_that_cannot_be_fitted_does_not_spoil_the_others(monkeypatch):
    """One whose prior has no mass, one with more parameters than points: each has a row that says why."""
    mass = comparison_jobs._mass

    def none_for_gent(posterior, seed):
        return Mass(0.0, 5e-4) if posterior.hypothesis.material.name == "gent" else mass(posterior, seed)

    monkeypatch.setattr(comparison_jobs, "_mass", none_for_gent)
    monkeypatch.setattr(mixture, "COUNTS", FEW)
    m = film("neo_hookean", (7.0,), 0.03).select(np.arange(4))
    claims = [hypothesis(n) for n in ("neo_hookean", "gent", "ogden")]
    found = compare(m, claims, Judging(405, 200, False, None, 1))
    rows = {r.label: r for r in found.rows}
    assert rows["neo_hookean"].fitted
    assert rows["neo_hookean"].posterior_probability == 1.0
    assert "leaves none of the prior draws" in rows["gent"].failure
    assert rows["gent"].prior_mass.value == 0.0
    assert "4 points cannot fix" in rows["ogden"].failure
    assert all(rows[n].posterior_probability is None and not rows[n].fitted for n in ("gent", "ogden"))
    assert found.agreed
    assert preferred(found) == "There are not two hypotheses to choose between."
    json.dumps(document(found), allow_nan=False)


@pytest.mark.study
def test_two_processes_say_what_one_says(compared):
    found, out, _, claims, whole = compared
    again = compare(whole.up_to(0.049), claims, Judging(402, 300, False, out, 2), whole=whole)
    assert again.summary() == found.summary()


def test_names_must_differ():
    with pytest.raises(SettingsError, match="twice"):
        compare(film(), [hypothesis("gent"), hypothesis("gent")])
    with pytest.raises(SettingsError, match="no hypothesis"):
        compare(film(), [])


# ---- ranking ---------------------------------------------------------------------------------------------------------


def row(label: str, z: float, elpd: float, sd: float = 0.1, off: float = 0.0) -> Row:
    rng = np.random.default_rng(len(label))
    points = elpd / 10 + 0.05 * rng.standard_normal(10)
    points += elpd / 10 - points.mean()
    loo = LeaveOneOut(elpd, 1.0, 0.01, points, np.zeros(10), ())
    pair = {NESTED: EvidenceEstimate(z + off, sd, 1, 1.0), BRIDGE: EvidenceEstimate(z, 0.01, 1, 1.0)}
    return Row(label, hypothesis("gent"), together(pair), loo)


def test_no_ranking_without_agreement():
    found = ranked([row("one", -10, 5), row("other", -12, 3, off=2.0)])
    assert not found.agreed
    assert found.ranking == ()
    assert found.rows[1].evidence.disagreement is Disagreement.APART
    assert found.doubtful == (found.rows[1],)
    assert all(r.posterior_probability is None for r in found.rows)


def test_the_error_of_a_probability_is_that_of_drawn_evidences():
    z, sd = np.array([0.0, -0.7, -2.0]), np.array([0.03, 0.05, 0.1])
    p, error = probabilities(z, sd)
    drawn = z + sd * np.random.default_rng(406).standard_normal((40_000, 3))
    drawn = np.exp(drawn) / np.sum(np.exp(drawn), axis=1, keepdims=True)
    assert p == pytest.approx(drawn.mean(axis=0), abs=0.005)
    assert error == pytest.approx(drawn.std(axis=0), rel=0.05)


def test_one_far_behind_does_not_block_the_ranking_of_the_others():
    found = ranked([row("one", -10, 5), row("other", -12, 3), row("far", -50, 1, off=5.0)])
    assert found.agreed
    assert [r.label for r in found.ranking] == ["one", "other"]
    assert not found.rows[2].evidence.agreed
    assert found.rows[2].posterior_probability < 1e-12
    assert sum(r.posterior_probability for r in found.rows) == pytest.approx(1.0)
    assert not found.summary()["table"][2]["agreed"]
    # It does where the upper of its two estimates is within reach, or no other is known.
    assert not ranked([row("one", -10, 5), row("far", -50, 1, off=35.0)]).agreed
    assert not ranked([row("far", -50, 1, off=5.0)]).agreed
    lost = together({NESTED: EvidenceEstimate(np.nan, 0.1, 1, 1.0), BRIDGE: EvidenceEstimate(-50.0, 0.1, 1, 1.0)})
    assert not ranked([row("one", -10, 5), replace(row("far", -50, 1), evidence=lost)]).agreed


def test_a_mode_that_the_draws_have_missed_is_a_disagreement():
    pair = {
        NESTED: EvidenceEstimate(-10.0, 0.1, 1, 1.0, (), Coverage(1024, 30, 2, 0.0045)),
        BRIDGE: EvidenceEstimate(-10.0, 0.01, 1, 1.0, (), Coverage(1024, 20, 1, 0.0045), 2.3),
    }
    found = together(pair)
    assert found.disagreement is Disagreement.MISSED
    assert (found.coverage.points, found.coverage.ascents, found.coverage.modes) == (2048, 50, 2)
    assert found.coverage.volume == pytest.approx(4.6 / 2048, rel=0.01)
    # What may be much larger than it seems blocks a ranking.
    behind = replace(row("behind", -22, 1), evidence=found)
    assert not ranked([row("one", -5, 5), behind]).agreed


def test_probabilities_follow_the_evidence():
    rows = ranked([row("one", -10, 5), row("other", -11, 3)]).rows
    p = rows[0].posterior_probability
    assert p == pytest.approx(1 / (1 + np.exp(-1)), abs=0.01)
    # Two of them: sd(p) = p (1 - p) sd(ln Z1 - ln Z2).
    sd = np.hypot(rows[0].evidence.best[1], rows[1].evidence.best[1])
    assert rows[0].posterior_probability_sd == pytest.approx(p * (1 - p) * sd, rel=1e-9)
    assert rows[1].posterior_probability_sd == pytest.approx(rows[0].posterior_probability_sd)
    unknown = replace(row("third", -9, 1), evidence=None, failure="it cannot be fitted")
    with_unknown = ranked([*rows, unknown])
    assert with_unknown.agreed
    assert with_unknown.rows[2].posterior_probability is None
    assert with_unknown.rows[0].posterior_probability == pytest.approx(rows[0].posterior_probability)


def test_another_look_is_taken_where_chance_may_have_parted_the_estimators(compared, monkeypatch, tmp_path):
    """Nested sampling that is off by three of its errors is repeated, and both are averaged."""
    _, out, _, claims, whole = compared
    shutil.copytree(out, tmp_path / "chains")
    for name in ("nested", "bridge"):
        for stored in (tmp_path / "chains").glob(f"*/comparison/{name}.json"):
            stored.unlink()
    looks = [EvidenceEstimate(-10.3, 0.1, 5, 1.0, (-10.3,)), EvidenceEstimate(-10.0, 0.1, 7, 1.0, (-10.0,))]
    monkeypatch.setattr(comparison_jobs, "_nested", lambda *_: looks.pop(0))
    monkeypatch.setattr(comparison_jobs, "_bridged", lambda *_: EvidenceEstimate(-10.0, 0.01, 1, 1.0))
    monkeypatch.setattr(comparison_jobs, "_mass", lambda *_: Mass(1.0, 0.0))
    part = whole.up_to(0.049)
    (row_,) = compare(part, claims[1:], Judging(402, 300, False, tmp_path / "chains", 1)).rows
    assert row_.evidence.log_evidence[NESTED] == pytest.approx(-10.15)
    assert row_.evidence.log_evidence_sd[NESTED] == pytest.approx(0.15, abs=0.001)
    assert row_.evidence.evaluations[NESTED] == 12
    assert row_.evidence.agreed
    assert looks == []


def test_hypotheses_are_named_with_their_effects():
    plain, both = claimed("yeoh, gent+prestretch", "", "white", "reached")
    assert plain.label() == "yeoh"
    assert both.label() == "gent+prestretch"
    assert [h.label() for h in claimed("yeoh,gent+prestretch", "prestretch", "white", "reached")] == [
        "yeoh+prestretch",
        "gent+prestretch",
    ]


def test_ranges_are_parts_of_the_whole():
    whole = film()
    found = ranges_of(whole, [0.03, 0.06])
    assert list(found) == ["up to 30 mm", "up to 60 mm"]
    assert found["up to 30 mm"].whole is whole
    assert found["up to 60 mm"].whole is None
    assert len(found["up to 30 mm"].measurement) == 5


def test_of_a_long_file_energies_are_weighed_by_some_readings_in_every_range() -> None:
    d = np.linspace(1e-5, 0.06, 4001)
    whole = Measurement(d, 5 * d, Uniaxial(0.05, 0.01), Specimen("strip", 5e-4))
    (one,) = ranges_of(whole, []).values()
    assert len(one.measurement) <= MOST
    assert "of 4001 readings are used" in one.measurement.provenance.notes[-1]
    (half,) = ranges_of(whole, [0.03]).values()
    assert half.whole is not None
    assert len(half.whole) <= MOST


def test_auto_judges_each_hypothesis_under_every_noise() -> None:
    found = claimed("yeoh,gent", "friction", "auto", "reached")
    assert [(h.label(), h.noise.name) for h in found] == [
        (f"{m}+friction", n) for m in ("yeoh", "gent") for n in ("white", "ar1", "form")
    ]


def test_ranges_of_one_name_are_refused() -> None:
    """Readings are closer together than ends are told."""
    d = 1e-3 * np.array([2.0, 5.0, 10.0001, 10.0003, 12.0])
    whole = Measurement(d, 100 * d, Annulus(0.01, 0.035), Specimen("film", 5e-5))
    with pytest.raises(SettingsError, match="both be called"):
        ranges_of(whole, [10.0002e-3, 10.0004e-3])
