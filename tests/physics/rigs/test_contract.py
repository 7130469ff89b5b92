"""What every rig must keep, run over all that the registry finds, third parties' included."""

import inspect
import pickle
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.registry import component, components, material
from bayesmembrane.ground.units import FORCE, LENGTH, RATIO, STRESS, known_units
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs._pressed import Pressed
from bayesmembrane.physics.rigs.base import Films, Rig, Trial, rig_of
from bayesmembrane.physics.rigs.contour import Contour

RIGS: dict[str, type[Rig]] = components("rigs")
SHARE = np.linspace(0.1, 1.0, 10)
COLUMNS = {RATIO: 1.0 + SHARE, STRESS: 1e6 * SHARE, FORCE: SHARE}
THICKNESS = 1e-4
every = pytest.mark.parametrize("kind", RIGS.values(), ids=RIGS)


def curve_on(kind: type[Rig]) -> Measurement:
    """A measurement with plausible numbers in every column that the rig declares."""
    rig = kind.example()
    columns = {**COLUMNS, LENGTH: rig.size() * SHARE}
    if isinstance(rig, Contour):
        radius = rig.inner_radius + (rig.outer_radius - rig.inner_radius) * 0.9 * SHARE
        return Measurement(radius, rig.lift * (1 - 0.9 * SHARE), rig, Specimen("film", THICKNESS))
    if issubclass(kind, Pressed):
        columns |= {RATIO: 1.0 - 0.6 * SHARE, STRESS: -1e6 * SHARE}
    found = rig.from_columns({name: columns[quantity] for name, quantity in rig.columns.items()}, THICKNESS)
    return Measurement(
        found["deflection"], found["force"], rig, Specimen("film", THICKNESS), across=found.get("across")
    )


def films(name: str, count: int = 1, sensitivities: bool = False) -> Films:
    p = material(name).typical() * np.linspace(1.0, 1.5, count)[:, None]
    return Films(material(name), p, sensitivities)


@every
def test_it_is_documented(kind: type[Rig]) -> None:
    assert not inspect.isabstract(kind)
    assert len(inspect.getdoc(kind) or "") > 20
    assert component("rigs", kind.name) is kind
    assert len(kind.title) > 5
    for quantity in (*kind.columns.values(), *kind.noise.values()):
        assert known_units(quantity)
    rig = kind.example()
    assert set(rig.shown(THICKNESS)) == {"m", "m/N", "N", "N/s"}
    assert all(factor > 0 and unit for factor, unit in rig.shown(THICKNESS).values())
    assert any(c.isdigit() for c in rig.place(0.3 * rig.size()))
    assert all(rig.newton(quantity, THICKNESS) > 0 for quantity in rig.noise.values())


@every
def test_it_pickles_and_compares(kind: type[Rig]) -> None:
    rig = kind.example()
    assert pickle.loads(pickle.dumps(rig)) == rig
    assert hash(kind(**rig.lengths)) == hash(rig)


@every
def test_lengths_must_be_positive(kind: type[Rig]) -> None:
    lengths = kind.example().lengths
    for name in lengths:
        for bad in (0.0, -0.01, np.nan, np.inf):
            with pytest.raises(DataError, match=name):
                kind(**{**lengths, name: bad})


@every
def test_files_come_back(kind: type[Rig], tmp_path: Path) -> None:
    m = curve_on(kind)
    write_measurement(m, tmp_path / "c.csv", tmp_path / "c.toml")
    again = read_measurement(tmp_path / "c.csv", tmp_path / "c.toml")
    assert again.rig == m.rig
    assert again.deflection == pytest.approx(m.deflection, rel=1e-12)
    assert again.force == pytest.approx(m.force, rel=1e-12)
    assert (again.across is None) == (m.across is None)


@every
def test_curves_scale_with_the_modulus_and_slopes_are_those_of_the_force(kind: type[Rig]) -> None:
    m = curve_on(kind)
    rig, one = rig_of(m), films("mooney_rivlin", 2, sensitivities=True)
    curves = rig.curves(one, m, m.deflection)
    assert np.all(curves.ok)
    assert np.all(curves.force > 0)
    assert curves.sensitivity is not None
    # F(s c) = s^k F(c), so that by Euler's theorem k F = sum_i c_i dF/dc_i; k is 1 for forces and 0 for shapes.
    power = 0 if isinstance(rig, Contour) else 1
    euler = np.einsum("bni,bi->bn", curves.sensitivity, one.parameters)
    assert euler == pytest.approx(power * curves.force, rel=1e-6, abs=1e-6 * (1 - power))
    twice = rig.curves(Films(one.material, 2 * one.parameters), m, m.deflection)
    assert twice.force == pytest.approx(2**power * curves.force, rel=1e-9)
    assert np.all(np.isfinite(curves.convexity) & np.isfinite(curves.ellipticity))


@every
def test_its_law_is_its_curves(kind: type[Rig]) -> None:
    m = curve_on(kind)
    rig, some = rig_of(m), films("neo_hookean", 2)
    trial = Trial(m, m.path, np.ones(2), np.full(2, m.full_range))
    law, (convexity, ellipticity) = rig.law(some, trial)
    d = np.broadcast_to(m.deflection, (2, len(m)))
    force, slope = law(d)
    assert force == pytest.approx(rig.curves(some, m, m.deflection).force, rel=2e-6)
    step = 1e-5 * rig.size()
    numeric = (law(d + step / 2)[0] - law(d - step / 2)[0])[:, :-1] / step
    assert slope[:, :-1] == pytest.approx(numeric, rel=1e-3)
    assert len(law.status) == len(convexity) == len(ellipticity) == 2
    assert np.all(convexity[np.isfinite(convexity)] > -1e-9), "a neo-Hookean film is convex"
    both = type(law).stack([law, law])
    assert both(np.vstack([d, d]))[0] == pytest.approx(np.vstack([force, force]), rel=1e-12)


@every
def test_a_law_varies_to_first_order(kind: type[Rig]) -> None:
    m = curve_on(kind)
    some = films("neo_hookean", 2, sensitivities=True)
    law, _ = rig_of(m).law(some, Trial(m, m.path, np.ones(2), np.full(2, m.full_range)))
    d = np.broadcast_to(m.deflection, (2, len(m)))
    grown = 1.0 if kind is Contour else 1 + 1e-4
    assert law.varied(1e-4 * some.parameters)(d)[0] == pytest.approx(grown * law(d)[0], rel=1e-6)


@every
def test_a_hypothesis_is_predicted_on_it(kind: type[Rig]) -> None:
    m = curve_on(kind)
    h = hypothesis("yeoh")
    x = h.material.to_coordinates(h.material.typical())
    found = Forward(h, m, m.deflection)(x, sensitivities=True)
    assert np.all(found.ok)
    part = m.select(np.arange(len(m) // 2))
    assert Forward(h, part, part.deflection)(x).force[0] == pytest.approx(found.force[0][: len(part)], rel=2e-6)


@every
def test_states_stretches_and_proposals_make_sense(kind: type[Rig]) -> None:
    m = curve_on(kind)
    rig = rig_of(m)
    p = material("neo_hookean").typical()
    at = rig.size() * np.array([0.2, 0.5])
    along, height, l1, l2 = rig.states(material("neo_hookean").from_vector(p), at, 7)
    assert along.shape == height.shape == l1.shape == l2.shape == (2, 7)
    assert np.all((l1 > 1) != issubclass(kind, Pressed))
    assert np.all(l1 > 0)
    assert np.all(np.diff(along, axis=1) > 0)
    mean = rig.mean_stretch(float(at[1]))
    assert mean is None or mean > 1
    for words, other in rig.variants():
        assert words.startswith("with ")
        assert other != rig
    if kind.proposal:
        stretch = np.linspace(1.0, 2.0, 5)
        across, tensions = kind.proposed(stretch)
        assert across.shape == (5,)
        assert across[0] == 1.0
        assert set(tensions) <= {1, 2}


@every
def test_effects_ask_its_properties(kind: type[Rig]) -> None:
    rig = kind.example()
    path = Motion(rig.size() * SHARE, np.arange(1.0, 11.0), rig.size())
    for effect in components("effects").values():
        assert bool(effect().unavailable(rig, path)) == (not effect.occurs_on(kind))
        assert not effect.occurs_on(kind) or kind.has_path


@every
def test_readings_are_proportional_to_the_modulus_where_that_is_said(kind: type[Rig]) -> None:
    """F(s c) = s F(c) and as convex or not, which is what `reads_force` promises to whoever draws moduli by it."""
    m, claim = curve_on(kind), hypothesis("mooney_rivlin")
    x = np.array([[2.0, 0.1, -4.0], [2.0 + np.log(3.0), 0.1, -4.0]])
    found = Forward(claim, m, m.deflection)(x)
    assert np.all(found.ok)
    factor = 3.0 if kind.reads_force else 1.0
    assert found.force[1] == pytest.approx(factor * found.force[0], rel=1e-9)
    assert np.array_equal(np.sign(found.convexity[0]), np.sign(found.convexity[1]))
