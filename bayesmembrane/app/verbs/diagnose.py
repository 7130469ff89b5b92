"""``diagnose``: what the model misses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bayesmembrane.app.options import (
    HypothesisOptions,
    PreferredMaterialOption,
    QuickOption,
    RangeOption,
    StoredOutputOptions,
    TestsOptions,
)
from bayesmembrane.app.terminal import answer, note, say, status, table

if TYPE_CHECKING:
    from bayesmembrane.data.measurement import Measurement
    from bayesmembrane.diagnosis.joint.diagnose import JointDiagnosis

place = 9

CANDIDATES = 8
WHEN = {
    "before": "before",
    "after": "after",
    "heldout_before": "held out, before",
    "heldout_after": "held out, after",
}


def verb(
    curve: TestsOptions,
    material: PreferredMaterialOption,
    beside: HypothesisOptions,
    used: RangeOption,
    how: QuickOption,
    output: StoredOutputOptions,
) -> None:
    """How probable it is that nothing, an effect, another energy or something foreign is behind the curve."""
    from bayesmembrane.words.language import listed

    if curve.several:
        together = beside.joint(material.name, curve.listed(used))
        from bayesmembrane.app import analyses  # last: what can be refused is refused at once

        with status(f"Diagnosing {listed(together.labels)} together") as tell:
            work = analyses.Work(output.seed, output.folder, tell=lambda _, text: tell(text))
            both = analyses.diagnose_joint(together, work, declared=material.declared, quick=how.quick)
        answer(both.document, output.as_json, lambda: show_jointly(both.document, both.result))
        return
    claim = beside.with_material(material.name)
    measurement = used.of(curve.read())
    from bayesmembrane.app import analyses  # last: what can be refused is refused at once
    from bayesmembrane.diagnosis.explanation.case import Question

    question = Question(claim, material.declared, how.quick)
    say_thinning(measurement)
    with status(f"Diagnosing {claim.label() if material.declared else 'the curve'}") as tell:
        work = analyses.Work(output.seed, output.folder, tell=lambda _, text: tell(text))
        found = analyses.diagnose(measurement, question, work)
    answer(found.document, output.as_json, lambda: show(found.document, measurement))


def show_jointly(document: dict[str, Any], found: JointDiagnosis) -> None:
    """A diagnosis of several tests on the terminal."""
    from bayesmembrane.words.seen import seen

    say(document["sentence"])
    rows = [
        [r["effect"], r["material"], f"{r['probability']:.3f}", f"{r['log_bayes_factor']:.1f}"]
        for r in document["ranking"][:CANDIDATES]
    ]
    table("Candidates", ["effects", "energy", "probability", "ln Bayes factor"], rows)
    errors = []
    for t in found.tests:
        how = seen(t.measurement)
        errors.append([t.label, how.error(t.before.rmse_N), how.error(t.after.rmse_N), f"{t.after.reduced_chi2:.2f}"])
    table("Residuals, root mean square", ["test", "before", "after", "reduced chi-square after"], errors)


def say_thinning(measurement: Measurement) -> None:
    """On stderr, before the work: that not all readings will be used."""
    from bayesmembrane.data.thinning import thinned
    from bayesmembrane.diagnosis.result import thinning
    from bayesmembrane.words.diagnosis import thinning_sentence

    if (found := thinning(measurement, thinned(measurement))) is not None:
        note(thinning_sentence(found).replace("were diagnosed", "are diagnosed"))


def _row_name(row: dict[str, Any], several: bool) -> str:
    """Effects, which lines may break between, and the energy where there are ``several``."""
    effects = str(row["effect"]).replace("+", " + ")
    return f"{effects} with {row['material']}" if several and effects != row["material"] else effects


def show(document: dict[str, Any], measurement: Measurement) -> None:
    """A diagnosis on the terminal, in the units of the rig."""
    from bayesmembrane.words.sizes import parameter_in_words

    shown = measurement.rig.shown(measurement.specimen.thickness)
    factor, unit = shown["N"]
    say(document["sentence"])
    several = len({r["material"] for r in document["ranking"]}) > 1
    rows = [
        [
            _row_name(r, several),
            f"{100 * r['probability']:.1f} %",
            f"{r['log_bayes_factor']:.1f}",
            f"{100 * r['unexplained']:.0f} %",
            ", ".join(parameter_in_words(k, v, shown) for k, v in r["parameters"].items()),
        ]
        for r in document["ranking"][:CANDIDATES]
    ]
    table("Candidates", ["effect or energy", "probability", "ln Bayes factor", "unexplained", "parameters"], rows)
    errors = [
        [WHEN[when], f"{factor * e['rmse_N']:.3g}", f"{factor * e['max_N']:.3g}", f"{e['reduced_chi2']:.2f}"]
        for when, e in document["error"].items()
        if isinstance(e, dict)
    ]
    table("Errors", ["", f"root mean square, {unit}", f"largest, {unit}", "reduced chi-square"], errors)
    if document["error"]["heldout_before"] is not None:
        say("Held-out points are predicted from the others, the form error going on from there.")
    for sentence in document["absorbed"]:
        say(sentence)
    for step in document["next_measurements"]:
        say(step["sentence"])
