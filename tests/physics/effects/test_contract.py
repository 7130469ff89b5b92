"""What every effect must keep, whoever wrote it."""

import pickle

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.explanation.foreign import KINDS
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.composition import EFFECT_STEP, MOUNTING_STEP
from bayesmembrane.physics.effects.base import STAGES, Effect, Geometry, stage_number
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.biaxial import Biaxial
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.physics.effects.protocols import RIG, force, measured, path, staircase, two_speeds, vector

EFFECTS = {name: cls() for name, cls in components("effects").items()}
NAMED = {
    *("zero_offset", "prestretch", "force_offset", "force_drift", "machine_compliance", "clamp_slip", "mullins"),
    *("viscoelastic", "permanent_set", "tearing", "friction", "rate", "hysteresis"),
}
every = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)


@pytest.fixture(scope="module")
def curve() -> Measurement:
    return measured()


@pytest.fixture(scope="module")
def plain(curve: Measurement) -> np.ndarray:
    return force(curve)


@every
def test_how_often_it_is_mistaken_is_a_part_and_rarer_where_it_is_exact(effect: Effect) -> None:
    assert 0 <= effect.mistaken <= (0.12 if effect.exact else 0.5)


def test_the_promised_effects_are_there() -> None:
    assert set(EFFECTS) >= NAMED


@every
def test_it_is_documented(effect: Effect) -> None:
    cls = type(effect)
    assert cls.__doc__
    assert not cls.__doc__.startswith(f"{cls.__name__}(")
    assert len(effect.title) > 5
    assert len(effect.reference) > 20
    assert len(effect.signature) > 20
    assert effect.signature.rstrip()[-1] == "."
    assert any(effect.occurs_on(rig) for rig in components("rigs").values())
    assert effect.stage == STAGES[stage_number(effect)].stage


@every
def test_parameters_are_declared(effect: Effect) -> None:
    names = [p.name for p in effect.coordinates]
    assert len(set(names)) == len(names)
    assert effect.size.null is not None
    for p in effect.coordinates:
        low, high = p.bounds
        assert np.isfinite([low, high, p.scale, p.typical]).all()
        assert p.scale > 0
        assert low <= p.typical <= high
        assert low <= p.first <= high
        assert p.meaning
        assert p.unit
        # The search covers what is believed in.
        assert low <= p.prior.quantile(1e-3)
        assert p.prior.quantile(1 - 1e-3) <= high
        if p.null is not None:
            assert low <= p.null <= high
            assert p.one_sided == (p.null in p.bounds)


@every
def test_it_pickles_and_equals_itself(effect: Effect) -> None:
    assert pickle.loads(pickle.dumps(effect)) == effect == type(effect)()


@every
def test_its_coordinates_carry_its_name(effect: Effect) -> None:
    h = hypothesis("yeoh", [effect.name])
    names = [f"{effect.name}.{p.name}" for p in effect.coordinates]
    assert list(h.names[3:-1]) == names == list(h.natural_names[3:-1])
    assert h.label() == f"yeoh+{effect.name}"


@every
def test_at_its_null_value_it_changes_nothing(effect: Effect, curve: Measurement, plain: np.ndarray) -> None:
    for shapes in (0.02, 0.5, 0.98):
        x = np.array([p.prior.quantile(shapes) if p.null is None else p.null for p in effect.coordinates])
        assert np.array_equal(force(curve, effect.name, x=x), plain)


@every
def test_at_its_typical_size_it_changes_something(effect: Effect, curve: Measurement, plain: np.ndarray) -> None:
    assert np.max(np.abs(force(curve, effect.name) - plain)) > 1e-3 * np.max(plain)


@every
def test_it_fades_towards_null(effect: Effect, curve: Measurement, plain: np.ndarray) -> None:
    x, sizes = effect.typical, []
    for part in (1.0, 0.1, 0.01):
        x[0] = effect.size.null + part * effect.size.scale
        sizes.append(np.linalg.norm(force(curve, effect.name, x=x) - plain))
    assert sizes[0] > sizes[1] > sizes[2] > 0
    assert sizes[2] < 0.05 * sizes[0]


@every
def test_it_says_whether_forces_stay_proportional_to_the_modulus(effect: Effect, curve: Measurement) -> None:
    h = hypothesis("yeoh", [effect.name])
    f, x = Forward(h, curve, curve.deflection), vector(h)
    stiffer = x.copy()
    stiffer[0] += np.log(2.0)
    once, twice = f(x).force, f(stiffer).force
    off = np.max(np.abs(twice - 2 * once)) / np.max(np.abs(twice))
    assert (off < 1e-7) == effect.scales_with_modulus


@every
def test_the_future_does_not_matter(effect: Effect, curve: Measurement) -> None:
    half = curve.select(np.arange(len(curve)) < len(curve) // 2)
    assert half.full_range == curve.full_range
    whole, part = force(curve, effect.name), force(half, effect.name)
    # A speed is the mean over neighbours: that of the last points is not final.
    assert part[:-5] == pytest.approx(whole[: len(half) - 5], rel=2e-6, abs=1e-9)


@every
def test_points_left_out_are_remembered(effect: Effect, curve: Measurement) -> None:
    later = curve.select(curve.cycle == 2)
    assert force(later, effect.name) == pytest.approx(force(curve, effect.name)[curve.cycle == 2], rel=2e-6, abs=1e-9)


@every
def test_what_leaves_the_same_is_of_a_known_kind(effect: Effect) -> None:
    assert set(effect.like_foreign) <= set(KINDS)


@every
def test_draws_do_not_mix(effect: Effect, curve: Measurement) -> None:
    h = hypothesis("mooney_rivlin", [effect.name])
    x = np.tile(vector(h), (5, 1))
    x[:, 2] = effect.size.null + effect.size.scale * np.linspace(0.2, 1.2, 5)
    f = Forward(h, curve, curve.deflection)
    together = f(x).force
    assert together == pytest.approx(np.concatenate([f(row).force for row in x]), rel=1e-9, abs=1e-12)


@every
def test_what_is_sudden_is_searched_for_at_the_moment_at_which_it_is_seen(effect: Effect, curve: Measurement) -> None:
    (own,) = hypothesis("yeoh", [effect.name]).on(curve).effects
    shapes = own.come_at(0.4 * curve.path.clock[-1])
    assert bool(shapes) is ("sudden_change" in own.like_foreign)
    known = {p.name: p for p in own.coordinates}
    for shape in shapes:
        assert shape[own.begins] == 0.4 * curve.path.clock[-1]
        assert all(known[n].bounds[0] <= v <= known[n].bounds[1] for n, v in shape.items())


@every
def test_slopes_are_those_of_the_force(effect: Effect, curve: Measurement) -> None:
    """Against central differences over a larger step, and on the admissible side of each bound."""
    h = hypothesis("yeoh", [effect.name])
    f, x = Forward(h, curve, curve.deflection), vector(h)
    if effect.second is not None:  # two events at one place are one
        x[h.names.index(f"{effect.name}.{effect.second[2]}")] *= 0.6
    found = f(x, sensitivities=True)
    assert found.sensitivity is not None
    assert found.force == pytest.approx(f(x).force, rel=1e-12)
    for i, p in enumerate(h.parameters[: h.curve_size]):
        step = np.zeros(x.size)
        step[i] = 2e-4 if i < 3 else 2e-3 * effect.coordinates[i - 3].scale
        numeric = (f(x + step).force - f(x - step).force) / (2 * step[i])
        apart = np.abs(numeric - found.sensitivity[:, :, i])
        # Where the film becomes slack the slope jumps: a few points may lie across.
        assert np.quantile(apart, 0.97) < 2e-3 * np.max(np.abs(numeric)), p.name
    null = vector(h, "null")
    for p, slope in zip(
        effect.coordinates, np.moveaxis(f(null, sensitivities=True).sensitivity[0], 1, 0)[3:], strict=True
    ):
        assert np.all(np.isfinite(slope))
        assert (p.null is None) == (np.max(np.abs(slope)) == 0)


@every
def test_it_says_where_it_cannot_occur(effect: Effect) -> None:
    d = staircase()
    assert effect.unavailable(RIG, path(d, two_speeds(d))) == ""
    assert '"biaxial"' in effect.unavailable(Biaxial(), path(d, two_speeds(d)))
    assert bool(effect.unavailable(Uniaxial(), path(d, two_speeds(d)))) == effect.needs_clamp
    assert bool(effect.unavailable(RIG, path(d))) == effect.needs_time


@every
def test_what_lies_outside_its_bounds_counts_as_the_bound(effect: Effect) -> None:
    low, high = np.array([p.sense for p in effect.coordinates]).T
    far = np.array([(p.bounds[0] - 1.0, p.bounds[1] + 1.0) for p in effect.coordinates])
    assert np.array_equal(effect.within_bounds(far.T), np.clip(far.T, low, high))


@every
def test_how_large_a_size_with_a_unit_may_be_is_a_matter_of_the_rig(effect: Effect) -> None:
    """A soft film on a small disc sees 20 mm/N as a stiff one sees 0.2: no size in SI is too large for all rigs."""
    size, x = effect.size, effect.typical[None, :].copy()
    x[0, 0] = 100 * max(map(abs, size.bounds))
    kept = effect.within_bounds(x)[0, 0]
    assert kept == (size.bounds[1] if size.unit == "-" else x[0, 0])
    if size.one_sided and size.null == size.bounds[0]:
        assert effect.within_bounds(-x)[0, 0] == size.null


def test_steps_of_differences_stay_small() -> None:
    for effect in EFFECTS.values():
        step = MOUNTING_STEP if isinstance(effect, Geometry) else EFFECT_STEP
        assert step * effect.size.scale < 1e-2 * (effect.size.bounds[1] - effect.size.bounds[0])
