"""Forces of long curves from those at a few nodes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.thinning import MOST
from bayesmembrane.physics.forward import Forward, Prediction
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.nodes import NODES, nodes_of
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.base import Strip
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial
from bayesmembrane.physics.rigs.planar import Planar
from bayesmembrane.physics.rigs.shear import Shear
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

FILMS = {
    "neo_hookean": [[2.0], [3.1]],
    "gent": [[2.0, 4.0], [2.0, 2.5]],
    "yeoh": [[2.0, -0.02, 0.002], [1.0, 0.05, 0.0]],
    "mooney_rivlin": [[2.0, 0.1], [2.0, 0.0]],
    "ogden": [[2.0, -3.0, -3.0, 0.4, 1.2, 0.7]],
}


def long_curve(count: int = MOST + 500, end: float = 0.035) -> Measurement:
    """There and back, as a machine reads it."""
    up = np.linspace(0.0, end, count // 2 + 1)
    at = np.concatenate([up, up[-2::-1]])
    time = np.arange(1.0, at.size + 1.0)
    return Measurement(at, np.ones(at.size), Annulus(0.010, 0.035), Specimen("film", 5e-5), time=time)


def forward_of(material: str, m: Measurement) -> Forward:
    return Forward(hypothesis(material), m, m.deflection)


def both_ways(material: str, m: Measurement, films: ArrayLike) -> tuple[Prediction, Prediction]:
    """What is told at every reading, and from the nodes."""
    forward = forward_of(material, m)
    nodes = nodes_of(forward)
    assert nodes is not None
    return forward(films), nodes(np.asarray(films))


@pytest.mark.parametrize("material", FILMS)
def test_forces_from_the_nodes_are_those_of_the_film_at_every_reading(material: str) -> None:
    whole, few = both_ways(material, long_curve(), FILMS[material])
    assert np.all(whole.ok)
    np.testing.assert_allclose(few.force, whole.force, rtol=0, atol=1e-7 * np.max(whole.force))
    assert np.array_equal(few.status, whole.status)
    assert np.array_equal(few.convexity >= 0, whole.convexity >= 0)


def test_a_film_that_lacks_a_node_is_asked_at_every_reading() -> None:
    """A Gent film that locks on the way: no force beyond, and all of them before."""
    whole, few = both_ways("gent", long_curve(), [[2.0, -1.5], [2.0, 4.0]])
    assert whole.ok.tolist() == few.ok.tolist() == [False, True]
    assert np.array_equal(few.status[0], whole.status[0])
    np.testing.assert_array_equal(few.force[0], whole.force[0])


@pytest.mark.parametrize("rig", [Uniaxial(0.05, 0.01), Equibiaxial(0.05, 0.01), Planar(0.05, 0.01)])
@pytest.mark.parametrize("material", FILMS)
def test_forces_of_a_strip_from_the_nodes_are_those_at_every_reading(material: str, rig: Strip) -> None:
    """Some readings are below rest, as noise has it, where a strip is slack."""
    m = long_curve(end=0.06)
    strip = Measurement(m.deflection - 1e-5, m.force, rig, m.specimen, time=m.time)
    whole, few = both_ways(material, strip, FILMS[material])
    assert np.all(whole.ok)
    np.testing.assert_allclose(few.force, whole.force, rtol=0, atol=1e-8 * np.max(whole.force))
    np.testing.assert_array_equal(few.convexity, whole.convexity)
    np.testing.assert_array_equal(few.ellipticity, whole.ellipticity)


def test_few_readings_effects_and_what_bears_compression_have_no_nodes() -> None:
    m = long_curve()
    assert nodes_of(forward_of("gent", long_curve(MOST - 100))) is None
    assert nodes_of(Forward(hypothesis("gent", ["permanent_set"]), m, m.deflection)) is None
    pushed = Measurement(m.deflection - 0.01, m.deflection - 0.01, Uniaxial(0.05, 0.01), m.specimen, time=m.time)
    assert nodes_of(forward_of("gent", pushed)) is None
    plates = Measurement(m.deflection, m.force, Shear(), m.specimen, time=m.time)
    assert nodes_of(forward_of("gent", plates)) is None
    assert nodes_of(forward_of("gent", m)).spline.shape == (len(m), NODES)  # type: ignore[union-attr]


@pytest.mark.parametrize(("material", "effects"), [("gent", ()), ("yeoh", ("permanent_set",)), ("mooney_rivlin", ())])
def test_margins_are_those_of_the_whole_curve(material: str, effects: tuple[str, ...]) -> None:
    m = long_curve(300)
    forward = Forward(hypothesis(material, effects), m, m.deflection)
    rng = np.random.default_rng(3)
    x = np.stack([p.prior.quantile(rng.uniform(size=20)) for p in forward.hypothesis.parameters], axis=1)
    whole, alone = forward(x), forward.margins(x)
    elliptic = whole.ellipticity > 0
    assert np.any(elliptic)
    np.testing.assert_array_equal(alone.convexity[elliptic], whole.convexity[elliptic])
    np.testing.assert_array_equal(alone.ellipticity[elliptic], whole.ellipticity[elliptic])
    # Of the others no more is asked than that they are not.
    assert np.all(alone.ellipticity[~elliptic] <= 0)
    assert np.all(alone.convexity[~elliptic] < 0)
