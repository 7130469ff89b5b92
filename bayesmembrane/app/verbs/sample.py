"""``sample``: the posterior."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import typer

from bayesmembrane.app.options import (
    HypothesisOptions,
    MaterialOption,
    RangeOption,
    RunOptions,
    StoredOutputOptions,
    TestsOptions,
)
from bayesmembrane.app.terminal import INTERRUPTED, answer, bars, command, note, resumable, say, table
from bayesmembrane.ground.errors import SettingsError

if TYPE_CHECKING:
    from bayesmembrane.calibration.joint.claim import Joint
    from bayesmembrane.data.project import Listed
    from bayesmembrane.physics.hypothesis import Hypothesis
    from bayesmembrane.words.units import Units

place = 6


def verb(
    curve: TestsOptions,
    material: MaterialOption,
    beside: HypothesisOptions,
    used: RangeOption,
    sampling: RunOptions,
    output: StoredOutputOptions,
) -> None:
    """The posterior, stored as a run; the same command continues one that was stopped, or goes on to a higher --ess."""
    if curve.several:
        jointly(curve.listed(used), material, beside, sampling, output)
        return
    claim, whole = beside.with_material(material.material), curve.read()
    from bayesmembrane.app import analyses  # last: what can be refused is refused at once
    from bayesmembrane.calibration.sampling.walk import Settings

    with resumable(output.folder), bars() as tell:
        tell(claim.label(), "finding starts")
        walk = Settings(ess=sampling.ess, sampler=sampling.sampler)
        work = analyses.Work(output.seed, output.folder, sampling.ess, tell, walk, sampling.fork)
        found = analyses.sample(used.of(whole), claim, work, whole=whole)
    if found.result.interrupted:
        note(f"Interrupted; the run is stored in {found.folder}. The same command resumes it: {command()}")
        raise typer.Exit(INTERRUPTED)
    title = f"{claim.material.title} on {curve.shown}"
    shown = whole.rig.shown(whole.specimen.thickness)
    answer(found.document, output.as_json, lambda: show(found.document, title, found.result.hypothesis, shown))


def jointly(
    tests: Sequence[Listed],
    material: MaterialOption,
    beside: HypothesisOptions,
    sampling: RunOptions,
    output: StoredOutputOptions,
) -> None:
    """The posterior of several tests."""
    if sampling.fork is not None:
        raise SettingsError("a joint run begins on its own", "--fork", "leave it out")
    if sampling.sampler != "auto":
        raise SettingsError("emcee's ensembles walk over several tests anyway", "--sampler", "leave it out")
    claim = beside.joint(material.material, tests)
    from bayesmembrane.app import analyses  # last: what can be refused is refused at once

    with resumable(output.folder), bars() as tell:
        tell(claim.label(), "finding starts")
        found = analyses.sample_joint(claim, analyses.Work(output.seed, output.folder, sampling.ess, tell))
    if found.result.interrupted:
        note(f"Interrupted; the run is stored in {found.folder}. The same command resumes it: {command()}")
        raise typer.Exit(INTERRUPTED)
    title = f"{claim.material.title} on {len(claim.parts)} tests, thinnest film {1e6 * claim.thickness:.4g} um"
    answer(found.document, output.as_json, lambda: show(found.document, title, claim))


def show(run: dict[str, Any], title: str, claim: Hypothesis | Joint, shown: Units = MappingProxyType({})) -> None:
    """Parameters in the units in which they are ``shown``, and how well they were sampled, on the terminal."""
    rows = []
    for p, (name, v) in zip(claim.natural_parameters, run["posterior"].items(), strict=True):
        factor, unit = shown.get(p.unit, (1.0, p.unit))
        mean, sd, low, high = (factor * x for x in (v["mean"], v["sd"], *v["hdi_94"]))
        rows.append([name, f"{mean:.5g}", f"{sd:.2g}", f"{low:.5g} to {high:.5g}", unit])
    table(title, ["parameter", "mean", "sd", "94 % interval", "unit"], rows)
    say(f"ESS {run['ess_bulk']:.0f}, R-hat {run['r_hat']:.3f}, {run['evaluations']} curves, {run['seconds']:.1f} s.")
    if (found := run.get("importance")) is not None:
        say(f"ln Z {found['log_evidence']:.2f} +- {found['log_evidence_sd']:.2f}, from the weights of all proposals.")
    for sentence in run["sentences"]:
        say(sentence)
    say(f"Stored in {run['stored']}; bayesmembrane report {run['stored']} shows it.")
