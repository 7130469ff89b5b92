"""Runs small enough for a test: draws around a known film instead of a walk, and one run that was really stored."""

import numpy as np
import pytest

from bayesmembrane.calibration.beside_paper import BreakPoint
from bayesmembrane.calibration.goodness import goodness
from bayesmembrane.calibration.predictions import Wanted, predict_draws
from bayesmembrane.calibration.run import Run, RunSettings, predictions_of, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Provenance, Specimen
from bayesmembrane.physics.cache import Tally
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.mechanics.api import force_curve
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.report.runs import HowSampled, Shown, ShownFilm

TRUTH = (8.8, -0.6, 0.05)
SD = 0.004
BREAKS = (BreakPoint("1", 50e-6, 0.050, 4.0), BreakPoint("2", 100e-6, 0.045, 6.0))
WILD = '<b>&"film'


def measured(end: float = 0.035, name: str = WILD, points: int = 8) -> Measurement:
    """A Yeoh film with noise, tested up to 45 mm."""
    at = np.linspace(0.004, end, points)
    force = force_curve("yeoh", TRUTH, at)[0] + SD * np.random.default_rng(1).standard_normal(points)
    origin = Provenance("curve.csv", "film.toml", "", "bench <2> & 3")
    rig = Annulus(0.010, 0.035)
    return Measurement(at, force, rig, Specimen(name, 50e-6), None, np.full(points, SD), None, origin, 0.045)


def drawn(claim: Hypothesis, center: tuple[float, ...], size: int = 60) -> np.ndarray:
    """Coordinates (size, k) around a film."""
    rng = np.random.default_rng(2)
    x = np.asarray(claim.material.to_coordinates(np.array(center)))
    return np.concatenate([x, [-7.0]]) + 0.01 * rng.standard_normal((size, len(x) + 1))


def show(material: str, center: tuple[float, ...], measurement: Measurement, dominated: bool, status: str) -> Shown:
    """What a report shows of draws around a film."""
    claim = hypothesis(material)
    x = drawn(claim, center)
    k = x.shape[1]
    found = predict_draws(claim, measurement, x, Wanted(up_to=0.05, breaks=BREAKS, draws=25))
    good = status == "converged"
    sampling = HowSampled(
        status=status,
        ess=1200.0 if good else 300.0,
        wanted=1000.0,
        r_hat=1.003 if good else 1.08,
        tau=np.full(k, 30.0),
        acceptance=0.3,
        ensembles=2,
        walkers=32,
        steps=900,
        burn=100,
        evaluations=57600,
        seconds=3.0,
        means=np.cumsum(np.random.default_rng(0).normal(size=(2, 200, k)), axis=1),
        steps_at=np.linspace(1, 900, 200),
        draws=x.reshape(2, -1, k),
        draws_at=np.linspace(100, 900, len(x) // 2),
    )
    best = force_curve(material, center, measurement.deflection)[0]
    fit = goodness(measurement, best, claim.curve_size).summary()
    return Shown(
        folder="chains/tiny",
        hypothesis=claim,
        film=ShownFilm(measurement.specimen.name, 50e-6, Annulus(0.010, 0.035), "bench <2> & 3", ("curve.csv",), ()),
        data_hash=measurement.data_hash,
        digest=found,
        x=x,
        natural=claim.natural(x, measurement),
        prior=np.stack([p.prior.draw(np.random.default_rng(3), 200) for p in claim.parameters], axis=1),
        sampling=sampling,
        goodness=fit,
        dominated=dominated,
        outcomes={"ok": 50000, "not convex": 7600},
        masses={"reached": (0.6, 0.01), "box": (0.2, 0.01), "elliptic": (0.9, 0.01)},
        cache=Tally(hits=3, misses=1, bypassed=70).summary(),
        crosscheck={"draws": 16, "largest": 3e-8, "at_mm": 12.0, "compared": 128, "missing": 0},
        facts={"seed": 0, "version of numpy": "2", "folder": material},
    )


@pytest.fixture(scope="session")
def yeoh() -> Shown:
    return show("yeoh", TRUTH, measured(), dominated=False, status="converged")


@pytest.fixture(scope="session")
def neo_hookean() -> Shown:
    return show("neo_hookean", (7.5,), measured(), dominated=True, status="step limit")


@pytest.fixture(scope="session")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A neo-Hookean run of a few steps, with its predictions."""
    settings = Settings(ess=1.0, chunk=40, most_steps=40, walkers=16)
    out = tmp_path_factory.mktemp("chains")
    run = sample(measured(), hypothesis("neo_hookean"), RunSettings(out=out, settings=settings, predictions=False))
    predictions_of(run, Wanted(breaks=BREAKS, draws=20))
    return run
