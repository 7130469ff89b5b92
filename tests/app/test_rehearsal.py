"""What runs take of a processor, from rehearsals of them that are over, and of some that are not."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

from bayesmembrane.app.rehearsal import LONG, Pace, Rehearsal, ends, rehearse
from bayesmembrane.app.survey import LUCK, ROUGHLY, SHARES, Survey, kind_of
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.planning import plan
from bayesmembrane.campaign.task import Task
from bayesmembrane.ground.compiling import compilation
from tests.campaign.films import write_campaign


def walked(steps: int, lessons: tuple[int, ...] = (), correlation: float = 0.5) -> Chains:
    """Two ensembles of 16 walkers, each coordinate an autoregressive process with tau = (1 + c) / (1 - c)."""
    rng = np.random.default_rng(0)
    z = rng.standard_normal((2, steps, 16, 2)) * np.sqrt(1 - correlation**2)
    x = np.empty_like(z)
    x[:, 0] = rng.standard_normal((2, 16, 2))
    for i in range(1, steps):
        x[:, i] = correlation * x[:, i - 1] + z[:, i]
    return Chains(x, np.zeros((2, steps, 16)), (), Counter(), 0.0, lessons)


def test_nothing_is_known_of_a_walk_that_has_just_begun() -> None:
    assert ends(walked(5), Settings(chunk=300)) == (300, 300, LONG)
    assert ends(walked(5), Settings(chunk=300, most_steps=400)) == (300, 300, 400)


def test_a_walk_ends_at_fifty_autocorrelation_times_or_at_the_draws_that_are_wanted() -> None:
    """tau is 3: it is known after 150 steps, and 32 walkers are worth 1600 draws then."""
    chains = walked(120, lessons=(100,), correlation=0.0)
    least, likely, most = ends(chains, Settings(ess=100))
    assert least == likely == pytest.approx(100 + 50, abs=15)
    assert most > 1600  # after the next lesson but one
    chains = walked(390, lessons=(100,))
    least, likely, _ = ends(chains, Settings(ess=100))
    assert least == likely == 390
    least, likely, _ = ends(chains, Settings(ess=10_000))
    assert least == pytest.approx(100 + 3 * 10_000 / 32, rel=0.2)
    assert likely == pytest.approx(least + 300)  # a lesson comes at 400, and what was before does not count


def test_a_rehearsal_that_is_not_over_counts_what_is_lacking(tmp_path: Path) -> None:
    task = asked(tmp_path)
    whole, begun = rehearse(task, tmp_path / "whole", 100.0), rehearse(task, tmp_path / "begun", 0.0)
    assert whole.pace.least == whole.pace.likely == whole.pace.most <= whole.took
    assert begun.pace.least <= begun.pace.likely <= begun.pace.most
    assert begun.took < begun.pace.most
    assert whole.fault == begun.fault == ""
    assert (whole.whole, begun.whole) == (True, False)
    assert len(list((tmp_path / "whole" / "pages").iterdir())) == 1


# What is given up anywhere may leave a file that it was reading to the collector, in a process that ends soon.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_analysis_that_takes_too_long_is_given_up_and_told(tmp_path: Path) -> None:
    task = asked(tmp_path, "valleys")
    given_up, done = rehearse(task, tmp_path, 0.01), rehearse(task, tmp_path, 100.0)
    assert (given_up.over, done.over) == (False, True)
    assert 0.01 <= given_up.pace.least < done.pace.least


def test_what_cannot_be_rehearsed_says_why(tmp_path: Path) -> None:
    assert "is not what it was" in rehearse(replace(asked(tmp_path), data="another"), tmp_path, 1.0).fault


def asked(place: Path, analysis: str = "sample") -> Task:
    file = write_campaign(place, films=("a",), analyses=f'wanted = ["{analysis}"]\npages = true')
    return plan(read_campaign(file), file).tasks[0]


def test_only_what_is_compiled_counts_as_compiling() -> None:
    @numba.njit
    def inner(x: float) -> float:
        return x + 1

    @numba.njit
    def outer(x: float) -> float:
        return inner(x) * 2

    with compilation() as found:
        outer(1.0)
    assert found.seconds > 0
    with compilation() as again:
        outer(2.0)
    assert again.seconds == 0


def test_what_is_not_rehearsed_is_taken_for_what_is_most_like_it(tmp_path: Path) -> None:
    """The same kind on another film, else the same hypothesis, else its material, else any; and a share of runs."""
    file = write_campaign(
        tmp_path,
        hypotheses='materials = ["gent", "yeoh"]\nnoise = ["white", "ar1"]',
        analyses='wanted = ["sample", "valleys", "compare"]\npages = false',
    )
    tasks = plan(read_campaign(file), file).tasks
    survey = Survey({task.key: kind_of(task) for task in tasks})
    first, other = ([t for t in tasks if t.film == f"films_{name}"] for name in "ab")
    white, ar1, *_ = first
    assert survey.pace(white) == Pace(0.0, 0.0, 0.0)
    survey.found = {white.key: known(6.0), ar1.key: known(8.0, 7.0, 9.0)}
    assert survey.pace(ar1) == Pace(8.0, 7.0, 9.0)
    assert survey.pace(other[0]) == Pace(6.0, 6.0 / LUCK, 6.0 * LUCK)
    yeoh = next(t for t in other if t.claims[0]["material"] == "yeoh")
    assert survey.pace(yeoh) == Pace(7.0, 6.0 / (LUCK * ROUGHLY), 9.0 * LUCK * ROUGHLY)
    valleys = next(t for t in first if t.analysis == "valleys")
    assert survey.pace(valleys).likely == pytest.approx(SHARES["valleys"] * 6.0)
    compare = next(t for t in first if t.analysis == "compare")
    assert survey.pace(compare).likely == pytest.approx(SHARES["compare"] * (6.0 + 8.0 + 7.0 + 7.0))
    survey.found[compare.key] = Rehearsal(Pace(90.0, 90.0, 90.0), 90.0, over=False)
    assert survey.pace(compare).least == 90.0
    assert survey.pace(compare).likely == ROUGHLY * 90.0


def known(likely: float, least: float | None = None, most: float | None = None) -> Rehearsal:
    return Rehearsal(Pace(likely, least or likely, most or likely), likely)
