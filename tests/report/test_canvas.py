"""Every picture can be drawn, twice the same, whatever is missing."""

from collections.abc import Callable

import numpy as np
import pytest

from bayesmembrane.report import canvas as figures
from bayesmembrane.report.canvas import Curve, Interval, Look, LossBar, Marginal, Picture, Points, Recovered
from bayesmembrane.report.style import colour, linestyle, spoken, symbol

N, G = 9, 30
X = np.linspace(0.002, 0.03, N)
GRID = np.linspace(0.001, 0.05, G)
RNG = np.random.default_rng(0)


def curve(material: str, residual: float = 1e-3) -> Curve:
    force = 40 * GRID * np.array([0.9, 1.0, 1.1])[:, None]
    return Curve(material, GRID, force, GRID > 0.03, residual * np.ones((3, N)))


POINTS = Points(X, 40 * X, np.full(N, 2e-3))
BARE = Points(X, 40 * X)
REST = Points(X + 0.03, 40 * X + 1.2)
DRAWS = RNG.normal(size=(500, 3)) * [1.0, 0.1, 1e-3] + [8.0, -0.6, 0.01]
NAMES, UNITS = ("yeoh.c1", "yeoh.c2", "noise.sd"), ("N/m", "N/m", "N")
STATES = np.linspace(1.0, 3.0, 40) * np.ones((2, 1))
HAT = np.array([1.0, 2.0, 3.0])

PICTURES: dict[str, Callable[[], Picture]] = {
    "first look": lambda: figures.first_look([Look(POINTS, (curve("yeoh"), curve("gent")), REST, "up to 30 mm")]),
    "first look of two ranges, residuals far apart": lambda: figures.first_look(
        [Look(POINTS, (curve("yeoh"), curve("gent", 2.0))), Look(BARE, (curve("a_third_party_material"),))]
    ),
    "first look without any force": lambda: figures.first_look(
        [Look(BARE, (Curve("gent", GRID, np.full((3, G), np.nan), GRID > 0.03, np.full((3, N), np.nan)),))]
    ),
    "residuals": lambda: figures.residuals(POINTS, 1e-3 * np.ones((3, N)), "yeoh"),
    "residuals without noise": lambda: figures.residuals(BARE, np.zeros((3, N)), "yeoh"),
    "corner": lambda: figures.corner_plot(DRAWS, NAMES, UNITS, "yeoh", [8.0, -0.6, None], [7.9, 99.0, None]),
    "corner of one parameter that never moved": lambda: figures.corner_plot(
        np.full((50, 1), 3.0), ("gent.c1",), ("N/m",), "gent"
    ),
    "traces": lambda: figures.traces(RNG.normal(size=(2, 900, 3)), np.arange(900.0), 200, NAMES, UNITS),
    "prior and posterior": lambda: figures.prior_posterior(
        [Marginal("gent.ln_jm", "-", RNG.normal(size=200), 0.01 * RNG.normal(size=200)) for _ in range(5)], "gent"
    ),
    "prior and posterior of a constant": lambda: figures.prior_posterior(
        [Marginal("gent.ln_jm", "-", RNG.normal(size=200), np.ones(200))], "gent"
    ),
    "convexity map": lambda: figures.convexity_map(
        np.linspace(1, 4, 20), np.linspace(0.8, 2, 10), RNG.normal(size=(20, 10)), HAT[:2] / 100, STATES, STATES, "yeoh"
    ),
    "convexity map with a domain and large values": lambda: figures.convexity_map(
        np.linspace(1, 4, 20),
        np.linspace(0.8, 2, 10),
        np.where(RNG.random((20, 10)) > 0.5, np.nan, 1e4),
        HAT[:2] / 100,
        np.full_like(STATES, np.nan),
        np.full_like(STATES, np.nan),
        "gent",
    ),
    "profiles": lambda: figures.profiles(
        HAT / 100, np.linspace(0.01, 0.035, 20) * np.ones((3, 4, 1)), np.ones((3, 4, 20)) / 100, 0.01, 0.035, "ogden"
    ),
    "profiles that do not exist": lambda: figures.profiles(
        HAT / 100, np.full((3, 4, 20), np.nan), np.full((3, 4, 20), np.nan), 0.01, 0.035, "gent"
    ),
    "break points": lambda: figures.break_points(
        ["1: 50 um", "2: 100 um"],
        np.array([20.0, 27.0]),
        [
            [Interval("Yeoh", "yeoh", 10 * HAT), Interval("Gent", "gent", np.full(3, np.nan), "no force")],
            [Interval("Yeoh", "yeoh", 1e4 * HAT), Interval("Gent", "gent", 1e-3 * HAT)],
        ],
    ),
    "forest": lambda: figures.forest(
        {n: [Interval("35.1 mm", "yeoh", HAT), Interval("91.5 mm", "yeoh", HAT + 1)] for n in NAMES},
        dict(zip(NAMES, UNITS, strict=True)),
    ),
    "reconstruction": lambda: figures.reconstruction(
        [Recovered("OP1", POINTS, {14: 0.1, 15: 0.9}), Recovered("OP2", REST, {15: 1.0})],
        [LossBar(f"Yeoh {c}", r, 1e-3 * i, c == "OP2") for i, c in enumerate(("INI", "OP2")) for r in ("OP1", "OP2")],
    ),
}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_encoded(name: str) -> None:
    made = PICTURES[name]()
    assert made.uri.startswith(f"data:image/{'svg+xml' if made.kind == 'svg' else 'png'};base64,")
    assert made.data.startswith(b"\x89PNG") if made.kind == "png" else b"<svg" in made.data
    assert 2_000 < len(made.data) < 500_000


@pytest.mark.parametrize("name", ["first look", "corner"])
def test_the_same_numbers_give_the_same_bytes(name: str) -> None:
    assert PICTURES[name]().data == PICTURES[name]().data


def test_a_material_keeps_its_colour_and_has_its_own() -> None:
    names = ["neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden"]
    assert len({colour(n) for n in names}) == 5
    assert colour("a_third_party_material") == colour("a_third_party_material")
    assert linestyle("a_third_party_material") != "-"


@pytest.mark.parametrize(
    ("name", "mathematical", "words"),
    [
        ("yeoh.c1", "$c_{1}$", "c1"),
        ("yeoh.c2_c1", "$c_{2}/c_{1}$", "c2/c1"),
        ("gent.ln_jm", r"$\ln\,J_m$", "ln Jm"),
        ("ogden.ln_gd", r"$\ln\,Gd$", "ln Gd"),
        ("noise.sd", "extra noise", "extra noise"),
        ("zero_offset.shift", "shift", "shift"),
    ],
)
def test_parameters_have_names_for_figures_and_for_text(name: str, mathematical: str, words: str) -> None:
    assert symbol(name) == mathematical
    assert spoken(name) == words
