"""Synthetic films, from the slow textbook solver and not from the one that calibrates."""

import signal
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.reference.slow_solver import force_curve
from tests.seeds import move
from tests.short_walks import shorten

move()  # before any test module draws
# The same examples on every machine: those that are drawn anew belong to studies.
settings.register_profile("suite", derandomize=True)
settings.load_profile("suite")
# Shells start what runs in the background with Ctrl-C ignored, and every process that a test starts would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

INNER, OUTER = 0.010, 0.035
# What takes longest begins first, so that no worker is left alone with it at the end.
LONGEST = (
    "diagnosis/test_diagnose.py",
    "app/test_campaign.py",
    "statistics/test_evidence_posteriors.py",
    "plugin/test_plugin.py",
    "reconstruction/test_reconstruct.py",
    "calibration/test_run.py",
    "app/test_cli.py",
    "comparison/test_evidence.py",
    "report/sections/test_lead.py",
    "test_door.py",
)


# What is made once for all of them would be made once for each worker.
TOGETHER = ("tests/report/",)


class Whole(LoadFileScheduling):
    """Files stay whole, and so do the folders `TOGETHER`."""

    def _split_scope(self, nodeid: str) -> str:
        return next((folder for folder in TOGETHER if nodeid.startswith(folder)), super()._split_scope(nodeid))


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadFileScheduling:
    return Whole(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """`LONGEST` first, else as they were."""
    place = {Path(__file__).parent / name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path, len(place)))


@cache
def _force(name: str, parameters: tuple[float, ...], end: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    deflection = np.linspace(end / points, end, points)
    return deflection, force_curve(material(name)(*parameters), deflection, INNER, OUTER, rtol=1e-9)


Film = Callable[..., Measurement]


@pytest.fixture
def film() -> Film:
    """film(material, parameters, end in m, points, noise in N, seed, stated=False): a measured curve."""

    def make(
        name: str,
        parameters: tuple[float, ...],
        *,
        end: float = 0.05,
        points: int = 12,
        noise: float = 0.0,
        seed: int = 0,
        stated: bool = False,
    ) -> Measurement:
        deflection, force = _force(name, parameters, end, points)
        error = noise * np.random.default_rng(seed).standard_normal(points)
        sd = np.full(points, noise) if stated else None
        return Measurement(deflection, force + error, Annulus(INNER, OUTER), Specimen("synthetic", 5e-5), force_sd=sd)

    return make


@pytest.fixture
def blank_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of what is read on a page."""
    from tests.report.blank import blank  # what draws takes long to import

    blank(monkeypatch.setattr)


@pytest.fixture
def short_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sampling ends at a limit of 40 steps, and says so: for what becomes of draws, and not for what they are."""
    shorten(monkeypatch.setattr)
