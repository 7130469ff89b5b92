"""One run: its parameters, residuals, draws, convexity and shapes. A part of the page for each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration import store
from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.calibration.run import Run, has_predictions
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.report.blocks import Block, Figure, Heading, Part, Text
from bayesmembrane.report.render import fragment
from bayesmembrane.report.runs import Shown, in_order, reach, read
from bayesmembrane.report.sections.base import Glance, Section, of_kind
from bayesmembrane.report.sections.run.draws import (
    Marginal,
    Walk,
    calibration_picture,
    corner_plot,
    prior_posterior,
    traces,
)
from bayesmembrane.report.sections.run.film import LiftedFilms, Plane, convexity_map, profiles, residual_picture
from bayesmembrane.report.sections.run.tables import coordinates_table, parameters_table
from bayesmembrane.words.calibration import convergence, describes, extrapolation, unknown, verdict, warnings
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed, percent, spoken_parameter
from bayesmembrane.words.sampling import convexity_sentence, sentences, smooth_sentence

MOST_CORNER = 4000  # draws in a corner plot
TRUSTED = 0.7  # tail of the weights up to which a prediction without a point can be told from one with it


class RunSection(Section):
    """Every run under a heading of its own."""

    name = "runs"
    title = "Runs"
    order = 90
    shows = Run

    def reads(self, folder: Path) -> Any | None:
        asked, ended = (folder / store.ASKED).is_file(), (folder / store.STATUS).is_file()
        if ended and not asked and (folder / store.POSTERIOR).is_file():
            raise StorageError(
                f"the run cannot be read ({store.ASKED} is missing)", str(folder), "put it back, or sample again"
            )
        return read(folder) if asked and ended else None

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        parts = self.parts(results)
        return [b for p in parts for b in (Heading(p.title), *p.blocks)]

    def parts(self, results: Sequence[Any]) -> Sequence[Part]:
        return [made() for made in self.pieces(results)]

    def pieces(self, results: Sequence[Any]) -> Sequence[Callable[[], Part]]:
        shown = [*of_kind(results, Shown), *map(read, of_kind(results, Run))]
        compared = of_kind(results, Compared)
        return [partial(_part, s, reach(s, shown), _beside(s, compared)) for s in in_order(shown)]

    def warnings(self, results: Sequence[Any]) -> Sequence[str]:
        return warnings([s.case for s in in_order(of_kind(results, Shown))])

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        shown = in_order(of_kind(results, Shown))
        return [
            Glance(
                "calibration",
                f"{s.name}, up to {reach(s, shown)}",
                f"rms residual {s.how.force(s.case.rmse)}, {verdict(s.case)}; {s.sampling.status}",
            )
            for s in shown
        ]

    def text(self, result: Any) -> str:
        """What is known without solving: of a run without predictions, what a reader must know of its draws."""
        if isinstance(result, Run) and not has_predictions(result):
            told = sentences(result.quality) or (f"{result.draws().shape[0]} draws, no predictions stored.",)
            return "\n".join([f"{spoken(result.hypothesis)}, {result.name}", *told])
        shown = read(result) if isinstance(result, Run) else result
        return "\n".join([f"{shown.name}, fitted up to {shown.end}", *_sentences(shown)])

    def html(self, result: Any) -> str:
        if isinstance(result, Run) and not has_predictions(result):
            return fragment([Text(line) for line in self.text(result).splitlines()])
        return super().html(result)


def _beside(s: Shown, compared: Sequence[Compared]) -> Compared | None:
    """The optima that belong to a run without effects."""
    fits = (c for c in compared if c.material == s.material and abs(c.end - s.digest.end) <= 1e-6 * s.digest.end)
    return None if s.hypothesis.effects else next(fits, None)


def _part(s: Shown, end: str, compared: Compared | None) -> Part:
    return Part(s.key, f"{s.name}, fitted up to {end}", tuple(_blocks(s, compared)))


def _blocks(s: Shown, compared: Compared | None) -> list[Block]:
    return [
        *map(Text, _sentences(s)),
        parameters_table(s, compared),
        _residuals(s),
        *_calibrated(s),
        _corner(s, compared),
        _priors(s) if len(s.prior) else Text("The convexity prior leaves next to no prior draws to show."),
        _traces(s),
        _map(s),
        *_profiles(s),
        coordinates_table(s),
    ]


def _sentences(s: Shown) -> list[str]:
    quality = () if s.quality is None else (convexity_sentence(s.quality.ruled_out), smooth_sentence(s.quality))
    told = [
        describes([replace(s.case, points=0)]),
        *quality,
        unknown([s.case]),
        extrapolation([s.case]),
        convergence([s.case]),
    ]
    return [t for t in told if t]


def _residuals(s: Shown) -> Figure:
    unit = "in units of the stated noise (sd)" if s.digest.has_noise else f"in {s.how.load_scale[1]}"
    return Figure(
        residual_picture(s.points, s.digest.residual, s.look),
        alt=f"Residuals of {s.name} against {s.how.travel} {unit}",
        caption=f"{s.name}: {s.how.origin} minus computed {s.how.load} {unit} against {s.how.travel_label}, with the "
        "90 % band of the posterior. The grey bands are one and two standard deviations. Residuals that follow each "
        "other with one sign say that the curve has another shape, or that the errors of the points depend on each "
        "other.",
    )


def _calibrated(s: Shown) -> list[Block]:
    if s.replicas is None:
        return []
    doubtful = int((s.replicas.shape > TRUSTED).sum())
    some = f" Of {doubtful} of the {s.replicas.shape.size} points the draws cannot quite tell it." if doubtful else ""
    return [
        Figure(
            calibration_picture(s.replicas, s.look),
            alt=f"Whether readings predicted by {s.name} spread as the measured points do",
            caption=f"{s.name}: each point is predicted by the posterior without it, noise included. Its place is the "
            "share (-) of the predicted readings that lie below it; the curve is the place minus the rank among all "
            "places (-), zero if the spread is right. Where it leaves the grey area, the noise or the form is wrong."
            f"{some}",
        )
    ]


def _corner(s: Shown, compared: Compared | None) -> Figure:
    h = s.hypothesis
    read = [s.read_as(n, u) for n, u in zip(h.natural_names, h.natural_units, strict=True)]
    units = [u for _, u in read]
    thin = s.natural[:: max(1, len(s.natural) // MOST_CORNER)] * np.array([f for f, _ in read])
    optimum = published = None
    marked = ""
    if compared is not None:
        held = compared.held_parameters or compared.parameters
        own = [n.partition(".")[2] if n.startswith(f"{s.material}.") else "" for n in h.natural_names]
        optimum = [held.get(n) for n in own]
        published = [compared.published.get(n) for n in own] if compared.published else None
        marked = (
            " Crosses: our least-squares optimum under the convexity prior, and the paper's, where they lie inside."
        )
    names = listed(f"{spoken_parameter(n)} ({u})" for n, u in zip(h.natural_names, units, strict=True))
    return Figure(
        corner_plot(thin, h.natural_names, units, s.look, optimum, published),
        alt=f"Corner plot of the parameters of {s.name}",
        caption=f"{s.name}: posterior of {names}, one by one and in pairs (regions that hold 50 % and 90 %; dashed: "
        f"5, 50 and 95 %; axes are logarithmic where a parameter spans more than a decade).{marked}",
    )


def _coordinates(s: Shown) -> str:
    return listed(f"{spoken_parameter(p.name)} ({s.read_as(p.name, p.unit)[1]})" for p in s.hypothesis.parameters)


def _priors(s: Shown) -> Figure:
    marginals = []
    for i, p in enumerate(s.hypothesis.parameters):
        factor, unit = s.read_as(p.name, p.unit)
        marginals.append(Marginal(p.name, unit, factor * s.prior[:, i], factor * s.x[:, i]))
    return Figure(
        prior_posterior(marginals, s.look),
        alt=f"Prior and posterior of the sampled coordinates of {s.name}",
        caption=f"{s.name}: what the data add to the prior, for {_coordinates(s)}; each scaled to its own maximum.",
    )


def _traces(s: Shown) -> Figure:
    p, w = s.hypothesis.parameters, s.sampling
    walk = Walk([c.name for c in p], [c.unit for c in p], w.draws, w.draws_at, w.means, w.steps_at, w.burn)
    whole = w.steps_at[0] < w.burn
    discarded = "What is shaded was discarded." if whole else f"The first {w.burn} steps were discarded."
    return Figure(
        traces(walk),
        alt=f"Draws and means of the ensembles of {s.name} against the step",
        caption=f"{s.name}: for {_coordinates(s)}, the density of each ensemble's draws, its draws (pale) and the mean "
        f"over its walkers against the step (-). {discarded} Ensembles that stay apart, or drift, have not converged.",
    )


def _map(s: Shown) -> Figure:
    d = s.digest
    shares = listed(f"{m} {percent(v)}" for m, v in d.convex.items())
    alike = s.film.rig.homogeneous
    along = "stretches" if s.how.travel == "stretch" else f"values of {s.how.travel}"
    places = f"{along} (-)" if alike else "deflections (mm)"
    states = "the state of the film" if alike else "the states that its film passes from the ring to the disc"
    plane = Plane(d.map_1, d.map_2, d.eigenvalue, d.shape_at, d.state_1, d.state_2, s.how)
    return Figure(
        convexity_map(plane, s.material),
        alt=f"Map of the convexity of {s.name} over the stretches, with the states that the film reaches",
        caption=f"{s.name}: least eigenvalue of the Hessian of the energy over G d (-) in the plane of the stretches "
        f"(-), for the draw nearest to the median curve, and {states} at several {places}. Convexity prior: "
        f"{s.hypothesis.convexity.name}; posterior draws that meet each mode: {shares}.",
    )


def _profiles(s: Shown) -> list[Block]:
    """The lifted film; a strip is as long as it is stretched, and needs no picture."""
    d, ring = s.digest, s.film.rig.ring()
    if ring is None:
        return []
    at = listed(f"{1e3 * x:.3g}" for x in d.shape_at)
    shapes = LiftedFilms(d.shape_at, d.shape_radius, d.shape_height, *ring)
    return [
        Figure(
            profiles(shapes, s.look),
            alt=f"Deformed film of {s.name} at {at} mm",
            caption=f"{s.name}: the deformed film, height (mm) against radius (mm), at deflections of {at} mm; one "
            f"thin line for each of {d.shape_radius.shape[1]} posterior draws.",
        )
    ]
