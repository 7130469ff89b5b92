"""Campaigns of the tests: curves in closed form that are cheap to sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.plan import Plan, write_plan
from bayesmembrane.campaign.planning import plan
from bayesmembrane.campaign.task import Task

SPECIMEN = '[specimen]\nname = "{name}"\nthickness_um = 50.0\n[rig]\nkind = "uniaxial"\n'


def write_film(folder: Path, name: str, modulus: float = 0.4, points: int = 8) -> Path:
    """A neo-Hookean strip, nominal stress G (l - 1/l^2) in MPa, with a stated noise."""
    stretch = np.linspace(1.1, 2.0, points)
    noise = 0.01 * np.random.default_rng(len(name)).standard_normal(points)
    stress = modulus * (stretch - stretch**-2) + noise
    rows = "".join(f"{a:.6f},{b:.6f},0.01\n" for a, b in zip(stretch, stress, strict=True))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.csv").write_text(f"stretch,nominal_stress_MPa,nominal_stress_sd_MPa\n{rows}")
    (folder / f"{name}.toml").write_text(SPECIMEN.format(name=name))
    return folder / f"{name}.csv"


def write_campaign(folder: Path, body: str = "", films: Sequence[str] = ("a", "b"), **sections: str) -> Path:
    """A campaign file beside some films; ``sections`` are the lines of its tables."""
    for name in films:
        write_film(folder / "films", name, 0.4 + 0.001 * ord(name[0]))
    tables = {
        "measurements": 'curves = ["films/*.csv"]',
        "hypotheses": 'materials = ["neo_hookean"]\nconvexity = ["reached", "none"]',
        "analyses": 'wanted = ["sample"]\npages = false',
        "sampling": "ess = 50\nwalkers = 16\nchunk = 40\nmost_steps = 400",
        **sections,
    }
    path = folder / "night.toml"
    path.write_text(body + "".join(f"\n[{name}]\n{lines}\n" for name, lines in tables.items()))
    return path


def planned(folder: Path, count: int = 0, films: Sequence[str] = ("a", "b"), **sections: str) -> tuple[Path, Plan]:
    """(folder of the campaign, plan) of such a campaign, stored; with ``count`` tasks like its first instead."""
    file = write_campaign(folder, films=films, **sections)
    made = plan(read_campaign(file), file)
    if count:
        one = made.tasks[0]
        own = ({"film": f"film{i}", "seed": i, "key": ""} for i in range(1, count + 1))
        tasks = [Task.from_plain({**one.plain(), **values}).keyed() for values in own]
        made = Plan(made.name, made.source, tuple(tasks), made.deadline)
    campaign = folder / "night"
    write_plan(campaign, made)
    return campaign, made
