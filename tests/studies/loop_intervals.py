"""Whether the 90 % intervals of a fit hold the film that was put in: its parameters, and its force without faults."""

from __future__ import annotations

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.physics.mechanics import api
from tests.generator.datasets import Dataset

DRAWS, INTERVAL = 400, (0.05, 0.95)
PLACES = (0.5, 1.0)  # of the largest deflection


def covered(found: Diagnosis, candidate: Candidate, data: Dataset) -> dict[str, bool]:
    """{parameter, or "force at half" and "force at the end": True if its interval holds the truth}.

    Intervals are those of Laplace's approximation, of the readings that were not set aside. Ogden's terms may change
    places, so only its forces are judged.
    """
    covariance = Search(found.measurement, found.noise).covariance(candidate)
    rng = np.random.default_rng(data.truth["seed"])
    draws = rng.multivariate_normal(candidate.x, covariance, DRAWS, method="eigh")
    films = candidate.hypothesis.films(draws)
    material = candidate.hypothesis.material
    out = {}
    if material.name != "ogden":
        for name, values in zip(material.field_names(), films.T, strict=True):
            out[name] = _within(values, data.truth["parameters"][name])
    at = np.array(PLACES) * data.path.largest
    radii = {"inner_radius": data.film.inner, "outer_radius": data.film.outer}
    forces = api.solve(api.request(material, films, at, **radii)).force
    for name, values, truth in zip(("force at half", "force at the end"), forces.T, data.film.force(at), strict=True):
        out[name] = _within(values, float(truth))
    return out


def _within(values: np.ndarray, truth: float) -> bool:
    low, high = np.nanquantile(values, INTERVAL)
    return bool(low <= truth <= high)
