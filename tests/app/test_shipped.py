"""What the README asks of the curve that ships, by the command line."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.run import load_run
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED
from bayesmembrane.comparison.jobs import STARTS, first_candidates, nested_starts
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.physics.hypothesis import hypothesis

Run = Callable[..., tuple[int, str, str]]
OP1 = shipped("elastosil_50um_op1.csv"), "--specimen", shipped("elastosil_50um_op1.toml")


def both_estimators(run: Run, materials: str, *more: object) -> None:
    """Every row of ``compare`` with the default seed has a nested run and a bridge."""
    status, out, _ = run("compare", *OP1, "--materials", materials, "--json", *more)
    assert status == 0
    table = json.loads(out)["table"]
    assert [row["hypothesis"] for row in table] == materials.split(",")
    for row in table:
        for values in (row["log_evidence"], row["log_evidence_sd"]):
            assert set(values) == {NESTED, BRIDGE}, row
            assert np.all(np.isfinite([float(v) for v in values.values()])), row


@pytest.mark.usefixtures("short_walks")
def test_a_comparison_has_both_estimators(run: Run) -> None:
    both_estimators(run, "neo_hookean", "--ess", 50)


@pytest.mark.study
def test_so_has_one_of_several_energies_that_are_sampled_well(run: Run) -> None:
    """A comparison once lost Yeoh's nested run by the default seed."""
    both_estimators(run, "neo_hookean,yeoh", "--ess", 100)


def test_a_yeoh_film_has_starts_for_nested_sampling_by_the_default_seed() -> None:
    """What it begins with, alone: each is a film that exists."""
    posterior = Posterior(hypothesis("yeoh"), read_measurement(OP1[0], OP1[2]))
    starts = nested_starts(posterior, first_candidates(posterior, 0), 0)
    assert starts.shape == (2 * STARTS, posterior.size)
    assert np.all(np.isfinite(posterior.evaluate(starts).log_posterior))


@pytest.mark.study
@pytest.mark.usefixtures("short_walks")
def test_a_stretched_yeoh_film_is_sampled(run: Run) -> None:
    status, out, err = run("sample", *OP1, "--material", "yeoh", "--effects", "prestretch", "--ess", 50, "--json")
    assert status == 0, err
    answer = json.loads(out)
    assert set(answer["posterior"]) > {"c1", "c2", "c3"}
    assert all(np.isfinite(v["mean"]) for v in answer["posterior"].values())
    draws = load_run(answer["stored"]).draws()
    assert np.all(np.isfinite(draws))
