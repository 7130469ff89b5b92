"""What a fit says of a test at another speed: as much, and less surely where a law is at work."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.continued import Continued, continued
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import form_factors
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from tests.diagnosis.curves import SD, measured, triangle, white_noise

LEVEL = 0.03  # N, of friction


def rubbing() -> Measurement:
    d = triangle(60)
    return measured(8 * d + LEVEL * np.sign(np.diff(d, prepend=0.0)), d)


def said(names: list[str], further: float) -> Continued:
    m, h = rubbing(), hypothesis("neo_hookean", names)
    search = Search(m, white_noise(m, SD))
    (start,) = search.material_starts(hypothesis("neo_hookean"))[:1]
    fit = search.at(h, np.concatenate([start, *(e.typical for e in h.effects)]))
    assert fit is not None
    return continued(search, fit, Forward(h, m, m.deflection), form_factors(m), np.full(len(m), further))


def sd(of: Continued) -> Array:
    return np.sqrt(np.einsum("ni,ij,nj->n", of.columns, of.covariance, of.columns))


def test_a_law_is_less_sure_at_another_speed_and_says_the_same() -> None:
    same, other, further = (said(["friction"], by) for by in (0.0, 0.3, 0.6))
    np.testing.assert_array_equal(same.force + same.moved, other.force + other.moved)
    assert np.all(sd(other) > sd(same))
    # Variances add, whatever is known of the fit.
    added = [sd(of) ** 2 - sd(same) ** 2 for of in (other, further)]
    assert added[1] == pytest.approx(4 * added[0])


def test_without_a_law_another_speed_is_nothing() -> None:
    np.testing.assert_array_equal(sd(said(["force_offset"], 0.0)), sd(said(["force_offset"], 0.3)))
