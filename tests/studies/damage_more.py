"""Files beside runs, damaged as those of `tests.studies.damage` are: answers, campaigns, and what users wrote."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.index import INDEX, SEAL, opened, rebuild
from bayesmembrane.campaign.page import write_morning_page
from bayesmembrane.campaign.plan import PLAN, read_plan
from bayesmembrane.campaign.planning import plan
from bayesmembrane.campaign.record import DONE, Record, read_records, write_now, write_record
from bayesmembrane.campaign.status import standing
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.loop import Loop, Round, Stage
from bayesmembrane.ground.stored import read, store
from bayesmembrane.ground.tree import Encoder
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics.api import force_curve
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.valleys.follow import valleys
from tests.campaign.doing import sampled
from tests.campaign.films import planned
from tests.report.sections.test_evidence import compared
from tests.report.test_page import reconstruction
from tests.short_walks import FEW

Read = Callable[[], Any]


@dataclass(frozen=True)
class File:
    """A file to be damaged, and how to read what rests on it as plain values.

    sealed : a checksum tells what was damaged; what a user wrote, and the passing note of a worker, have none
    """

    name: str
    path: Path
    read: Read
    sealed: bool = True


def answers(place: Path) -> list[File]:
    """Stored answers of every kind, each with its arrays; those of diagnose and loop are of one short curve."""
    at = np.linspace(0.004, 0.03, 12)
    force = force_curve("neo_hookean", (7.5,), at)[0] + 0.004 * np.random.default_rng(0).standard_normal(12)
    curve = Measurement(at, force, Annulus(0.010, 0.035), Specimen("film", 5e-5))
    claim = hypothesis("neo_hookean")
    how = RunSettings(out=place / "runs", settings=Settings(**{"ess": 1.0, **FEW}))
    found, walked = diagnose(curve, claim), Stage(sample(curve, claim, how), 500.0, 0.03, 450.0, 4.0, 0.91)
    kinds: dict[str, Any] = {
        "comparison": compared(),
        "reconstruction": reconstruction(),
        "diagnosis": found,
        "loop": Loop((Round(found, walked, walked),), None),
        "valleys": valleys(curve, claim, [0.03]),
    }
    files: list[File] = []
    for kind, result in kinds.items():
        folder = store(place / kind, kind, result, {"kind": kind})
        content = _answer(folder, kind)
        files += [File(f"{kind}.{end}", folder / f"{kind}.{end}", content) for end in ("json", "npz")]
    return files


def _answer(folder: Path, kind: str) -> Read:
    def content() -> Any:
        encoder = Encoder(folder)
        tree = encoder(read(folder, kind))
        return json.dumps(tree), [array.tobytes() for array in encoder.arrays.values()]

    return content


def campaign(place: Path) -> list[File]:
    """A campaign of four runs with all that lies in its folder, and the files that it was made of."""
    folder, made = planned(place)
    for task in made.tasks[1:]:
        write_record(folder, Record(task.key, DONE, found=sampled(task), folder="films/x"))
    write_now(folder, made.tasks[0].key, {"doing": "sampling", "ess": 30.0, "wanted": 50.0, "tau": 3.0})
    rebuild(folder, made)
    source, film, key = Path(made.source), place / "films", made.tasks[1].key

    def stands() -> Any:
        page = write_morning_page(folder, place / "page")
        with opened(folder) as index:
            rows = [vars(entry) for entry in index.entries()]
        return json.dumps([standing(folder).document(), rows]), page.with_name("report.json").read_text()

    def recorded() -> Any:
        rebuild(folder, read_plan(folder))
        return stands(), sorted(read_records(folder))

    def planned_again() -> Any:
        asked = read_campaign(source)
        return [task.plain() for task in plan(asked, source).tasks]

    def measured() -> Any:
        found = read_measurement(film / "a.csv", film / "a.toml")
        return found.data_hash, found.specimen.name

    return [
        File("campaign: plan.json", folder / PLAN, lambda: read_plan(folder)),
        File("campaign: records/KEY.json", folder / "records" / f"{key}.json", recorded),
        File("campaign: now/KEY.json", folder / "now" / f"{made.tasks[0].key}.json", stands, sealed=False),
        File("campaign: index.sqlite", folder / INDEX, stands),
        File("campaign: index.sha256", folder / SEAL, stands),
        File("campaign.toml", source, planned_again, sealed=False),
        File("curve.csv", film / "a.csv", measured, sealed=False),
        File("specimen.toml", film / "a.toml", measured, sealed=False),
    ]
