"""From the campaign file to all its tasks."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from bayesmembrane.campaign.file import ANALYSES, CampaignFile
from bayesmembrane.campaign.plan import Plan
from bayesmembrane.campaign.task import READ, Task, seed_of
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import BayesmembraneError, SettingsError
from bayesmembrane.physics.hypothesis import hypothesis

CHAINS = Path("chains")


@dataclass(frozen=True)
class _Film:
    """A measurement, and what its tasks are called after; ``fault`` says why it cannot be read."""

    name: str
    curve: str
    specimen: str
    whole: Measurement | None
    fault: str = ""


def plan(asked: CampaignFile, source: Path, seed: int | None = None) -> Plan:
    """The tasks of a campaign whose file is ``source``; ``seed`` instead of the file's, unless None.

    A measurement that cannot be read makes a task that says so. Raises `SettingsError` where no file is meant, or two
    curves have one name.
    """
    chosen = asked.seed if seed is None else seed
    films = _films(asked, source)
    tasks = [task for film in films for task in _of_film(asked, film, chosen)]
    every = dict((task.key, task) for task in sorted(tasks, key=lambda t: _stage(t)))
    return Plan(asked.name or source.stem, str(source.resolve()), tuple(every.values()), asked.stop.deadline)


def _stage(task: Task) -> int:
    return (READ, *ANALYSES).index(task.analysis)


# ---- measurements ----------------------------------------------------------------------------------------------------


def _films(asked: CampaignFile, source: Path) -> list[_Film]:
    found: dict[str, _Film] = {}
    for pattern in asked.measurements.curves:
        curves = _matching(pattern, source.resolve().parent)
        if not curves:
            raise SettingsError(f'no file is meant by "{pattern}"', str(source), "paths start where the file lies")
        for curve in curves:
            film = _film(curve, asked.measurements.specimen, source.resolve().parent)
            if found.setdefault(film.name, film).curve != film.curve:
                raise SettingsError(
                    f'{curve} and {found[film.name].curve} would both be called "{film.name}"',
                    str(source),
                    "rename one of them",
                )
    return list(found.values())


def _matching(pattern: str, base: Path) -> list[Path]:
    """The files that a pattern means, by name; a name without ``*`` and ``?`` means itself, brackets and all."""
    if not re.search(r"[*?]", pattern):
        path = base / pattern
        return [path] if path.is_file() else []
    anchor, relative = (Path(pattern).anchor, pattern.lstrip("/")) if Path(pattern).is_absolute() else (base, pattern)
    return sorted(p for p in Path(anchor).glob(relative) if p.is_file())


def _film(curve: Path, specimen: str | None, base: Path) -> _Film:
    beside = curve.with_suffix(".toml") if specimen is None else base / specimen
    name = re.sub(r"[^a-z0-9_]+", "-", f"{curve.parent.name}_{curve.stem}".lower()).strip("-_")[:80]
    try:
        return _Film(name, str(curve), str(beside), read_measurement(curve, beside))
    except BayesmembraneError as error:
        return _Film(name, str(curve), str(beside), None, str(error))


# ---- what is asked of one --------------------------------------------------------------------------------------------


def _of_film(asked: CampaignFile, film: _Film, seed: int) -> Iterator[Task]:
    if film.whole is None:
        yield Task(READ, film.name, film.curve, film.specimen, fault=film.fault).keyed()
        return
    for end in asked.hypotheses.max_deflection_mm:
        limit = None if isinstance(end, str) else 1e-3 * end
        try:
            data = film.whole.data_hash if limit is None else film.whole.up_to(limit).data_hash
        except SettingsError as error:
            yield Task(READ, film.name, film.curve, film.specimen, end=limit, fault=str(error)).keyed()
            continue
        bare = Task("", film.name, film.curve, film.specimen, data, limit)
        yield from _of_range(asked, _claims(asked, film.whole), bare, seed)


def _of_range(asked: CampaignFile, claims: Sequence[dict[str, Any]], bare: Task, seed: int) -> Iterator[Task]:
    wanted = asked.analyses.wanted
    walk = asked.sampling.stated()
    pages, own = {"page": asked.analyses.pages}, seed_of(seed, bare.data)

    def task(analysis: str, on: Sequence[dict[str, Any]], options: dict[str, Any], needs: tuple[str, ...] = ()) -> Task:
        values = {f: getattr(bare, f) for f in ("film", "curve", "specimen", "data", "end")}
        return Task(analysis, **values, claims=tuple(on), options={**options, **pages}, seed=own, needs=needs).keyed()

    samples = [task("sample", [c], {"sampling": walk}) for c in claims]
    if "sample" in wanted or "compare" in wanted:  # a comparison rests on them, and they are worth a task each
        yield from samples
    if "compare" in wanted:
        yield task("compare", claims, {"sampling": {"ess": walk["ess"]}}, tuple(s.key for s in samples))
    if "valleys" in wanted:
        yield from (task("valleys", [c], {}) for c in claims)
    questions = _questions(asked)
    declared = {"declared": bool(asked.analyses.preferred)}
    if "diagnose" in wanted:
        yield from (task("diagnose", [q], declared) for q in questions)
    if "loop" in wanted:
        yield from (task("loop", [q], {"sampling": {"ess": walk["ess"]}, **declared}) for q in questions)


def _claims(asked: CampaignFile, measurement: Measurement) -> list[dict[str, Any]]:
    """Settings of every hypothesis, each once: the frame of a blank run is in all of them, named or not."""
    h = asked.hypotheses
    every = [hypothesis(*names) for names in product(h.materials, h.effects, h.noise, h.convexity)]
    found: dict[str, dict[str, Any]] = {}
    for claim in every:
        whole = claim.with_frame(measurement).settings()
        found.setdefault(repr({**whole, "effects": sorted(whole["effects"])}), claim.settings())
    return list(found.values())


def _questions(asked: CampaignFile) -> list[dict[str, Any]]:
    """Settings of what a diagnosis starts from: a material, preferred or any, under each convexity prior."""
    first = asked.analyses.preferred or min(asked.hypotheses.materials)
    return [hypothesis(first, (), "white", c).settings() for c in asked.hypotheses.convexity]


def campaign_folder(asked: CampaignFile, source: Path) -> Path:
    """Where a campaign lies: ``out`` of its file, beginning where that lies; else ``chains/<name of the file>``."""
    return source.parent / asked.out if asked.out else CHAINS / source.stem
