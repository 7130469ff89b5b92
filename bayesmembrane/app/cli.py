"""The command line: thin verbs over the library.

The library is imported inside the verbs: numba and arviz take seconds that ``--help`` should not.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesmembrane.app.terminal import answer, lines, log, numbers, out, table
from bayesmembrane.ground.errors import BayesmembraneError, SettingsError

if TYPE_CHECKING:
    from bayesmembrane.calibration.sampling.walk import Progress
    from bayesmembrane.data.measurement import Measurement
    from bayesmembrane.physics.hypothesis import Hypothesis

# The matrices are small: threads inside BLAS only get into each other's way. Set before NumPy is imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="From a measured force curve to a calibrated film, with its uncertainty.",
)

Material = Annotated[str, typer.Option("--material", help="neo_hookean, mooney_rivlin, gent, yeoh or ogden.")]
Parameters = Annotated[
    str,
    typer.Option("--parameters", help="Membrane parameters, N/m (exponents and Gent's c2 pure numbers), by commas."),
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout; logs go to stderr.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of every random number.")]
Curve = Annotated[Path, typer.Argument(help="The measured curve: CSV whose header names carry units.", metavar="CURVE")]
SpecimenFile = Annotated[Path, typer.Option("--specimen", help="TOML with film, rig and noise.")]
Effects = Annotated[str, typer.Option("--effects", help="Physical effects beside the material, by commas.")]
MaxDeflection = Annotated[float | None, typer.Option("--max-deflection-mm", help="Use the curve up to here only, mm.")]
Convexity = Annotated[str, typer.Option("--convexity", help="Convexity prior: reached, box, elliptic or none.")]
Noise = Annotated[str, typer.Option("--noise", help="Noise model: white, ar1 or ar1_readings.")]
Ess = Annotated[float, typer.Option("--ess", help="Wanted effective sample size of the worst parameter.")]
Runs = Annotated[Path, typer.Option("--out", help="Folder of the runs.")]


@app.command()
def force(
    material: Material,
    parameters: Parameters,
    deflection_mm: Annotated[str, typer.Option("--deflection-mm", help="Deflections, mm: 1,10,35.1")],
    prestretch: Annotated[float, typer.Option(help="Equibiaxial stretch of the film before it was clamped.")] = 1.0,
    inner_radius_mm: Annotated[float, typer.Option(help="Radius of the disc, mm.")] = 10.0,
    outer_radius_mm: Annotated[float, typer.Option(help="Radius of the ring, mm.")] = 35.0,
    solver: Annotated[str, typer.Option(help="ritz or shooting.")] = "ritz",
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The force at given deflections for given parameters, or the reason why there is none."""
    import numpy as np

    from bayesmembrane.ground.registry import material as named
    from bayesmembrane.physics.mechanics import Note, Status, request, solve

    kind = named(material)
    film = kind.from_vector(numbers(parameters, "--parameters"))
    where = numbers(deflection_mm, "--deflection-mm")
    radii = inner_radius_mm * 1e-3, outer_radius_mm * 1e-3
    curves = solve(request(kind, film.vector, np.array(where) * 1e-3, *radii, prestretch=prestretch, solver=solver))
    states = [Status(int(s)) for s in curves.status[0]]
    notes = [(Note(int(n)).name or "").lower() if n else "" for n in curves.note[0]]
    document = {
        "material": kind.name,
        "deflection_mm": where,
        "force_N": curves.force[0],
        "status": [s.sentence for s in states],
        "max_stretch": curves.max_stretch[0],
        "notes": notes,
    }
    rows = zip(where, curves.force[0], curves.max_stretch[0], states, notes, strict=True)
    cells = [[f"{d:g}", f"{f:.6g}", f"{m:.4g}", f"{s.sentence} {n}".strip()] for d, f, m, s, n in rows]
    header = ["deflection, mm", "force, N", "largest stretch", "status"]
    answer(document, as_json, lambda: table(f"{kind.title}: {film}", header, cells))


@app.command()
def convexity(
    material: Material,
    parameters: Parameters,
    box: Annotated[str, typer.Option(help="Stretches between which W(l1, l2) must be convex.")] = "1,8",
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """Whether an energy is convex in the stretches on a box, by what margin, and where it is worst."""
    from bayesmembrane.ground.registry import material as named
    from bayesmembrane.physics.mechanics.convexity import box_convexity, box_ellipticity

    edges = numbers(box, "--box")
    if len(edges) != 2:
        raise SettingsError(
            f"a box has two edges, and {len(edges)} were given", where="--box", remedy="write --box 1,8"
        )
    film = named(material).from_vector(numbers(parameters, "--parameters"))
    found, elliptic = box_convexity(film, *edges), box_ellipticity(film, *edges)
    document = {
        "material": film.name,
        "convex": found.convex,
        "margin": found.margin,
        "worst": dict(zip(("l1", "l2"), found.worst, strict=True)),
        "elliptic": elliptic.elliptic,
        "elliptic_margin": elliptic.margin,
        "box": edges,
    }
    l1, l2 = found.worst
    sentence = (
        f"{film.title} with {parameters} is {'' if found.convex else 'not '}convex on [{edges[0]:g}, {edges[1]:g}]^2: "
        f"least eigenvalue of the Hessian {found.margin:.4g} G d, at stretches ({l1:.4g}, {l2:.4g}); "
        f"it is {'' if elliptic.elliptic else 'not '}elliptic there (least of P11, P22: {elliptic.margin:.4g} G d)."
    )
    answer(document, as_json, lambda: out.print(sentence))


@app.command("import")
def import_(
    export: Annotated[Path, typer.Argument(help="The file that the machine wrote.", metavar="EXPORT")],
    out_file: Annotated[Path, typer.Option("--out", help="Where the curve goes; a TOML is written beside it.")] = Path(
        "curve.csv"
    ),
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The curve and the specimen file from another program's export; refuses what it cannot read."""
    from bayesmembrane.data.importers.base import import_export

    written = import_export(export, out_file)
    for note in written.notes:
        log.print(f"{export}: {note}.", markup=False)
    document = {
        "curve": str(written.curve),
        "specimen": str(written.specimen),
        "importer": written.importer,
        "n_points": written.n_points,
    }
    sentence = (
        f"{written.n_points} points read as {written.importer}, written to {written.curve}; "
        f"complete {written.specimen} with the film and the rig before using them."
    )
    answer(document, as_json, lambda: out.print(sentence))


@app.command()
def reconstruct(
    out_folder: Annotated[
        Path | None, typer.Option("--out", help="Also write curve, TOML and covariance here.")
    ] = None,
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The measured curve behind the paper's published losses, and which printed numbers contradict the others."""
    from bayesmembrane.data.published import read_published_table
    from bayesmembrane.reconstruction.files import write_reconstruction
    from bayesmembrane.reconstruction.reconstruct import reconstruct as run
    from bayesmembrane.words.reconstruction import document as words

    printed = read_published_table()
    with log.status("Locating the curve from 30 losses"):
        found = run(printed, seed=seed)
    document = words(found)
    if out_folder is not None:
        document["files"] = [str(f) for f in write_reconstruction(found, printed, out_folder)]

    def show() -> None:
        for name in ("OP1", "OP2"):
            part = document[name]
            rows = zip(part["deflection_mm"], part["force_N"], part["sd_N"], strict=True)
            cells = [[f"{d:.2f}", f"{f:.4f}", f"{s:.4f}"] for d, f, s in rows]
            first, counts = part["first_mm"], part["n_points"]
            likely = max(counts, key=counts.get)
            title = (
                f"{name}: {likely} points (probability {counts[likely]:.3f}), "
                f"the first at {first['mean']:.2f} +- {first['sd']:.2f} mm"
            )
            table(title, ["deflection, mm", "force, N", "sd, N"], cells)
        for row in document["suspect_rows"]:
            changes = "; ".join(f"{c['entry']}: {c['printed']} -> {c['consistent']}" for c in row["corrections"])
            out.print(f"{row['material']}, {row['column']}: {row['reason']} Consistent would be {changes}.")

    answer(document, as_json, show)


@app.command()
def fit(
    curve: Curve,
    specimen: SpecimenFile,
    material: Material,
    effects: Effects = "",
    max_deflection_mm: MaxDeflection = None,
    loss: Annotated[str, typer.Option(help="euclidean (N) or weighted (by the measurement's noise).")] = "euclidean",
    convexity: Convexity = "reached",
    noise: Noise = "white",
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The least-squares parameters with their standard deviations."""
    from bayesmembrane.calibration.fit import fit as run

    measurement, claim = _asked(curve, specimen, material, effects, max_deflection_mm, convexity, noise)
    with log.status(f"Fitting {claim.label()}"):
        found = run(measurement, claim, loss=loss, seed=seed)

    def show() -> None:
        rows = [
            [name, f"{e.value:.6g}", "-" if e.sd is None else f"{e.sd:.2g}", e.unit]
            for name, e in found.parameters.items()
        ]
        table(f"{claim.material.title} on {curve}", ["parameter", "value", "sd", "unit"], rows)
        out.print(f"Loss {found.loss_N:.5g} N, rms residual {found.rmse_N:.4g} N, largest {found.max_N:.4g} N.")
        out.print(f"The energy is {'' if found.convex else 'not '}convex where the film goes. Status: {found.status}.")
        if found.at_bound:
            out.print(
                f"No optimum inside the bounds for {', '.join(found.at_bound)}: the loss falls, or is flat, up to it."
            )
        if found.constrained is not None and found.constrained is not found:
            out.print(f"Among films that meet the convexity prior the least loss is {found.constrained.loss_N:.5g} N.")

    answer(found.summary(), as_json, show)


@app.command()
def sample(
    curve: Curve,
    specimen: SpecimenFile,
    material: Material,
    effects: Effects = "",
    max_deflection_mm: MaxDeflection = None,
    convexity: Convexity = "reached",
    noise: Noise = "white",
    ess: Ess = 1000.0,
    out_folder: Runs = Path("chains"),
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """The posterior, stored as a run; the same command continues a run that was interrupted."""
    from bayesmembrane.calibration.run import sample as run
    from bayesmembrane.data.measurement import read_measurement
    from bayesmembrane.physics.cache import CachedSolver
    from bayesmembrane.words.sampling import document

    measurement, claim = _asked(curve, specimen, material, effects, max_deflection_mm, convexity, noise)
    cache, rest = CachedSolver(out_folder / "curves"), None
    if max_deflection_mm is not None and measurement.full_range > measurement.deflection.max():
        whole = read_measurement(curve, specimen)
        rest = whole.select(whole.deflection > measurement.deflection.max())
    with _bar(claim.label()) as tell:
        done = run(measurement, claim, seed=seed, out=out_folder, ess=ess, progress=tell, solve=cache, rest=rest)
    if done.interrupted:
        log.print(f"Interrupted; the run is stored in {done.path}. The same command resumes it: {_command()}")
        raise typer.Exit(130)
    told = document(done)

    def show() -> None:
        rows = [
            [name, f"{v['mean']:.5g}", f"{v['sd']:.2g}", f"{v['hdi_94'][0]:.5g} to {v['hdi_94'][1]:.5g}"]
            for name, v in told["posterior"].items()
        ]
        table(f"{claim.material.title} on {curve}", ["parameter", "mean", "sd", "94 % interval"], rows)
        spent = f"{told['evaluations']} curves, {told['seconds']:.0f} s"
        out.print(f"ESS {told['ess_bulk']:.0f}, R-hat {told['r_hat']:.3f}, {spent}.")
        for sentence in told["sentences"]:
            out.print(sentence)
        out.print(f"Stored in {done.path}; bayesmembrane report {done.path} shows it.")

    answer(told, as_json, show)


@app.command()
def valleys(
    curve: Curve,
    specimen: SpecimenFile,
    material: Material,
    effects: Effects = "",
    ranges_mm: Annotated[
        str, typer.Option("--ranges-mm", help="Ends of the ranges to compare, mm: 35.1,91.5. The whole curve without.")
    ] = "",
    loss_rise: Annotated[float, typer.Option(help="A valley fits within this part of the least loss.")] = 0.1,
    convexity: Convexity = "reached",
    noise: Noise = "white",
    out_folder: Annotated[Path | None, typer.Option("--out", help="Also write the answer and a figure here.")] = None,
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """How long the valley of the loss is, over one range or several, whether they meet, and what to measure next.

    With --effects also the valley without them, and how far the two lie apart.
    """
    from bayesmembrane.report.sections.valleys import write_valleys
    from bayesmembrane.report.sections.valleys.tables import valley_table
    from bayesmembrane.valleys.beside import Beside, valleys_beside
    from bayesmembrane.valleys.follow import valleys as run
    from bayesmembrane.words import valleys as words

    measurement, claim = _asked(curve, specimen, material, effects, None, convexity, noise)
    ends = [1e-3 * end for end in numbers(ranges_mm, "--ranges-mm")] if ranges_mm else []
    with log.status(f"Following the valleys of {claim.label()}"):
        how = valleys_beside if claim.effects else run
        found = how(measurement, claim, ends, rise=loss_rise, seed=seed)
    document = words.document(found)
    parts = [found.without, found.added] if isinstance(found, Beside) else [found]
    if out_folder is not None:
        document["files"] = [str(f) for f in write_valleys(found, out_folder)]

    def show() -> None:
        whole = valley_table(parts)
        shown = [
            i
            for i, c in enumerate(whole.columns)
            if c.key in ("material", "end_mm", "loss_N", "length", "unit", "condition_number", "open")
        ]
        table(
            f"Valleys of {claim.material.title} on {curve}",
            [whole.columns[i].head for i in shown],
            [[row[i] for i in shown] for row in whole.cells()],
        )
        for sentence in words.sentences(found):
            out.print(sentence)
        for valley in parts[-1].ranges:
            rows = [[t.test, f"{100 * t.reduction:.0f} %"] for t in valley.next_tests[:5]]
            table(f"What to measure next, from data up to {1e3 * valley.end:.4g} mm", ["test", "shorter by"], rows)

    answer(document, as_json, show)


# What a terminal of 80 characters has room for; a report shows all columns.
COMPARED = {
    "evidence": ("hypothesis", "nested", "nested_sd", "bridge", "bridge_sd", "probability", "mass"),
    "prediction": ("hypothesis", "elpd_loo", "loo_se", "refits", "held_rmse"),
}


@app.command()
def compare(
    curve: Curve,
    specimen: SpecimenFile,
    materials: Annotated[str, typer.Option("--materials", help="By commas; yeoh+prestretch adds an effect to one.")],
    effects: Annotated[str, typer.Option("--effects", help="Physical effects beside every material, by commas.")] = "",
    max_deflection_mm: MaxDeflection = None,
    ranges_mm: Annotated[
        str, typer.Option("--ranges-mm", help="Compare on several ranges, by their ends in mm: 35.1,91.5.")
    ] = "",
    convexity: Convexity = "reached",
    noise: Noise = "white",
    ess: Ess = 1000.0,
    out_folder: Runs = Path("chains"),
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """Which materials the data support, by two estimators of the evidence, with prediction beside it."""
    from bayesmembrane.comparison.compare import claimed, compare_ranges, ranges_of
    from bayesmembrane.comparison.jobs import Judging
    from bayesmembrane.report.sections.evidence.tables import evidence_table
    from bayesmembrane.words.comparison import document_of_ranges, remark, sentences

    claims = claimed(materials, effects, noise, convexity)
    if ranges_mm and max_deflection_mm is not None:
        raise SettingsError("the range is given twice", "--ranges-mm, --max-deflection-mm", "give one of them")
    ends = numbers(ranges_mm, "--ranges-mm") if ranges_mm else [max_deflection_mm] if max_deflection_mm else []
    ranges = ranges_of(_measurement(curve, specimen), [1e-3 * end for end in ends])
    try:
        with lines() as tell:
            found = compare_ranges(ranges, claims, Judging(seed, ess, out=out_folder), progress=tell)
    except KeyboardInterrupt:
        log.print(f"Interrupted; what is finished is stored in {out_folder}. The same command resumes it: {_command()}")
        raise typer.Exit(130) from None
    document = document_of_ranges(found)

    def show() -> None:
        for name, comparison in found.items():
            shown = evidence_table({name: comparison})
            for text, part in COMPARED.items():
                columns = [i for i, c in enumerate(shown.columns) if c.key in part]
                rows = [[row[i] for i in columns] for row in shown.cells()]
                table(f"{name}: {text}", [shown.columns[i].head for i in columns], rows)
            for row in comparison.rows:
                if not row.fitted:
                    out.print(f"{row.label}: {remark(row)}")
            for sentence in sentences(comparison):
                out.print(sentence)

    answer(document, as_json, show)


@app.command()
def diagnose(
    curve: Curve,
    specimen: SpecimenFile,
    material: Material,
    effects: Effects = "",
    max_deflection_mm: MaxDeflection = None,
    convexity: Convexity = "reached",
    noise: Noise = "white",
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """Whether the model misses something, which effect or energy explains it, or that this cannot be told."""
    from bayesmembrane.diagnosis.diagnose import diagnose as run
    from bayesmembrane.words.diagnosis import document as words

    measurement, claim = _asked(curve, specimen, material, effects, max_deflection_mm, convexity, noise)
    _say_thinning(measurement)
    with log.status(f"Diagnosing {claim.label()}") as status:
        found = run(measurement, claim, seed=seed, tell=status.update)
    document = words(found)
    answer(document, as_json, lambda: _shown(document, measurement))


@app.command()
def loop(
    curve: Curve,
    specimen: SpecimenFile,
    material: Material,
    effects: Effects = "",
    max_deflection_mm: MaxDeflection = None,
    convexity: Convexity = "reached",
    noise: Annotated[
        str, typer.Option(help="A noise model, or auto: correlated if neighbouring readings turn out to be so.")
    ] = "auto",
    ess: Ess = 1000.0,
    out_folder: Runs = Path("chains"),
    report_folder: Annotated[Path, typer.Option("--report", help="Folder of the page.")] = Path("reports/loop"),
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """Calibrate, diagnose, add what is missing, calibrate again, until adequate or abstaining; and report."""
    from bayesmembrane.diagnosis.loop import LoopSettings
    from bayesmembrane.diagnosis.loop import loop as run
    from bayesmembrane.report.page import write_report
    from bayesmembrane.words.loop import document as words

    adapt = noise == "auto"
    measurement, claim = _asked(
        curve, specimen, material, effects, max_deflection_mm, convexity, "white" if adapt else noise
    )
    _say_thinning(measurement)
    try:
        with lines() as tell:
            settings = LoopSettings(seed, out_folder, ess, adapt)
            found = run(measurement, claim, settings, tell=lambda text: tell(claim.label(), text))
    except KeyboardInterrupt:
        log.print(f"Interrupted; the runs are stored in {out_folder}. The same command resumes: {_command()}")
        raise typer.Exit(130) from None
    runs = list({str(s.run.path): s.run for r in found.rounds for s in (r.before, r.after)}.values())
    page = write_report([*runs, found], report_folder)
    document: dict[str, Any] = {**words(found), "report": str(page)}

    def show() -> None:
        for number, round_ in enumerate(document["rounds"], 1):
            out.print(f"Round {number}")
            _shown(round_, measurement)
        out.print(f"The report lies in {page}")

    answer(document, as_json, show)


def _shown(document: dict[str, Any], measurement: Measurement) -> None:
    """A diagnosis on the terminal, in the units of the rig."""
    factor, unit = measurement.rig.shown(measurement.specimen.thickness)["N"]
    out.print(document["sentence"])
    several = len({r["material"] for r in document["ranking"]}) > 1
    rows = [
        [
            f"{r['effect']} with {r['material']}" if several and r["effect"] != r["material"] else r["effect"],
            f"{r['log_bayes_factor']:.1f}",
            f"{100 * r['unexplained']:.0f} %",
            ", ".join(f"{k.split('.')[-1]} {v:.4g}" for k, v in r["parameters"].items()),
        ]
        for r in document["ranking"][:8]
    ]
    table("Candidates", ["effect or energy", "ln Bayes factor", "unexplained", "parameters, SI"], rows)
    errors = [
        [when, f"{factor * e['rmse_N']:.3g}", f"{factor * e['max_N']:.3g}", f"{e['reduced_chi2']:.2f}"]
        for when, e in document["error"].items()
        if isinstance(e, dict)
    ]
    table("Errors", ["", f"root mean square, {unit}", f"largest, {unit}", "reduced chi-square"], errors)
    for sentence in document["absorbed"]:
        out.print(sentence)
    for step in document["next_measurements"]:
        out.print(step["sentence"])


@app.command()
def report(
    folders: Annotated[list[Path], typer.Argument(help="Folders of runs, or that hold runs.", metavar="DIR...")],
    out_folder: Annotated[Path, typer.Option("--out", help="Folder of the page.")] = Path("reports/report"),
    title: Annotated[str | None, typer.Option(help="Title of the page.")] = None,
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """One self-contained HTML page about one run or several."""
    from bayesmembrane.calibration.run import load_run, run_folders
    from bayesmembrane.report.page import write_report

    found = [path for folder in folders for path in run_folders(folder)]
    runs = [load_run(path) for path in found]
    page = write_report(runs, out_folder, title)
    document = {"report": str(page), "runs": [str(path) for path in found]}
    answer(document, as_json, lambda: out.print(f"The report lies in {page}"))


@app.command()
def demo(
    out_folder: Annotated[Path, typer.Option("--out", help="Folder of the page.")] = Path("reports/demo"),
    chains: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("chains"),
    ess: Ess = 1000.0,
    as_json: AsJson = False,
    seed: Seed = 0,
) -> None:
    """Reconstruct, fit and sample five materials on both ranges of the data that ship, and report."""
    from bayesmembrane.app.demo import demo as run

    log.print("Five materials on two ranges; the first run compiles the solvers, which takes about a minute.")
    document = run(out_folder, chains, seed=seed, ess=ess)
    answer(document, as_json, lambda: out.print(f"The report lies in {document['report']}"))


def _measurement(curve: Path, specimen: Path) -> Measurement:
    from bayesmembrane.data.measurement import read_measurement

    measurement = read_measurement(curve, specimen)
    for note in measurement.provenance.notes:
        log.print(f"{curve}: {note}.", markup=False)
    return measurement


def _say_thinning(measurement: Measurement) -> None:
    """On stderr, before the work: that not all readings will be used."""
    from bayesmembrane.data.thinning import thinned
    from bayesmembrane.diagnosis.result import thinning
    from bayesmembrane.words.diagnosis import thinning_sentence

    if (found := thinning(measurement, thinned(measurement))) is not None:
        log.print(thinning_sentence(found).replace("were diagnosed", "are diagnosed"), markup=False)


def _asked(
    curve: Path, specimen: Path, material: str, effects: str, max_mm: float | None, convexity: str, noise: str
) -> tuple[Measurement, Hypothesis]:
    """The measurement, cut if asked for, and the hypothesis."""
    from bayesmembrane.physics.hypothesis import hypothesis

    names = [name.strip() for name in effects.split(",") if name.strip()]
    claim = hypothesis(material, names, noise, convexity)
    measurement = _measurement(curve, specimen)
    return measurement if max_mm is None else measurement.up_to(max_mm * 1e-3), claim


@contextmanager
def _bar(label: str) -> Iterator[Callable[[Progress], None]]:
    """A progress bar on stderr for one run."""
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    from bayesmembrane.app.demo import share, told

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[text]}"), TimeElapsedColumn())
    with Bars(*columns, console=log) as bars:
        task = bars.add_task(label, total=1.0, text="finding starts")
        yield lambda p: bars.update(task, completed=share(p), text=told(p))


def _command() -> str:
    return shlex.join(["bayesmembrane", *sys.argv[1:]])


def main() -> None:
    """Run a verb. Exit status: 0 done; 1 wrong data or settings, in one sentence; 2 wrong usage; 130 interrupted."""
    try:
        app(standalone_mode=True)
    except BayesmembraneError as error:
        log.print(str(error), markup=False)
        sys.exit(1)
    except KeyboardInterrupt:
        log.print("Interrupted.")
        sys.exit(130)


if __name__ == "__main__":
    main()
