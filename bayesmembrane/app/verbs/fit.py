"""``fit``: least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from bayesmembrane.app.options import (
    CurveOptions,
    HypothesisOptions,
    MaterialOption,
    OutputOptions,
    RangeOption,
    StoredOption,
)
from bayesmembrane.app.terminal import answer, say, status, table

if TYPE_CHECKING:
    from bayesmembrane.calibration.fit import Fit

place = 5


def verb(
    curve: CurveOptions,
    material: MaterialOption,
    beside: HypothesisOptions,
    used: RangeOption,
    stored: StoredOption,
    output: OutputOptions,
    loss: Annotated[str, typer.Option(help="euclidean (N) or weighted (by the measurement's noise).")] = "euclidean",
) -> None:
    """The least-squares parameters with their standard deviations."""
    from bayesmembrane.app import analyses

    claim = beside.with_material(material.material)
    measurement = used.of(curve.read())
    with status(f"Fitting {claim.label()}"):
        found = analyses.fit(measurement, claim, analyses.Work(output.seed, stored.folder), loss=loss)
    title = f"{claim.material.title} on {curve.shown}"
    answer(found.document, output.as_json, lambda: show(found.result, title))


def show(found: Fit, title: str) -> None:
    """Parameters, residuals and what limits them, on the terminal."""
    from bayesmembrane.words.seen import seen_by_fit

    rows = [
        [name, f"{e.value:.6g}", "-" if e.sd is None else f"{e.sd:.2g}", e.unit] for name, e in found.parameters.items()
    ]
    table(title, ["parameter", "value", "sd", "unit"], rows)
    how = seen_by_fit(found)
    rms, largest = how.loss(found.rmse_N), how.loss(found.max_N)
    say(f"Loss {how.loss(found.loss_N, 5)}, rms residual {rms}, largest {largest}.")
    say(f"The energy is {'' if found.convex else 'not '}convex where the film goes. Status: {found.status}.")
    if found.at_bound:
        say(f"No optimum inside the bounds for {', '.join(found.at_bound)}: the loss falls, or is flat, up to it.")
    if found.constrained is not None and found.constrained is not found:
        say(f"Among films that meet the convexity prior the least loss is {how.loss(found.constrained.loss_N, 5)}.")
