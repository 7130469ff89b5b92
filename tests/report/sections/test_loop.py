"""What a report says of a closed loop, whatever its answer."""

import html
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.diagnosis.other_tests import predicted
from bayesmembrane.ground.stored import store
from bayesmembrane.next_test.further import FurtherTest, Kind
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.blocks import Figure, Points, Table, Text
from bayesmembrane.report.page import PAGE, TWIN, write_report
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.calibrations import refuted
from bayesmembrane.report.sections.diagnosis import film_and_model, limits, place_of
from bayesmembrane.report.sections.diagnosis.figures import Place, Residual, discrepancy_picture, residual_picture
from bayesmembrane.report.sections.diagnosis.tables import confounded_table, power_table, ranking_table
from bayesmembrane.report.sections.loop import LoopSection, loops_of, residual_rows
from bayesmembrane.report.sections.loop.others import others
from bayesmembrane.report.sections.loop.tables import errors_table, moved_table, scores_table
from bayesmembrane.report.sections.loop.way import waypoints
from bayesmembrane.words import diagnosis as diagnosis_words
from bayesmembrane.words import loop as loop_words
from bayesmembrane.words.brief import of_diagnosis, of_loop
from bayesmembrane.words.candidates import candidate_title
from bayesmembrane.words.diagnosis import document, finding_sentence, set_aside
from bayesmembrane.words.moved import Change, changes, modulus_fitted, modulus_sentence
from bayesmembrane.words.next_test import spoken_test
from bayesmembrane.words.rounds import answer, bound_sentences, moved, rival_sentences, subject, validation_sentences
from bayesmembrane.words.seen import DISC, seen
from bayesmembrane.words.units import size_in_words
from tests.generator.datasets import THICKNESS
from tests.report.pages import without_pictures
from tests.report.sections.loops import only

# ---- tables ----------------------------------------------------------------------------------------------------------


def test_errors_fall_from_the_model_as_given_to_the_one_with_its_effect(named: Loop) -> None:
    d, again = only(named, "named"), named.rounds[1].diagnosis
    before, after = errors_table(waypoints(named), "cycle 3", "errors").records()
    assert (before["model"], after["model"]) == ("neo-Hookean", "neo-Hookean with friction in the guide")
    assert before["rmse_mN"] == pytest.approx(1e3 * np.sqrt(np.mean(d.null.residual**2)))
    assert after["rmse_mN"] == pytest.approx(1e3 * np.sqrt(np.mean(again.null.residual**2)))
    assert all(after[k] < before[k] for k in ("rmse_mN", "reduced_chi2", "heldout_rmse_mN", "heldout_reduced_chi2"))


def test_scores_are_those_of_the_sampled_waypoints(named: Loop, ambiguous: Loop) -> None:
    assert [r["log_evidence"] for r in scores_table(waypoints(named), "s").records()] == [500.0, 600.0]
    assert len(scores_table(waypoints(ambiguous), "s").rows) == 1


def test_sampled_rivals_stand_side_by_side_and_are_not_added(sampled: Loop) -> None:
    rows = scores_table(waypoints(sampled), "s").records()
    assert [r["log_evidence"] for r in rows] == [500.0, 600.0, 550.0]
    assert ["not added" in r["model"] for r in rows] == [False, True, True]
    errors = errors_table(waypoints(sampled), "cycle 3", "errors").records()
    assert [r["heldout_coverage_90"] is None for r in errors] == [False, False, True]
    (sentence,) = rival_sentences(sampled)
    assert sentence.count("MPa") == 3
    assert loop_words.round_document(sampled.rounds[0])["leaders"][1]["log_evidence"] == 550.0


def test_rivals_that_were_only_fitted_have_a_modulus_without_a_spread(ambiguous: Loop) -> None:
    (sentence,) = rival_sentences(ambiguous)
    d, before = ambiguous.rounds[0].diagnosis, ambiguous.rounds[0].before.run
    assert sentence.count("MPa") == 1 + len(d.members)
    assert sentence.count("+-") == 1
    c1 = before.data.posterior["neo_hookean.c1"].values
    assert f"{2e-6 * c1.mean() / THICKNESS:.4g} +- " in sentence
    # The friction that is in the curve stiffens the film of a model without it.
    assert modulus_fitted(d.null, d.measurement) == pytest.approx(2e-6 * c1.mean() / THICKNESS, rel=0.05)


def test_candidates_are_ranked_against_the_model_as_it_was(named: Loop) -> None:
    d = only(named, "named")
    rows = ranking_table(d, "ranking").records()
    null = next(r for r in rows if r["candidate"].startswith("nothing"))
    shares = [r["probability"] for r in rows if r is not null]
    assert null["log_bayes_factor"] == pytest.approx(0, abs=1e-9)
    assert shares == sorted(shares, reverse=True)
    assert [r["candidate"] for r in rows if r["in_answer"]] == ["friction in the guide"]
    size = 1e3 * d.best.parameters["friction.level"]
    assert rows[0]["size"] == f"level {size:.3g} mN"


def test_an_effect_with_another_energy_keeps_its_name(named: Loop) -> None:
    d = named.rounds[0].diagnosis
    best = d.ranking[0].candidate
    other = replace(best, hypothesis=replace(best.hypothesis, material=hypothesis("gent").material))
    effect = best.hypothesis.effects[0].title
    assert candidate_title(other, d.null) == f"{effect} and the energy Gent"


def test_what_is_firm_of_an_ambiguous_answer_is_added_and_told(going_on: Loop) -> None:
    first, second = waypoints(going_on)
    assert first.title == "neo-Hookean"
    assert (second.title, second.added) == ("neo-Hookean with friction in the guide", True)
    told, then = answer(going_on)
    which = "which is in all that is probable and explains more than what is left."
    assert told.endswith(f" Added is friction in the guide, {which}")
    assert then.startswith("With that: ")
    assert document(going_on.rounds[0].diagnosis)["firm"] == ["friction"]
    brief = of_loop(going_on)
    assert brief.probable[0].startswith("98 % friction in the guide (level ")
    assert brief.probable[1].startswith("then ")
    assert brief.verdict == "neo-Hookean with friction in the guide describes the curve"
    assert brief.following.startswith("Use neo-Hookean with friction in the guide")


def test_what_explains_no_more_than_what_is_left_is_told_apart_from_what_is_firm(going_on: Loop) -> None:
    d = going_on.rounds[0].diagnosis
    p = replace(d.probabilities, effects={"friction+mullins": 0.99, "friction": 0.01}, foreign={"none": 1.0})
    some = replace(d, verdict="unknown", effects=(), probabilities=p)
    apart = "which explains hardly more than what is left and may stand in for something else"
    start = "friction in the guide is at work in all that is probable, and so is Mullins softening"
    assert f"{start}, {apart}, yet " in finding_sentence(some)
    assert of_diagnosis(some).verdict.startswith("friction in the guide is nearly certain, yet ")
    for plain in (replace(some, firm=()), replace(some, firm=("friction", "mullins"))):
        assert "friction in the guide and Mullins softening are at work in all" in finding_sentence(plain)
        assert "certain" not in of_diagnosis(plain).verdict


@pytest.mark.parametrize(("foreign", "told"), [(0.02, 0), (0.2, 1), (0.7, 1)])
def test_what_is_foreign_takes_no_line_from_sets_that_are_more_probable(
    ambiguous: Loop, foreign: float, told: int
) -> None:
    d = only(ambiguous, "ambiguous")
    sets = {"friction": 0.4, "hysteresis": 0.3, "mullins": 0.15, "friction+mullins": 0.1, "none": 0.05}
    p = replace(d.probabilities, effects=sets, foreign={"none": 1 - foreign, "play": foreign})
    lines = of_diagnosis(replace(d, probabilities=p)).probable
    assert len(lines) == 3
    assert sum("something foreign" in line for line in lines) == told
    assert any(line.startswith("40 %") for line in lines)


def test_sizes_are_told_in_the_units_that_people_read() -> None:
    told = [size_in_words(*v) for v in ((1.66e-4, "m"), (1.0026, "-"), (0.00348, "-"), (8.8e-4, "m/N"), (-2e-5, "N/s"))]
    assert told == ["0.166 mm", "1", "0.00348", "0.88 mm/N", "-0.02 mN/s"]


def test_sizes_that_show_are_listed_the_easiest_first(named: Loop) -> None:
    d = named.rounds[-1].diagnosis
    rows = power_table(d, "power").records()
    ratios = [r["ratio"] for r in rows]
    assert ratios == sorted(ratios)
    assert len(rows) == sum(math.isfinite(v) for v in d.power.values()) > 3


def test_confounded_effects_carry_their_angle(named: Loop) -> None:
    d = replace(only(named, "named"), confounded=(("clamp_slip", "permanent_set", 12.34),))
    assert confounded_table(d, "c").cells() == [["slip in the clamp", "permanent set", "12.3"]]


def test_what_was_not_looked_for_is_told(named: Loop) -> None:
    d = only(named, "named")
    some = replace(d, unsought=("mullins", "hysteresis"))
    texts = [[b.text for b in limits(x, x, ("c", "p")) if isinstance(b, Text)] for x in (d, some)]
    told = "Mullins softening and hysteresis of the material; unload to see them."
    assert [any(told in t for t in each) for each in texts] == [False, True]
    assert document(some)["unsought"] == ["mullins", "hysteresis"]


def test_moved_parameters_are_in_the_posteriors(named: Loop) -> None:
    before, after = named.rounds[0].before.run, named.rounds[0].after.run
    found = {c.name: c for c in changes(before, after)}
    c1 = after.data.posterior["neo_hookean.c1"].values
    assert found["neo_hookean.c1"].after == pytest.approx((c1.mean(), c1.std()))
    assert found["shear modulus"].after[0] == pytest.approx(2e-6 * c1.mean() / THICKNESS)
    assert found["shear modulus"].share == pytest.approx(found["neo_hookean.c1"].share)
    assert math.isnan(found["friction.level"].before[0])
    cells = {c[0]: c for c in moved_table(list(found.values()), "m").cells()}
    assert cells["friction in the guide: level"][2] == "-"
    sentence = moved(named)[0]
    assert f"{found['shear modulus'].after[0]:.4g}" in sentence


# ---- sentences -------------------------------------------------------------------------------------------------------


def test_a_modulus_that_moves_by_many_standard_deviations_was_bent() -> None:
    far = modulus_sentence(Change("shear modulus", "MPa", (0.30, 0.001), (0.33, 0.002), True), "Yeoh")
    near = modulus_sentence(Change("shear modulus", "MPa", (0.30, 0.001), (0.3005, 0.002), True), "Yeoh")
    assert "+10 %, 30.0 of the standard deviations" in far
    assert "bent the material" in far
    assert "could be used" in near


def test_the_answer_tells_every_round(named: Loop) -> None:
    first, second = answer(named)
    assert "misses something (p < 0.0001): friction in the guide" in first
    assert second.startswith("With that: neo-Hookean with friction in the guide describes the curve")


def test_an_energy_that_nobody_declared_is_told_as_the_nearest_one(named: Loop) -> None:
    assert ", neo-Hookean, " in subject(named)
    first = named.rounds[0]
    free = replace(first, diagnosis=replace(first.diagnosis, declared=False))
    assert ", no energy declared, " in subject(Loop((free,), None))
    told = answer(Loop((free, *named.rounds[1:]), None))
    assert told[0].startswith("neo-Hookean, the nearest of all energies, misses something")


def test_what_the_first_screen_tells_is_not_told_again(ambiguous: Loop) -> None:
    """Probabilities, rivals and the next test stand there and in the list of what could explain it."""
    d = ambiguous.rounds[-1].diagnosis
    (told,) = answer(ambiguous)
    assert f"any of {len(d.members)} explanations may be right" in told
    assert "Probability" not in told
    assert "To tell them apart" not in told
    assert "root mean square" in told


def test_what_was_changed_is_said_before_how_it_ended(named: Loop, unknown: Loop) -> None:
    ends = diagnosis_words.sentence(named.rounds[-1].diagnosis)
    assert loop_words.sentence(named) == f"Changed: friction in the guide. {ends}"
    assert loop_words.sentence(unknown) == diagnosis_words.sentence(unknown.rounds[0].diagnosis)
    r = named.rounds[0]
    gent = replace(r.after, run=replace(r.after.run, settings={"hypothesis": hypothesis("gent").settings()}))
    told = loop_words.sentence(Loop((replace(r, after=gent),), None))
    assert told.startswith("Changed: Gent instead of neo-Hookean. ")


def test_a_loop_that_stops_early_says_so(named: Loop) -> None:
    told = answer(Loop(named.rounds[:1], None))
    assert "after 1 round: whether neo-Hookean with friction in the guide is adequate" in told[-1]


def test_the_choice_without_the_held_out_points_is_said(named: Loop) -> None:
    d = only(named, "named")
    assert d.validation is not None
    assert any("choose the same model" in s and set_aside(d.validation) in s for s in validation_sentences(named))
    other = replace(d.validation, chosen="neo_hookean")
    r = replace(named.rounds[0], diagnosis=replace(d, validation=other))
    assert "choose neo-Hookean instead" in validation_sentences(Loop((r,), None))[0]
    none = replace(named.rounds[0], diagnosis=replace(d, validation=None))
    assert "too few" in validation_sentences(Loop((none,), None))[0]


def test_an_estimate_at_a_bound_is_a_limit(named: Loop) -> None:
    assert bound_sentences(named) == []
    d = only(named, "named")
    best = replace(d.members[0].candidate, at_bound=("friction.level",))
    changed = replace(d, members=(replace(d.members[0], candidate=best),))
    told = bound_sentences(Loop((replace(named.rounds[0], diagnosis=changed),), None))
    assert len(told) == 1
    assert "level lies at its bound" in told[0]


# ---- the page --------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("blank_pictures")
def test_the_page_answers_with_the_loop_first(tmp_path: Path, named: Loop, yeoh: Shown) -> None:
    page = write_report([yeoh, named], tmp_path).read_text()
    twin = json.loads((tmp_path / TWIN).read_text())
    assert (tmp_path / PAGE).exists()
    assert twin["answer"] == of_loop(named).lines
    assert all(html.escape(s) in page for s in answer(named))
    assert page.index('id="loop"') < page.index('id="data"')
    assert "synthetic &lt;film&gt;" in page
    assert {"loop errors", "loop scores", "loop parameters", "loop candidates", "loop power"} <= set(twin["tables"])


@pytest.mark.usefixtures("blank_pictures")
def test_two_loops_keep_apart(named: Loop, unknown: Loop) -> None:
    sections = LoopSection().parts([named, unknown])
    names = [b.name for s in sections for b in s.blocks if isinstance(b, Table)]
    assert [s.key for s in sections] == ["loop1", "loop2"]
    assert len(set(names)) == len(names)
    starts = [s.partition(" up to")[0] for s in LoopSection().answer([named, unknown])]
    assert starts == ["synthetic <film>, neo-Hookean, 120 readings"] * 2


def test_loops_on_synthetic_curves_come_last(named: Loop) -> None:
    first = named.rounds[0]
    curve = first.diagnosis.measurement
    made = replace(curve, provenance=replace(curve.provenance, origin="SYNTHETIC: made for a test"))
    shown = replace(first, diagnosis=replace(first.diagnosis, measurement=made))
    synthetic = replace(named, rounds=(shown, *named.rounds[1:]))
    for given in ([synthetic, named], [named, synthetic]):
        assert loops_of(given) == [named, synthetic]


@pytest.mark.usefixtures("blank_pictures")
def test_without_a_name_the_rest_is_drawn_and_nothing_is_added(unknown: Loop) -> None:
    (section,) = LoopSection().parts([unknown])
    assert unknown.left is not None
    captions = [b.caption for b in section.blocks if isinstance(b, Figure)]
    assert len(captions) == 2
    how = seen(unknown.rounds[0].diagnosis.measurement)
    assert loop_words.left_sentence(unknown.left, how) in captions[1]
    assert [r.title.partition(":")[0] for r in residual_rows(waypoints(unknown))] == ["As given"]
    assert not any(r["in_answer"] for r in ranking_table(unknown.rounds[0].diagnosis, "r").records())


@pytest.mark.usefixtures("blank_pictures")
def test_rivals_are_listed_with_what_would_part_them(ambiguous: Loop) -> None:
    (section,) = LoopSection().parts([ambiguous])
    lines = [line for b in section.blocks if isinstance(b, Points) for line in b.lines]
    assert sum(line.endswith(" %.") for line in lines) == 2
    assert f"To tell them apart: {spoken_test(FurtherTest(Kind.BLANK))}: shows one of them directly." in lines
    assert "What would not settle it: unloading after the same loading (0.7 standard deviations)." in lines
    assert any(
        row["model"].endswith("(not added)")
        for b in section.blocks
        if isinstance(b, Table) and "errors" in b.name
        for row in b.records()[1:2]
    )
    assert residual_rows(waypoints(ambiguous))[1].title.startswith("The first rival, not added")


@pytest.mark.usefixtures("blank_pictures")
def test_an_adequate_model_needs_no_candidates(named: Loop) -> None:
    (section,) = LoopSection().parts([Loop(named.rounds[1:], None)])
    names = [b.name for b in section.blocks if isinstance(b, Table)]
    assert names[:2] == ["loop errors", "loop scores"]
    assert "loop candidates" not in names
    assert "loop power" in names


# ---- pictures --------------------------------------------------------------------------------------------------------


def height(png: bytes) -> int:
    assert png.startswith(b"\x89PNG")
    return int.from_bytes(png[20:24], "big")


def test_held_out_points_are_the_last_cycle(named: Loop) -> None:
    place = place_of(named.rounds[0].diagnosis, named.rounds[-1].diagnosis.noise.each)
    assert np.array_equal(place.held_out, place.cycle == place.cycle.max())
    assert place.sd == pytest.approx(np.full(place.sd.size, named.rounds[-1].diagnosis.noise.sd))


def test_every_model_has_its_row(named: Loop) -> None:
    place, rows = place_of(named.rounds[0].diagnosis), residual_rows(waypoints(named))
    both, one = (residual_picture(place, r).data for r in (rows, rows[:1]))
    assert height(both) > 1.5 * height(one)
    assert residual_picture(place, rows).data == both


def test_a_single_loading_without_times_is_drawn() -> None:
    n = 7
    ones = np.ones(n)
    place = Place(
        np.linspace(0.001, 0.02, n), None, ones.astype(np.int8), ones.astype(int), ones > 1, 0.004 * ones, DISC
    )
    big, small = Residual("Before", 0.5 * np.sin(np.arange(n))), Residual("After", 0.004 * np.cos(np.arange(n)))
    assert place.along[1] == "number of the point (-)"
    assert height(residual_picture(place, [big, small]).data) > 0
    assert height(discrepancy_picture(place, big.residual, 0.4 * ones, 0.1 * ones).data) > 0


# ---- without any run -------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("blank_pictures")
def test_a_loop_and_a_diagnosis_stand_alone(tmp_path: Path, named: Loop) -> None:
    page = write_report([named], tmp_path / "loop").read_text()
    assert "What the force curve of synthetic &lt;film&gt; says" in page
    assert 'id="data"' not in page
    d = only(named, "named")
    alone = json.loads((write_report([d], tmp_path / "one").parent / TWIN).read_text())
    assert alone["answer"] == of_diagnosis(d).lines
    page = write_report([d, named.rounds[-1].diagnosis], tmp_path / "diagnosis").read_text()
    twin = json.loads((tmp_path / "diagnosis" / TWIN).read_text())
    assert 'id="diagnosis1"' in page
    both = d, named.rounds[-1].diagnosis
    # Of several, each says of which film it is.
    assert twin["answer"] == [f"{film_and_model(x)}: {diagnosis_words.sentence(x)}" for x in both]
    assert all(x.measurement.specimen.name in film_and_model(x) for x in both)
    before, after = twin["tables"]["diagnosis errors 1"]
    assert (before["model"], after["model"]) == ("neo-Hookean", "neo-Hookean with friction in the guide")
    assert after["heldout_rmse_mN"] < before["heldout_rmse_mN"]
    assert twin["tables"]["glance"][0]["found"] == "named: neo-Hookean with friction in the guide"


@pytest.mark.usefixtures("blank_pictures")
def test_a_stored_diagnosis_gives_the_same_page(tmp_path: Path, named: Loop) -> None:
    d = only(named, "named")
    store(tmp_path / "answer", "diagnosis", d, {})
    stored, held = (write_report([found], tmp_path / "page").read_text() for found in (tmp_path / "answer", d))
    assert without_pictures(stored) == without_pictures(held)


# ---- tests that no fit saw -------------------------------------------------------------------------------------------


def test_other_tests_stand_with_their_errors_and_their_band(named: Loop) -> None:
    other = predicted(only(named, "named"), named.rounds[0].before.run.measurement)
    blocks = others([other, other, other], "")
    (table,) = [b for b in blocks if isinstance(b, Table)]
    record = table.records()[0]
    assert record["after"] == pytest.approx(1e3 * other.rmse_after)
    assert record["before"] == pytest.approx(1e3 * other.rmse_before)
    assert record["inside_90"] == other.covered
    assert other.rmse_after < 0.5 * other.rmse_before, "friction was named, and is in the prediction"
    assert len([b for b in blocks if isinstance(b, Figure)]) == 1
    assert others([], "") == []
    pulled = replace(other, measurement=replace(other.measurement, rig=Uniaxial()))
    blocks = others([other, pulled], "")
    film, strip = (b for b in blocks if isinstance(b, Table))
    factor = pulled.measurement.rig.shown(pulled.measurement.specimen.thickness)["N"][0]
    assert film.records()[0]["after"] == pytest.approx(1e3 * other.rmse_after)
    assert strip.records()[0]["after"] == pytest.approx(factor * other.rmse_after)
    (figure,) = (b for b in blocks if isinstance(b, Figure))
    assert figure.caption.startswith("Force (N) over deflection (mm) and stress (MPa) over stretch (-)")
    told = loop_words.document(replace(named, others=(other,)))["predicted"]
    assert [t["inside_90"] for t in told] == [other.covered]
    assert "no fit saw" in told[0]["sentence"]


@pytest.mark.parametrize(("judged", "told"), [("unknown", 1), ("misses", 0)])
def test_a_run_that_no_noise_judges_is_judged_by_its_loop(named: Loop, judged: str, told: int) -> None:
    """Its modulus must not stand alone beside an answer that refutes it."""
    run = named.rounds[0].before.run
    shown = SimpleNamespace(
        name="neo-Hookean",
        case=SimpleNamespace(verdict=judged),
        data_hash=run.measurement.data_hash,
        hypothesis=run.hypothesis,
    )
    other = SimpleNamespace(**{**vars(shown), "hypothesis": hypothesis("gent")})
    found = refuted(cast(Any, [shown, other]), [named])
    assert len(found) == told
    assert not refuted(cast(Any, [shown]), [Loop(named.rounds[1:], None)])
