"""One run on a page: a homogeneous test: no disc, no radii, and said what its forces and deflections stand for."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.predictions import Wanted
from bayesmembrane.calibration.run import Run, RunSettings, predictions_of, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.page import write_report
from bayesmembrane.report.sections.run import RunSection

STRETCH = np.linspace(1.05, 2.0, 16)


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize("rig", [Uniaxial(0.040, 0.005), Equibiaxial()])
def test_a_strip_is_reported_without_a_lifted_film(rig, tmp_path: Path) -> None:
    d = rig.length * (STRETCH - 1)
    m = Measurement(d, np.ones(d.size), rig, Specimen("tape", 1e-3))
    claim = hypothesis("neo_hookean")
    force = Forward(claim, m, d)(np.array([[3.0]])).force[0]
    noise = 0.01 * float(force.max()) * np.random.default_rng(1).normal(size=d.size)
    m = Measurement(d, force + noise, rig, Specimen("tape", 1e-3))
    settings = Settings(ess=1.0, chunk=40, most_steps=40, walkers=16)
    run = sample(m, claim, RunSettings(out=tmp_path / "chains", settings=settings, predictions=False))
    predictions_of(run, Wanted(draws=20))
    page = write_report([run], tmp_path / "report").read_text(encoding="utf-8")
    twin = json.loads((tmp_path / "report" / "report.json").read_text(encoding="utf-8"))
    assert "the deformed film, height" not in page
    assert not re.search(r"\((mm|mN|N)\)|\d (mN|N)\b(?! for|/)", re.sub('base64,[^"]*', "", page))
    (told,) = (
        r["value"]
        for r in twin["tables"][f"data up to a stretch of {1 + d[-1] / rig.length:.4g}"]
        if r["name"] == "rig"
    )
    assert told.startswith(f"{rig.title}, length {1e3 * rig.length:g} mm and width {1e3 * rig.width:g} mm;")
    assert f"1 N for {1e-6 / (rig.width * 1e-3):.4g} MPa" in told
    assert f"1 mm of deflection is {1e-3 / rig.length:.4g} of stretch" in told


def test_a_run_at_a_prompt_solves_nothing(stored: Run) -> None:
    section = RunSection()
    assert section.text(stored).startswith("neo-Hookean, fitted up to 35 mm\nUp to 35 mm, neo-Hookean (rms residual")
    assert section.html(stored).count("<img") >= 7
    bare = replace(stored, path=None)
    assert section.text(bare).startswith(f"neo-Hookean, {stored.name}\n")
    assert "<img" not in section.html(bare)
