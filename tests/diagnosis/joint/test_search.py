from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.foreign import SUDDEN, UNNAMED
from bayesmembrane.diagnosis.explanation.foreign_search import foreign, the_only
from bayesmembrane.diagnosis.joint.case import one_test
from bayesmembrane.diagnosis.joint.effects import effects_in_tests
from bayesmembrane.diagnosis.joint.search import JointSearch, joint_noise
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from tests.diagnosis.joint.tests_of_one_film import two_tests


@pytest.fixture(scope="module")
def searches(tmp_path_factory) -> list[Search]:
    both = two_tests(tmp_path_factory.mktemp("film"), "mullins", "gent", 30.0, 61001)
    return [Search(m, own_noise(m, smooth_reference(m))) for m in both]


def jointly(parts: list[Search], thicker: tuple[float, ...], names: tuple[str, ...]) -> tuple[JointSearch, Hypothesis]:
    effects = [{n: components("effects")[n]() for n in names} for _ in parts]
    plain = hypothesis("gent")
    claim = Hypothesis(plain.material, tuple(effects_in_tests(effects, ("one", "two")[: len(parts)])), plain.noise)
    return JointSearch(tuple(parts), thicker, joint_noise([p.noise for p in parts])), claim


def test_one_test_together_equals_that_test(searches) -> None:
    names = ("mullins", "zero_offset")
    search, claim = jointly(searches[:1], (1.0,), names)
    alone = hypothesis("gent", names)
    x = searches[0].material_starts(alone)[0]
    one, other = searches[0].at(alone, x), search.at(claim, x)
    assert one is not None
    assert other is not None
    assert other.log_evidence == pytest.approx(one.log_evidence, abs=1e-8)
    assert other.residual == pytest.approx(one.residual, abs=1e-12)
    assert other.traces == pytest.approx(one.traces, abs=1e-12)


def test_what_is_foreign_in_one_test_together_equals_that_in_it_alone(searches) -> None:
    search, claim = jointly(searches[:1], (1.0,), ())
    alone = hypothesis("gent")
    x = searches[0].material_starts(alone)[0]
    one, other = searches[0].at(alone, x), search.at(claim, x)
    assert one is not None
    assert other is not None
    apart, together = foreign(the_only(searches[0]), one), foreign(one_test(search, 0), other)
    assert [f.kind for f in together] == [f.kind for f in apart]
    for a, b in zip(apart, together, strict=True):
        assert (b.gain, b.chance, b.size) == pytest.approx((a.gain, a.chance, a.size), rel=1e-6, abs=1e-6)
        assert b.share == pytest.approx(a.share, rel=1e-6)


def test_what_is_foreign_in_one_test_frees_the_film_of_the_other(searches) -> None:
    """Both share an energy: more is gained in both than in the one with the step, whose film may bend as it likes."""
    step = replace(searches[1].measurement, force=searches[1].force - 0.1 * (np.arange(searches[1].force.size) > 60))
    parts = [searches[1], replace(searches[1], measurement=step)]
    search, claim = jointly(parts, (1.0, 1.0), ())
    base = search.fit(claim, search.material_starts(claim))
    assert base is not None
    found = next(f for f in foreign(one_test(search, 1), base) if f.kind == SUDDEN)
    assert not np.any(found.trace[search.rows[0]])
    assert search.squares(base, found.trace) < 1.5 * search.force.size < 0.2 * search.squares(base)
    alone = search.restricted(base, 1)
    assert alone is not None
    assert found.gain > max(f.gain for f in foreign(the_only(parts[1]), alone) if f.kind == SUDDEN) + 100
    assert 1 - found.share == pytest.approx(search.squares(base, found.trace) / search.squares(base), abs=1e-6)
    unnamed = next(f for f in foreign(one_test(search, 0), base) if f.kind == UNNAMED)
    assert not np.any(unnamed.trace[search.rows[1]])


def test_another_noise_of_one_test_is_no_other_one(searches) -> None:
    search, claim = jointly(searches, (1.0, 1.0), ("mullins",))
    x = search.material_starts(claim)[0]
    louder = replace(searches[1].noise, sd=2 * searches[1].noise.sd)
    other, own = search.with_noise(1, louder)
    assert own is other.parts[1]
    assert own.noise is louder
    assert other.parts[0] is search.parts[0]
    white, before = (s.noise.white(np.ones(s.force.size)) for s in (other, search))
    assert np.array_equal(white[search.rows[0]], before[search.rows[0]])
    assert white[search.rows[1]] == pytest.approx(before[search.rows[1]] / 2)
    assert np.array_equal(*(s.batch(claim, x[None, :])[0] for s in (other, search)))


def test_tests_of_their_own_effects_are_independent_but_for_the_energy(searches) -> None:
    """With nothing to learn of the energy, ln Z of both is the sum of each: here of noise and form error alone."""
    search, claim = jointly(searches, (1.0, 1.0), ("mullins", "zero_offset"))
    assert [e.name for e in claim.effects] == ["mullins", "zero_offset@one", "zero_offset@two"]
    x = search.material_starts(claim)[0]
    r, slopes = search.batch(claim, x[None, :])
    for i, (part, rows) in enumerate(zip(searches, search.rows, strict=True)):
        own = part.batch(search.of(claim, i), search.coordinates(claim, i, x)[None, :])
        assert np.array_equal(r[:, rows], own[0])
        places = search.places(claim, i)
        assert np.array_equal(slopes[:, rows][:, :, places], own[1])
        others = np.setdiff1d(np.arange(x.size), places)
        assert not np.any(slopes[:, rows][:, :, others])


def test_a_film_twice_as_thick_has_twice_the_membrane_modulus(searches) -> None:
    search, claim = jointly(searches, (1.0, 2.0), ())
    x = search.material_starts(claim)[0]
    thin, thick = (search.coordinates(claim, i, x) for i in (0, 1))
    assert claim.films(thick)[0, 0] == pytest.approx(2 * claim.films(thin)[0, 0])
    assert thick[1:] == pytest.approx(thin[1:])


def test_joint_noise_is_that_of_every_test(searches) -> None:
    noise = joint_noise([s.noise for s in searches])
    values = np.random.default_rng(0).standard_normal(sum(len(s.measurement) for s in searches))
    white = noise.white(values)
    for s, rows in zip(searches, noise.rows, strict=True):
        assert white[rows] == pytest.approx(s.noise.white(values[rows]))
    assert noise.log_root == pytest.approx(sum(s.noise.log_root for s in searches))


def test_an_effect_of_the_material_grows_in_all_tests_at_once(searches) -> None:
    search, claim = jointly(searches, (1.0, 1.0), ("mullins",))
    (unit,) = claim.effects
    assert unit.sizes == (0, len(components("effects")["mullins"].coordinates))
    assert search.expected_sizes(unit) == pytest.approx([unit.coordinates[i].scale for i in unit.sizes])


def test_constants_of_the_material_are_the_same_in_all_tests(searches) -> None:
    """Of a relaxation every test knows the same time: what one learns of it holds in the others."""
    search, claim = jointly(searches, (1.0, 1.0), ("viscoelastic",))
    (unit,) = claim.effects
    alone = components("effects")["viscoelastic"]
    assert [p.name for p in unit.coordinates] == [p.name for p in alone.coordinates]
    assert unit.sizes == (0,)
    assert search.expected_sizes(unit).shape == (1,)
    x = search.material_starts(claim)[0] + 0.1
    r, slopes = search.batch(claim, x[None, :])
    for i, (part, rows) in enumerate(zip(searches, search.rows, strict=True)):
        own = part.batch(search.of(claim, i), x[None, :])
        assert np.array_equal(r[:, rows], own[0])
        assert np.array_equal(slopes[:, rows], own[1])


def test_tests_that_go_by_different_clocks_share_no_constant() -> None:
    """Without times a second is a millimetre of travel."""
    effects = [{"viscoelastic": components("effects")["viscoelastic"]()} for _ in range(2)]
    (unit,) = effects_in_tests(effects, ("one", "two"), one_clock=False)
    assert unit.coordinates[0].name == "0.strength"
    assert len(unit.sizes) == 2
