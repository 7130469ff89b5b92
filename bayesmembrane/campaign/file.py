"""The campaign file: measurements x materials x effects x noise x convexity x range, and what is wanted of them.

pydantic checks it; its errors become one sentence with file, line and key.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator
from pydantic_core import ErrorDetails

from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.campaign.places import line_of
from bayesmembrane.data.settings import not_toml
from bayesmembrane.data.tables import read_text
from bayesmembrane.ground.errors import SettingsError, unknown_name
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.convexity import MODES

ANALYSES = ("sample", "compare", "diagnose", "valleys", "loop")
"""In the order in which they are done: what is quick and what others rest on comes first."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def _known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    every = list(known)
    for name in names:
        if name not in every:
            raise ValueError(str(unknown_name(kind, name, every)))


def _effect_set(value: Any) -> Any:
    """``"prestretch+zero_offset"``, ``["prestretch", "zero_offset"]``, and ``""`` or ``"none"`` for no effect."""
    if isinstance(value, str):
        value = [] if value.strip() in ("", "none") else [name.strip() for name in value.split("+")]
    return tuple(value) if isinstance(value, list) else value


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Names = Annotated[tuple[str, ...], BeforeValidator(_tuple), Field(min_length=1)]
End = float | Literal["all"]
EffectSet = Annotated[tuple[str, ...], BeforeValidator(_effect_set)]


class Measurements(_Section):
    """Which curves, by patterns; beside each its specimen file, or one for all."""

    curves: Names
    specimen: str | None = None


class Hypotheses(_Section):
    """What is claimed: every combination of these."""

    materials: Names
    effects: Annotated[tuple[EffectSet, ...], BeforeValidator(_tuple), Field(min_length=1)] = ((),)
    noise: Names = ("white",)
    convexity: Names = ("reached",)
    max_deflection_mm: Annotated[tuple[End, ...], BeforeValidator(_tuple), Field(min_length=1)] = ("all",)

    @field_validator("materials")
    @classmethod
    def _materials(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        _known("material", names, components("materials"))
        return names

    @field_validator("effects")
    @classmethod
    def _effects(cls, sets: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
        for names in sets:
            _known("effect", names, components("effects"))
            if len(set(names)) < len(names):
                raise ValueError(f'the set "{"+".join(names)}" names an effect twice; name every effect once')
        return sets

    @field_validator("noise")
    @classmethod
    def _noise(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        _known("noise model", names, components("noise"))
        return names

    @field_validator("convexity")
    @classmethod
    def _convexity(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        _known("convexity prior", names, MODES)
        return names

    @field_validator("max_deflection_mm")
    @classmethod
    def _ends(cls, ends: tuple[End, ...]) -> tuple[End, ...]:
        for end in ends:
            if not isinstance(end, str) and not (math.isfinite(end) and end > 0):
                raise ValueError(
                    f'{end} is no largest deflection; write positive numbers, or "all" for the whole curve'
                )
        return ends

    @model_validator(mode="after")
    def _once(self) -> Hypotheses:
        for key in ("materials", "effects", "noise", "convexity", "max_deflection_mm"):
            values = getattr(self, key)
            if len(set(values)) < len(values):
                raise ValueError(f"{key} names something twice; name it once")
        return self


class Analyses(_Section):
    """What is wanted of every hypothesis (sample, valleys), or of every measurement (compare, diagnose, loop)."""

    wanted: Annotated[
        tuple[Literal["sample", "compare", "diagnose", "valleys", "loop"], ...],
        BeforeValidator(_tuple),
        Field(min_length=1),
    ] = ("sample",)
    preferred: str = ""
    pages: bool = True

    @field_validator("preferred")
    @classmethod
    def _preferred(cls, name: str) -> str:
        if name:
            _known("material", [name], components("materials"))
        return name


class Sampling(_Section):
    """How a posterior is sampled; see `calibration.sampling.walk.Settings`."""

    ess: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1000.0
    ensembles: Annotated[int, Field(ge=2)] | None = None
    walkers: Annotated[int, Field(ge=2, multiple_of=2)] | None = None
    chunk: Annotated[int, Field(ge=10)] | None = None
    most_steps: Annotated[int, Field(ge=10)] | None = None
    sampler: Literal["auto", "emcee"] | None = None

    @model_validator(mode="after")
    def _walkable(self) -> Sampling:
        try:
            self.settings()
        except SettingsError as error:
            raise ValueError(str(error)) from None
        return self

    def settings(self) -> Settings:
        """How to walk."""
        return Settings(**self.stated())

    def stated(self) -> dict[str, Any]:
        """What the file says; what it does not is as usual."""
        return {name: value for name, value in self.model_dump().items() if value is not None}


class Stop(_Section):
    """When the campaign ends, done or not: ``deadline = "07:30"`` by the clock of the machine that starts it."""

    deadline: str | None = None

    @field_validator("deadline")
    @classmethod
    def _clock(cls, text: str | None) -> str | None:
        if text is not None and not re.fullmatch(r"([01]?\d|2[0-3]):[0-5]\d(:[0-5]\d)?", text):
            raise ValueError(f'"{text}" is no time of day; write hours and minutes, as "07:30"')
        return text


class CampaignFile(_Section):
    """A campaign as it is asked for."""

    name: str = ""
    out: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    measurements: Measurements
    hypotheses: Hypotheses
    analyses: Analyses = Analyses()
    sampling: Sampling = Sampling()
    stop: Stop = Stop()


def read_campaign(path: Path) -> CampaignFile:
    """The campaign in a TOML file.

    Raises `DataError` for a file that cannot be read, `SettingsError` for what stands in it: file, line, key, remedy.
    """
    text = read_text(path)
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        fault, remedy = not_toml(text, error)
        raise SettingsError(fault, str(path), remedy) from None
    try:
        return CampaignFile.model_validate(table)
    except ValidationError as error:
        raise _sentence(path, text, error.errors()[0]) from None


def _sentence(path: Path, text: str, fault: ErrorDetails) -> SettingsError:
    """The first fault that pydantic found, with its place in the file."""
    place = [part for part in fault["loc"] if not _internal(part)]
    keys = [str(part) for part in place if isinstance(part, str)]
    line = line_of(text, place)
    where = f"{path}, line {line}" if line else str(path)
    section = ".".join(keys)
    if fault["type"] == "extra_forbidden":
        known = sorted(_fields(keys[:-1]))
        nearest = difflib.get_close_matches(keys[-1], known, n=1, cutoff=0.5)
        guess = f'did you mean "{nearest[0]}"? ' if nearest else ""
        return SettingsError(f'the key "{section}" is unknown', where, f"{guess}known: {', '.join(known)}")
    if fault["type"] == "missing":
        return SettingsError(f'"{section}" is missing', where, f"add {_example(keys)}")
    said = fault["msg"].removeprefix("Value error, ").replace("a valid tuple", "a list")
    return SettingsError(f"{section}: {said[:1].lower()}{said[1:]}" if section else said, where)


def _internal(part: str | int) -> bool:
    """What pydantic adds to a place to say which of several types it tried."""
    return isinstance(part, str) and ("[" in part or part in ("float", "str"))


def _fields(keys: list[str]) -> Iterable[str]:
    kind: Any = CampaignFile
    for key in keys:
        kind = kind.model_fields[key].annotation
    return list(kind.model_fields)


def _example(keys: list[str]) -> str:
    examples = {"curves": 'curves = ["films/*.csv"]', "materials": 'materials = ["yeoh", "gent"]'}
    return examples.get(keys[-1], f"the section [{'.'.join(keys)}]")
