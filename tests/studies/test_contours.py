"""What a traced contour adds: the valley of Mooney-Rivlin gets shorter, and no axis of Ogden's longer."""

import numpy as np

from tests.studies.contours import linear


def test_a_contour_shortens_the_valley_of_mooney_rivlin() -> None:
    alone, coarse, fine = (linear("mooney_rivlin", sd) for sd in (0.0, 0.3, 0.03))
    assert fine["length"] < 0.2 * coarse["length"] < 0.1 * alone["length"]


def test_no_coordinate_of_an_ogden_film_is_known_worse_with_a_contour() -> None:
    alone, both = linear("ogden", 0.0), linear("ogden", 0.1)
    assert np.all(np.array(both["sd"]) <= np.array(alone["sd"]) * (1 + 1e-6))
    assert both["volume"] < 0.8 * alone["volume"]
