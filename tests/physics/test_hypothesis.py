"""A hypothesis: its named vector, its natural parameters, and what it refuses."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.hypothesis import from_settings, hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus

CURVE = Measurement(np.array([0.01, 0.02]), np.array([0.5, -2.0]), Annulus(0.01, 0.035), Specimen("film", 5e-5))


@pytest.mark.parametrize("name", materials())
@pytest.mark.parametrize("noise", ["white", "ar1"])
def test_names_and_natural_parameters_agree(name: str, noise: str) -> None:
    h = hypothesis(name, noise=noise)
    rng = np.random.default_rng(5)
    x = np.stack([p.prior.draw(rng, 9) for p in h.parameters], axis=1)
    natural = h.natural(x, CURVE)
    assert natural.shape == (9, len(h.natural_names)) == (9, len(h.natural_units))
    assert all(n.startswith((f"{name}.", "noise.")) for n in (*h.names, *h.natural_names))
    fields = h.material.field_names()
    assert h.natural_names[: len(fields)] == tuple(f"{name}.{f}" for f in fields)
    back = h.material.to_coordinates(natural[:, : len(fields)].T).T
    assert back == pytest.approx(x[:, : h.material_size], rel=1e-9, abs=1e-9)
    # The inferred noise is relative to the largest force, 2 N here.
    assert natural[:, h.natural_names.index("noise.sd")] == pytest.approx(2 * np.exp(x[:, h.curve_size]))


def test_settings_come_back() -> None:
    for h in (
        hypothesis("yeoh"),
        hypothesis("gent", noise="ar1", convexity="box"),
        hypothesis("ogden", extra_noise=False),
    ):
        assert from_settings(h.settings()) == h


def test_without_extra_noise_the_vector_is_the_material() -> None:
    h = hypothesis("yeoh", extra_noise=False)
    assert h.names == ("yeoh.ln_gd", "yeoh.c2_c1", "yeoh.c3_c1")
    assert h.natural_names == ("yeoh.c1", "yeoh.c2", "yeoh.c3")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"material_name": "yeo"}, 'no material called "yeo"; did you mean "yeoh"'),
        ({"noise": "wite"}, 'no noise model called "wite"; did you mean "white"'),
        ({"convexity": "boxes"}, 'no convexity prior called "boxes"; did you mean "box"'),
        ({"effects": ["warp"]}, 'no effect called "warp"'),
        ({"noise": "ar1", "extra_noise": False}, "always infers a part of the noise"),
    ],
)
def test_unknown_names_are_refused_in_a_sentence(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        hypothesis(**{"material_name": "yeoh", **options})  # type: ignore[arg-type]
