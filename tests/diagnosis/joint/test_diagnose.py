from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.joint.claim import joint
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.joint.diagnose import diagnose_jointly
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.joint_diagnosis import document, sentence
from tests.diagnosis.joint.tests_of_one_film import two_tests


def test_two_sound_tests_of_one_film_lack_nothing(tmp_path) -> None:
    one, two = two_tests(tmp_path, "null", "mooney_rivlin", 1.0, 61011)
    found = diagnose_jointly(joint({"one": one, "two": two}, hypothesis("gent")), declared=False, quick=True)
    assert (found.verdict, found.effects) == ("adequate", ())
    assert "to within their noise" in sentence(found)


@pytest.mark.study
def test_a_thickness_that_each_test_alone_absorbs_is_seen_in_two(tmp_path) -> None:
    """Of which film, or which load cell, no force can tell."""
    one, two = two_tests(tmp_path, "null", "gent", 1.0, 61012, factor=1.04)
    alone = diagnose(two, Question(hypothesis("gent"), False))
    assert alone.verdict == "adequate"
    found = diagnose_jointly(joint({"one": one, "two": two}, hypothesis("gent")), declared=False, quick=True)
    assert found.verdict == "ambiguous"
    scaling = {f"{effect}@{test}" for effect in ("thickness", "force_gain") for test in ("one", "two")}
    assert scaling <= set(found.effects)
    assert sum(p for name, p in found.probabilities.effects.items() if set(name.split("+")) <= scaling) > 0.8
    assert found.before.reduced_chi2 > 5
    assert found.after.reduced_chi2 < 1.2
    errors = [m.parameters.get("thickness@two.error") for m in found.members]
    assert next(e for e in errors if e is not None) == pytest.approx(0.04, abs=0.01)


def test_a_fault_of_one_test_is_found_in_that_test(tmp_path) -> None:
    one, two = two_tests(tmp_path, "zero_offset", "neo_hookean", 12.0, 61013)
    found = diagnose_jointly(joint({"faulty": one, "sound": two}, hypothesis("gent")), declared=False, quick=True)
    answer = document(found)
    assert found.probabilities.effects["zero_offset@faulty"] > 0.9
    assert answer["tests"]["faulty"]["error"]["after"]["reduced_chi2"] < 1.3
    assert "shift" in answer["sentence"]
    assert "in faulty" in answer["sentence"]
    assert set(answer) >= {
        "probabilities",
        "remaining",
        "verdict",
        "effects",
        "material",
        "p_value",
        "ranking",
        "error",
    }
    assert sum(answer["probabilities"]["effects"].values()) == pytest.approx(1.0)
    assert answer["read_as"] == {label: test["read_as"] for label, test in answer["tests"].items()}
    if found.probabilities.nearly_certain():  # known, even where the whole is not
        left = sentence(replace(found, verdict="unknown", members=()))
        assert "beside offset of the deflection zero" in left
        assert "in all that is probable" in left
        assert " after" not in left


@pytest.mark.study
def test_a_step_of_the_load_cell_in_one_test_bends_the_film_of_no_other(tmp_path) -> None:
    """Weighed in its own test alone it had left the other one with a film of nobody's, and a drift had been sure."""
    one, two = two_tests(tmp_path, "null", "neo_hookean", 1.0, 61022)
    faulty = replace(one, force=one.force - 0.23 * (np.arange(len(one)) > 54))
    found = diagnose_jointly(joint({"faulty": faulty, "sound": two}, hypothesis("gent")), declared=False, quick=True)
    assert found.verdict == "unknown"
    assert found.probabilities.effects["none"] > 0.9
    assert found.probabilities.foreign["sudden_change@faulty"] > 0.9
    assert found.foreign.label == "faulty"
    assert " In faulty: A sudden drop" in sentence(found)


def test_a_tear_is_held_against_a_fall_in_its_own_test(tmp_path) -> None:
    """Of a tear of 3 % a fall of the force leaves nearly as little: neither is a dozen times as probable."""
    one, two = two_tests(tmp_path, "null", "neo_hookean", 1.0, 61023)
    torn = replace(one, force=one.force * (1 - 0.03 * (np.arange(len(one)) > 54)))
    found = diagnose_jointly(joint({"torn": torn, "sound": two}, hypothesis("gent")), declared=False, quick=True)
    p = found.probabilities
    tears = sum(q for name, q in p.effects.items() if "tearing@torn" in name)
    falls = p.foreign["sudden_change@torn"]
    assert tears + falls > 0.9
    assert max(tears, falls) < 13 * min(tears, falls)
    assert p.foreign.get("sudden_change@sound", 0.0) < 1e-3


@pytest.mark.study
def test_the_order_of_tests_does_not_matter(tmp_path) -> None:
    one, two = two_tests(tmp_path, "null", "neo_hookean", 1.0, 61014, factor=1.03)
    claim = hypothesis("neo_hookean")
    found = [
        diagnose_jointly(joint(tests, claim), quick=True)
        for tests in ({"one": one, "two": two}, {"two": two, "one": one})
    ]
    a, b = (f.probabilities.effects for f in found)
    assert {n for n, p in a.items() if p > 0.05} == {n for n, p in b.items() if p > 0.05}
    assert np.isclose(a["thickness@one"], b["thickness@one"], atol=0.05)
