"""Every picture can be drawn, twice the same, whatever is missing."""

import io
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import COLOURS, DPI, MOST_SVG, Interval, Measured, encoded, new_figure
from bayesmembrane.report.runs import Replicas
from bayesmembrane.report.sections.break_points import break_picture
from bayesmembrane.report.sections.calibrations import forest_picture
from bayesmembrane.report.sections.curves import Fitted, Panel, first_look
from bayesmembrane.report.sections.reconstruction import LossBar, Recovered, reconstruction_picture
from bayesmembrane.report.sections.run import draws as draws_of_a_run
from bayesmembrane.report.sections.run.draws import (
    Marginal,
    Walk,
    calibration_picture,
    corner_plot,
    prior_posterior,
    traces,
)
from bayesmembrane.report.sections.run.film import LiftedFilms, Plane, convexity_map, profiles, residual_picture

N, G = 9, 30
X = np.linspace(0.002, 0.03, N)
GRID = np.linspace(0.001, 0.05, G)
RNG = np.random.default_rng(0)


def curve(material: str, residual: float = 1e-3) -> Fitted:
    force = 40 * GRID * np.array([0.9, 1.0, 1.1])[:, None]
    return Fitted(material, GRID, force, GRID > 0.03, residual * np.ones((3, N)), material)


POINTS = Measured(X, 40 * X, np.full(N, 2e-3))
BARE = Measured(X, 40 * X)
REST = Measured(X + 0.03, 40 * X + 1.2)
DRAWS = RNG.normal(size=(500, 3)) * [1.0, 0.1, 1e-3] + [8.0, -0.6, 0.01]
NAMES, UNITS = ("yeoh.c1", "yeoh.c2", "noise.sd"), ("N/m", "N/m", "N")
STATES = np.linspace(1.0, 3.0, 40) * np.ones((2, 1))
HAT = np.array([1.0, 2.0, 3.0])


def walk(draws: np.ndarray) -> Walk:
    at = np.linspace(200, 900, draws.shape[1])
    return Walk(NAMES, UNITS, draws, at, RNG.normal(size=(2, 900, 3)), np.arange(900.0), 200)


def replicas(points: int) -> Replicas:
    readings = RNG.normal(size=(points, 500))
    weights = np.full(readings.shape, -np.log(500.0))
    return Replicas(RNG.normal(size=points), readings, weights, np.zeros(points))


PICTURES: dict[str, Callable[[], Picture]] = {
    "first look": lambda: first_look([Panel(POINTS, (curve("yeoh"), curve("gent")), REST, "up to 30 mm")]),
    "first look of two ranges, residuals far apart": lambda: first_look(
        [Panel(POINTS, (curve("yeoh"), curve("gent", 2.0))), Panel(BARE, (curve("a_third_party_material"),))]
    ),
    "first look without any force": lambda: first_look(
        [Panel(BARE, (Fitted("gent", GRID, np.full((3, G), np.nan), GRID > 0.03, np.full((3, N), np.nan), "Gent"),))]
    ),
    "residuals": lambda: residual_picture(POINTS, 1e-3 * np.ones((3, N)), "yeoh"),
    "residuals without noise": lambda: residual_picture(BARE, np.zeros((3, N)), "yeoh"),
    "corner": lambda: corner_plot(DRAWS, NAMES, UNITS, "yeoh", [8.0, -0.6, None], [7.9, 99.0, None]),
    "corner of one parameter that never moved": lambda: corner_plot(
        np.full((50, 1), 3.0), ("gent.c1",), ("N/m",), "gent"
    ),
    "traces": lambda: traces(walk(RNG.normal(size=(2, 300, 3)))),
    "traces of draws that never moved": lambda: traces(walk(np.ones((2, 30, 3)))),
    "places among predicted readings": lambda: calibration_picture(replicas(12), "yeoh"),
    "places of a long curve": lambda: calibration_picture(replicas(400), "gent"),
    "prior and posterior": lambda: prior_posterior(
        [Marginal("gent.ln_jm", "-", RNG.normal(size=200), 0.01 * RNG.normal(size=200)) for _ in range(5)], "gent"
    ),
    "prior and posterior of a constant": lambda: prior_posterior(
        [Marginal("gent.ln_jm", "-", RNG.normal(size=200), np.ones(200))], "gent"
    ),
    "convexity map": lambda: convexity_map(
        Plane(
            np.linspace(1, 4, 20),
            np.linspace(0.8, 2, 10),
            RNG.normal(size=(20, 10)),
            HAT[:2] / 100,
            STATES,
            STATES,
        ),
        "yeoh",
    ),
    "convexity map with a domain and large values": lambda: convexity_map(
        Plane(
            np.linspace(1, 4, 20),
            np.linspace(0.8, 2, 10),
            np.where(RNG.random((20, 10)) > 0.5, np.nan, 1e4),
            HAT[:2] / 100,
            np.full_like(STATES, np.nan),
            np.full_like(STATES, np.nan),
        ),
        "gent",
    ),
    "profiles": lambda: profiles(
        LiftedFilms(
            HAT / 100,
            np.linspace(0.01, 0.035, 20) * np.ones((3, 4, 1)),
            np.ones((3, 4, 20)) / 100,
            0.01,
            0.035,
        ),
        "ogden",
    ),
    "profiles that do not exist": lambda: profiles(
        LiftedFilms(
            HAT / 100,
            np.full((3, 4, 20), np.nan),
            np.full((3, 4, 20), np.nan),
            0.01,
            0.035,
        ),
        "gent",
    ),
    "break points": lambda: break_picture(
        ["1: 50 um", "2: 100 um"],
        np.array([20.0, 27.0]),
        [
            [Interval("Yeoh", "yeoh", 10 * HAT), Interval("Gent", "gent", np.full(3, np.nan), "no force")],
            [Interval("Yeoh", "yeoh", 1e4 * HAT), Interval("Gent", "gent", 1e-3 * HAT)],
        ],
    ),
    "forest": lambda: forest_picture(
        {n: [Interval("35.1 mm", "yeoh", HAT), Interval("91.5 mm", "yeoh", HAT + 1)] for n in NAMES},
        dict(zip(NAMES, UNITS, strict=True)),
    ),
    "reconstruction": lambda: reconstruction_picture(
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
    first = PICTURES[name]()
    for _ in range(3):
        assert PICTURES[name]().data == first.data


def test_places_among_readings_are_drawn_twice_the_same() -> None:
    same = replicas(12)
    assert calibration_picture(same, "yeoh").data == calibration_picture(same, "yeoh").data


def drawn(points: int, colours: int) -> Figure:
    """A cloud over a field of so many colours."""
    figure = new_figure(3.0)
    ax = figure.subplots()
    ax.imshow(np.linspace(0, 1, colours)[None, :], aspect="auto", cmap="viridis", extent=(0.0, 1.0, 0.0, 1.0))
    ax.plot(*np.random.default_rng(1).uniform(size=(2, points)), "o", markersize=2)
    return figure


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def test_a_picture_in_few_colours_looks_like_the_one_that_was_drawn() -> None:
    figure, whole = drawn(50, 2000), io.BytesIO()
    made = encoded(figure, "png")
    figure.savefig(whole, format="png", dpi=DPI)
    assert len(np.unique(pixels(made.data).reshape(-1, 3), axis=0)) <= COLOURS
    assert np.max(np.abs(pixels(made.data) - pixels(whole.getvalue()))) <= 16  # of 255
    assert len(made.data) < 0.7 * len(whole.getvalue())


@pytest.mark.parametrize(("points", "kind"), [(20, "svg"), (5000, "png")])
def test_a_drawing_is_a_cloud_where_it_has_many_marks(points: int, kind: str) -> None:
    made = encoded(drawn(points, 2), "svg")
    assert made.kind == kind
    assert len(made.data) <= MOST_SVG


@pytest.mark.parametrize("count", [4, 7, 8, 12, 18])
def test_names_of_many_panels_stand_apart_and_on_the_page(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    made = list[Any]()
    monkeypatch.setattr(draws_of_a_run, "encoded", lambda figure, kind: made.append(figure))
    names = [("compliance", "extra noise")[i % 2] for i in range(count)]
    corner_plot(np.random.default_rng(3).standard_normal((200, count)), names, ["MPa"] * count, "yeoh")
    figure = made[0]
    figure.draw_without_rendering()
    axes = np.array(figure.axes).reshape(count, count)
    boxes = [axes[i, 0].yaxis.label.get_window_extent() for i in range(1, count)]
    assert all(not a.overlaps(b) for a, b in pairwise(boxes))
    under = [axes[-1, i].xaxis.label for i in range(count)]
    starts = [t.get_window_extent().x1 for t in under]
    turned = [t.get_rotation() for t in under]
    assert np.min(np.diff(starts)) > 0.3 * figure.dpi
    assert all(r == 45 for r in turned) or all(
        not a.get_window_extent().overlaps(b.get_window_extent()) for a, b in pairwise(under)
    )
    inside = figure.bbox.padded(1)
    assert all(inside.x0 <= b.x0 and inside.y0 <= b.y0 for b in (*boxes, *(t.get_window_extent() for t in under)))
