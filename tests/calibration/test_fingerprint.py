"""Stored runs stay valid through what they do not depend on, and through nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest

from bayesmembrane.calibration import fingerprint as module
from bayesmembrane.calibration.fingerprint import SAMPLING, code_of, fingerprint
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.calibration.store import describe
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Normal
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean

FIT = "bayesmembrane.calibration.fit"


def test_every_part_counts(film) -> None:  # type: ignore[no-untyped-def]
    curve, claim = film("neo_hookean", (7.5,)), hypothesis("neo_hookean")
    base = fingerprint(FIT, claim, curve, {"loss": "euclidean"}, 0)
    assert base == fingerprint([FIT], [claim], [curve], {"loss": "euclidean"}, 0)
    others = {
        fingerprint(SAMPLING, claim, curve, {"loss": "euclidean"}, 0),
        fingerprint(FIT, hypothesis("gent"), curve, {"loss": "euclidean"}, 0),
        fingerprint(FIT, [claim, claim], curve, {"loss": "euclidean"}, 0),
        fingerprint(FIT, hypothesis("neo_hookean", convexity="none"), curve, {"loss": "euclidean"}, 0),
        fingerprint(FIT, claim, curve.up_to(0.02), {"loss": "euclidean"}, 0),
        fingerprint(FIT, claim, curve, {"loss": "weighted"}, 0),
        fingerprint(FIT, claim, curve, {"loss": "euclidean"}, 1),
        base,
    }
    assert len(others) == 8


def test_a_prior_counts_as_a_value(film, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    curve, claim = film("neo_hookean", (7.5,)), hypothesis("neo_hookean")
    before = code_of(SAMPLING, [claim], [curve])
    (first,) = NeoHookean.coordinates
    assert isinstance(first.prior, Normal)
    narrow = replace(first, prior=replace(first.prior, sd=first.prior.sd / 10))
    other_words = replace(first, meaning="said otherwise")
    for coordinate, same in ((narrow, False), (other_words, True), (replace(first, bounds=(-1.0, 1.0)), False)):
        monkeypatch.setattr(NeoHookean, "coordinates", (coordinate,))
        assert (code_of(SAMPLING, [hypothesis("neo_hookean")], [curve]) == before) is same


def test_a_major_version_makes_a_stored_run_another(film, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    curve, claim = film("neo_hookean", (7.5,), noise=0.02), hypothesis("neo_hookean")
    settings = Settings(ess=1.0, chunk=30, most_steps=30, walkers=16)
    first = sample(curve, claim, RunSettings(settings=settings, out=tmp_path, name="mine", predictions=False))
    again = sample(curve, claim, RunSettings(settings=settings, out=tmp_path, name="mine", predictions=False))
    assert again.settings == first.settings
    monkeypatch.setattr(module, "majors", lambda: {"emcee": "4"})
    assert describe(curve, claim, settings, 0)["fingerprint"] != first.settings["fingerprint"]
    with pytest.raises(StorageError, match="holds another run"):
        sample(curve, claim, RunSettings(settings=settings, out=tmp_path, name="mine"))
