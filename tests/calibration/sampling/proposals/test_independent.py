"""A mixture learned in rounds: close to what is known, or none."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm

from bayesmembrane.calibration.posterior import Evaluation, Outcome, Outcomes
from bayesmembrane.calibration.sampling.proposals import filling
from bayesmembrane.calibration.sampling.proposals.independent import (
    CHECKED,
    EACH,
    FILLINGS,
    ROUNDS,
    _of_all_coordinates,
    independent,
)
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.calibration.starts import Tried


class Known:
    """A density by its coordinates, which stand for a curve, cut where ``cut`` says so."""

    def __init__(self, size: int, kind: str) -> None:
        self.size, self.readings, self.kind = size, size, kind

    def evaluate(self, x: np.ndarray) -> Evaluation:
        out = x[:, 0] > 0.5 if self.kind == "cut" else np.zeros(len(x), dtype=bool)
        lp = np.where(out, -np.inf, self.given(x, x))
        return Evaluation(np.zeros(len(x)), lp, np.where(out, Outcome.NOT_CONVEX, Outcome.OK), x)

    def given(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        if self.kind == "two":  # modes at -6 and 6, one twice as likely
            low, high = (norm.logpdf(force, m).sum(axis=1) for m in (-6.0, 6.0))
            return np.asarray(np.logaddexp(low + np.log(2 / 3), high + np.log(1 / 3)))
        if self.kind == "spikes":  # a heavy tail around a needle in every direction
            return np.asarray(np.sum(-np.log(1e-4 + np.abs(force)) - 0.05 * np.abs(force), axis=1))
        bent = force.copy()
        bent[:, 1:] -= 0.3 * force[:, :1] ** 2
        return np.asarray(norm.logpdf(bent).sum(axis=1))


def found(target: Known, spread: float, seed: int):  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(seed)
    x = spread * rng.standard_normal((1200, target.size))
    counts = Outcomes()
    tried = Tried(x, target.evaluate(x).log_posterior)
    return independent(target, tried, rng, counts), counts  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("size", "kind", "spread"), [(2, "bent", 2.0), (4, "bent", 2.0), (2, "cut", 1.5), (2, "two", 5.0)]
)
def test_proposals_are_close_and_their_weights_give_the_integral(size: int, kind: str, spread: float) -> None:
    target = Known(size, kind)
    close, counts = found(target, spread, 11)
    assert close is not None
    assert sum(counts.values()) <= ROUNDS * EACH
    y = close.mixture.draw(np.random.default_rng(12), 20_000)
    judged = worth(target.evaluate(y).log_posterior - close.mixture.log_density(y))
    assert judged.good
    assert judged.efficiency > 0.2
    exact = norm.logcdf(0.5) if kind == "cut" else 0.0
    assert judged.log_mean == pytest.approx(exact, abs=5 * judged.log_mean_sd)


def test_states_are_drawn_from_both_modes() -> None:
    close, _ = found(Known(2, "two"), 5.0, 13)
    share = np.mean(close.states[:, 0] < 0)
    assert 0.45 < share < 0.9


def test_what_no_mixture_follows_is_given_up() -> None:
    """At the latest when it was filled as often as any is: along a bend first draws may look better than hopeless."""
    close, counts = found(Known(6, "spikes"), 1.0, 14)
    assert close is None
    assert counts["ok"] <= ROUNDS * EACH + FILLINGS * (filling.FIRST + filling.TURNS * filling.EACH + CHECKED)


def worth_so(efficiency: float, good: bool = True) -> Any:
    return SimpleNamespace(worth=SimpleNamespace(good=good, efficiency=efficiency))


@pytest.mark.parametrize(
    ("unfilled", "fillings", "best"),
    [
        ((0.03,), [(0.07,), (0.03,)], 0.07),  # the first filling is the best one
        ((0.03,), [(0.07,), (0.07, False)], 0.07),
        ((0.01,), [(0.07,), (0.07, False)], 0.07),
        ((0.05, False), [(0.079,), (0.019,)], 0.079),
        ((0.03,), [None, (0.04,)], 0.04),
        ((0.03,), [None, None], 0.03),
        ((0.01,), [(0.015,), None], None),
        ((0.03,), [(0.09,), (0.5,)], 0.09),  # enough, and not filled again
    ],
)
def test_the_best_of_all_fillings_is_kept(unfilled: Any, fillings: list[Any], best: float | None) -> None:
    left = [None if f is None else worth_so(*f) for f in fillings]
    search = SimpleNamespace(
        round=lambda tried, *_: (worth_so(*unfilled), tried), relearned=lambda _: left.pop(0) if left else None
    )
    found = _of_all_coordinates(cast(Any, search), cast(Any, None))
    assert (None if found is None else found.worth.efficiency) == best
