"""``fit``: least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from bayesmembrane.app.options import (
    HypothesisOptions,
    MaterialOption,
    RangeOption,
    StoredOutputOptions,
    TestsOptions,
)
from bayesmembrane.app.terminal import answer, say, status, table

if TYPE_CHECKING:
    from bayesmembrane.calibration.fit import Fit
    from bayesmembrane.calibration.joint.fit import JointFit

place = 5


def verb(
    curve: TestsOptions,
    material: MaterialOption,
    beside: HypothesisOptions,
    used: RangeOption,
    output: StoredOutputOptions,
    loss: Annotated[str, typer.Option(help="euclidean (N) or weighted (by the measurement's noise).")] = "euclidean",
) -> None:
    """The least-squares parameters with their standard deviations."""
    if curve.several:
        together = beside.joint(material.material, curve.listed(used))
        from bayesmembrane.app import analyses  # last: what can be refused is refused at once

        with status(f"Fitting {together.label()} on {len(together.parts)} tests"):
            both = analyses.fit_joint(together, analyses.Work(output.seed, output.folder))
        answer(both.document, output.as_json, lambda: show_jointly(both.result))
        return
    claim = beside.with_material(material.material)
    measurement = used.of(curve.read())
    from bayesmembrane.app import analyses  # last: what can be refused is refused at once

    with status(f"Fitting {claim.label()}"):
        found = analyses.fit(measurement, claim, analyses.Work(output.seed, output.folder), loss=loss)
    title = f"{claim.material.title} on {curve.shown}"
    answer(found.document, output.as_json, lambda: show(found.result, title))


def show_jointly(found: JointFit) -> None:
    """Parameters, and how well every test is fitted, on the terminal."""
    from bayesmembrane.words.joint import fit_sentence

    units = {p.name.removeprefix(f"{found.joint.material.name}."): p.unit for p in found.joint.natural_parameters}
    rows = [
        [n, f"{v:.6g}", "-" if sd is None else f"{sd:.2g}", units.get(n, "")] for n, (v, sd) in found.parameters.items()
    ]
    table(f"{found.joint.material.title} on {len(found.parts)} tests", ["parameter", "value", "sd", "unit"], rows)
    say(f"Membrane parameters are those of the thinnest film, {1e6 * found.joint.thickness:.4g} um.")
    say(fit_sentence(found))
    say(f"The energy is {'' if found.convex else 'not '}convex where the films go.")
    if found.at_bound:
        say(f"No optimum inside the bounds for {', '.join(found.at_bound)}.")


def show(found: Fit, title: str) -> None:
    """Parameters, residuals and what limits them, on the terminal."""
    from bayesmembrane.words.elastomer import stiffness_sentence
    from bayesmembrane.words.seen import seen_by_fit

    rows = [
        [name, f"{e.value:.6g}", "-" if e.sd is None else f"{e.sd:.2g}", e.unit] for name, e in found.parameters.items()
    ]
    table(title, ["parameter", "value", "sd", "unit"], rows)
    how = seen_by_fit(found)
    rms, largest = how.loss(found.rmse_N), how.loss(found.max_N)
    say(f"Loss {how.loss(found.loss_N, 5)}, rms residual {rms}, largest {largest}.")
    say(f"The energy is {'' if found.convex else 'not '}convex where the film goes. Status: {found.status}.")
    if doubt := stiffness_sentence(found.shear_modulus):
        say(doubt)
    if found.at_bound:
        say(f"No optimum inside the bounds for {', '.join(found.at_bound)}: the loss falls, or is flat, up to it.")
    if found.constrained is not None and found.constrained is not found:
        say(f"Among films that meet the convexity prior the least loss is {how.loss(found.constrained.loss_N, 5)}.")
