"""The options that verbs share, each said once, and groups of them that a verb takes as one argument.

A verb is a function; where an argument is annotated with a group (a dataclass derived from `OptionGroup`), the command
line has the group's fields as options, and the verb gets them as one value.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from bayesmembrane.app.terminal import note, numbers
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.text import file_name

if TYPE_CHECKING:
    from bayesmembrane.calibration.joint.claim import Joint
    from bayesmembrane.data.measurement import Measurement
    from bayesmembrane.data.project import Listed
    from bayesmembrane.physics.hypothesis import Hypothesis

CHAINS = Path("chains")
"""Where answers and runs lie unless another folder is named."""


@dataclass(frozen=True)
class OptionGroup:
    """A group of options."""


@dataclass(frozen=True)
class OutputOptions(OptionGroup):
    """What every verb can be asked for beside its answer."""

    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout; logs go to stderr.")] = False
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of every random number.")] = 0


@dataclass(frozen=True)
class StoredOption(OptionGroup):
    """Where the answer is stored whole."""

    folder: Annotated[Path, typer.Option("--out", help="Folder of the answers; this one gets its own inside.")] = CHAINS


@dataclass(frozen=True)
class StoredOutputOptions(StoredOption, OutputOptions):
    """What a verb whose answer is stored can be asked for beside it."""


@dataclass(frozen=True)
class StoredOnRequestOption(OptionGroup):
    """Where an answer is stored that is quickly had again."""

    folder: Annotated[
        Path | None, typer.Option("--out", help="Also store the answer, in a folder inside this one.")
    ] = None


@dataclass(frozen=True)
class FilmOptions(OptionGroup):
    """A strain energy with its parameters."""

    material: Annotated[
        str, typer.Option("--material", help="Strain energy by name: yeoh, gent, ...; a wrong name lists all.")
    ]
    parameters: Annotated[
        str,
        typer.Option(
            "--parameters", help="Membrane parameters, N/m (exponents and Gent's c2 pure numbers), by commas."
        ),
    ]


ThenOption = Annotated[
    list[Path] | None,
    typer.Option("--then", help="Next test of the same film, not taken out in between; may be given again."),
]
RestOption = Annotated[
    float, typer.Option("--rest-s", min=0.0, help="Rest at zero before each --then whose clock starts anew, s.")
]


@dataclass(frozen=True)
class CurveOptions(OptionGroup):
    """A measured curve."""

    curve: Annotated[
        Path, typer.Argument(help="The measured curve: CSV whose header names carry units.", metavar="CURVE")
    ]
    specimen: Annotated[Path, typer.Option("--specimen", help="TOML with film, rig and noise.")]
    then: ThenOption = None
    rest_s: RestOption = 0.0

    @property
    def shown(self) -> str:
        """The name of the curve's file as people read it."""
        return file_name(str(self.curve))

    def read(self) -> Measurement:
        """The whole measurement; what was left aside while reading is said on stderr."""
        from bayesmembrane.data.sequence import read_one_after_another

        measurement = read_one_after_another([self.curve, *(self.then or ())], self.specimen, self.rest_s)
        for left_aside in measurement.provenance.notes:
            note(f"{self.shown}: {left_aside}.")
        return measurement


def curves_with_specimens(words: Sequence[str] | None, option: str) -> list[Measurement]:
    """The measurements of CURVE:SPECIMEN; raises `SettingsError` where a colon is missing."""
    found = []
    for word in words or []:
        curve, _, specimen = word.rpartition(":")
        if not curve:
            raise SettingsError(
                f'"{word}" is no curve with its specimen file', option, f"write {option} strip.csv:strip.toml"
            )
        found.append(CurveOptions(Path(curve), Path(specimen)).read())
    return found


@dataclass(frozen=True)
class TestsOptions(OptionGroup):
    """A measured curve, or several tests of one material."""

    curve: Annotated[
        Path,
        typer.Argument(
            help="The measured curve (CSV whose header names carry units), or a project (TOML with tables named test).",
            metavar="CURVE",
        ),
    ]
    specimen: Annotated[
        Path | None, typer.Option("--specimen", help="TOML with film, rig and noise; left out with a project.")
    ] = None
    others: Annotated[
        list[str] | None,
        typer.Option("--with", help="Another test of the same material, CURVE:SPECIMEN; may be given again."),
    ] = None
    then: ThenOption = None
    rest_s: RestOption = 0.0

    @property
    def shown(self) -> str:
        """The name of the file as people read it."""
        return file_name(str(self.curve))

    @property
    def several(self) -> bool:
        """Whether this is a joint calibration."""
        return bool(self.others) or self._is_project

    @property
    def _is_project(self) -> bool:
        return self.specimen is None and self.curve.suffix.lower() == ".toml"

    def read(self) -> Measurement:
        """The whole measurement, where there is one alone; what was left aside while reading is said on stderr."""
        if self.specimen is None:
            raise typer.BadParameter("the curve needs a specimen file", param_hint="'--specimen'")
        if self.curve.suffix.lower() == ".toml":
            if self.specimen.suffix.lower() != ".toml":
                fault = "the curve is a TOML file and the specimen is none"
                raise SettingsError(fault, f"{self.curve}, --specimen {self.specimen}", "name the curve first")
            raise SettingsError("a project lists the specimens itself", "--specimen", "leave it out")
        return CurveOptions(self.curve, self.specimen, self.then, self.rest_s).read()

    def listed(self, used: RangeOption) -> list[Listed]:
        """All tests; ``used`` is of the first one, and a project says it itself."""
        from bayesmembrane.data.project import Listed, read_project

        if self._is_project and self.then:
            raise SettingsError("a project lists its tests itself", "--then", "leave it out")
        found = list(read_project(self.curve)) if self._is_project else [Listed("", used.of(self.read()))]
        found += [Listed("", measurement) for measurement in curves_with_specimens(self.others, "--with")]
        if self._is_project:
            for test in found:
                for left_aside in test.measurement.provenance.notes:
                    note(f"{test.measurement.provenance.curve}: {left_aside}.")
        return found


@dataclass(frozen=True)
class RangeOption(OptionGroup):
    """How much of the curve is used."""

    max_deflection_mm: Annotated[
        float | None, typer.Option("--max-deflection-mm", help="Use the curve up to here only, mm.")
    ] = None
    max_stretch: Annotated[
        float | None, typer.Option("--max-stretch", help="Use the curve of a strip or a sheet up to this stretch only.")
    ] = None

    def of(self, whole: Measurement) -> Measurement:
        """The part of a measurement that is used."""
        end = self.end_on(whole)
        return whole if end is None else whole.up_to(end)

    def end_on(self, whole: Measurement) -> float | None:
        """The largest deflection that is used, m; None if all are.

        Raises `SettingsError` where it is given twice, and for a stretch of a rig that reads none.
        """
        from bayesmembrane.words.seen import seen

        if self.max_stretch is None:
            return None if self.max_deflection_mm is None else 1e-3 * self.max_deflection_mm
        if self.max_deflection_mm is not None:
            raise SettingsError("the range is given twice", "--max-deflection-mm, --max-stretch", "give one of them")
        how = seen(whole)
        if how.travel != "stretch":
            what = f"the curve is read over {how.travel}, and not over stretch"
            raise SettingsError(what, "--max-stretch", "give --max-deflection-mm")
        return how.meant(self.max_stretch)


@dataclass(frozen=True)
class RangesOption(OptionGroup):
    """Several ranges of one curve."""

    ranges_mm: Annotated[
        str, typer.Option("--ranges-mm", help="Ends of the ranges, mm: 35.1,91.5. The whole curve without.")
    ] = ""

    @property
    def ends(self) -> list[float]:
        """Their ends in m."""
        return [1e-3 * end for end in numbers(self.ranges_mm, "--ranges-mm")] if self.ranges_mm else []


@dataclass(frozen=True)
class RangeOrRangesOption(RangesOption, RangeOption):
    """One range, or several."""


@dataclass(frozen=True)
class MaterialOption(OptionGroup):
    """The strain energy that is asked about."""

    material: Annotated[
        str, typer.Option("--material", help="Strain energy by name: yeoh, gent, ...; a wrong name lists all.")
    ]


@dataclass(frozen=True)
class PreferredMaterialOption(OptionGroup):
    """The strain energy that is preferred beforehand, where all of them are judged."""

    material: Annotated[
        str,
        typer.Option(
            "--material", help="Strain energy preferred beforehand; without it all are as probable, and all are judged."
        ),
    ] = ""

    @property
    def declared(self) -> bool:
        """True if one was named."""
        return bool(self.material)

    @property
    def name(self) -> str:
        """The one that was named, or else the first in the library: any will do to ask the question."""
        from bayesmembrane.ground.registry import ordinary_materials

        return self.material or min(ordinary_materials())


@dataclass(frozen=True)
class QuickOption(OptionGroup):
    """How far sets of effects are followed."""

    quick: Annotated[bool, typer.Option("--quick", help="Single effects only.")] = False


@dataclass(frozen=True)
class MaterialsOption(OptionGroup):
    """Several strain energies."""

    materials: Annotated[str, typer.Option("--materials", help="By commas; yeoh+prestretch adds an effect to one.")]


@dataclass(frozen=True)
class HypothesisOptions(OptionGroup):
    """What is claimed beside the strain energy."""

    effects: Annotated[str, typer.Option("--effects", help="Physical effects beside the material, by commas.")] = ""
    convexity: Annotated[str, typer.Option("--convexity", help="Convexity prior: reached, box, elliptic or none.")] = (
        "reached"
    )
    noise: Annotated[str, typer.Option("--noise", help="Noise model: white, ar1, ar1_readings, form or form_ar1.")] = (
        "white"
    )

    def with_material(self, material: str, noise: str = "") -> Hypothesis:
        """The hypothesis; ``noise`` instead of the one asked for, unless it is ""."""
        from bayesmembrane.physics.hypothesis import hypothesis

        names = [name.strip() for name in self.effects.split(",") if name.strip()]
        return hypothesis(material, names, noise or self.noise, self.convexity)

    def joint(self, material: str, tests: Sequence[Listed]) -> Joint:
        """The same claimed of several tests; an effect ``a`` of all where it can occur, ``a@strip`` of one."""
        from bayesmembrane.calibration.joint.effects import joint_of

        return joint_of(material, tests, self.effects, self.noise, self.convexity)


@dataclass(frozen=True)
class HypothesisOptionsAuto(HypothesisOptions):
    """The same where the noise may be found out."""

    noise: Annotated[
        str,
        typer.Option("--noise", help="A noise model, or auto: correlated if neighbouring readings turn out to be so."),
    ] = "auto"


@dataclass(frozen=True)
class HypothesisOptionsWeighed(HypothesisOptions):
    """The same where several noises may be weighed."""

    noise: Annotated[
        str, typer.Option("--noise", help="A noise model, or auto: white, ar1 and form, weighed by evidence.")
    ] = "white"


@dataclass(frozen=True)
class SamplingOptions(OptionGroup):
    """How well a posterior is sampled."""

    ess: Annotated[float, typer.Option("--ess", help="Wanted effective sample size of the worst parameter.")] = 1000.0


@dataclass(frozen=True)
class RunOptions(SamplingOptions):
    """The same, and where a run begins that does not begin on its own."""

    fork: Annotated[
        Path | None,
        typer.Option("--fork", help="Begin a new run at the end of the one in this folder, whatever made that."),
    ] = None
    sampler: Annotated[
        str,
        typer.Option(
            "--sampler",
            help="auto: propose from a learned mixture where it is good enough, else emcee's ensembles; or emcee.",
        ),
    ] = "auto"


def spread(verb: Callable[..., None]) -> Callable[..., None]:
    """``verb`` with the fields of every group among its arguments as arguments of their own, as Typer wants them."""
    hints = get_type_hints(verb, include_extras=True)
    groups = {n: h for n, h in hints.items() if inspect.isclass(h) and issubclass(h, OptionGroup)}
    flat: dict[str, inspect.Parameter] = {}
    for name, parameter in inspect.signature(verb).parameters.items():
        own = _fields(groups[name]) if name in groups else [(name, hints[name], parameter.default)]
        for option, hint, default in own:
            flat[option] = inspect.Parameter(option, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)

    @wraps(verb)
    def typed(**given: Any) -> None:
        made = {n: kind(**{f.name: given.pop(f.name) for f in fields(kind)}) for n, kind in groups.items()}
        verb(**made, **given)

    typed.__signature__ = inspect.Signature(list(flat.values()))  # type: ignore[attr-defined]
    typed.__annotations__ = {name: p.annotation for name, p in flat.items()}
    return typed


def _fields(group: type[OptionGroup]) -> list[tuple[str, Any, Any]]:
    hints = get_type_hints(group, include_extras=True)
    empty = inspect.Parameter.empty
    return [(f.name, hints[f.name], empty if f.default is MISSING else f.default) for f in fields(group)]
