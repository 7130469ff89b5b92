"""A published posterior of VHB 4910, made again, and made honest.

    python -m tests.studies.miles [--seed 0]

The quick cycle to a stretch of 5.4 (1275 readings) by the model of its authors (`tests/studies/tape.py`), with three
parameters held as they held them and white noise; then with noise that remembers, and with errors of the forms. Writes
docs/studies/miles.md. The measurement lies in ../shared/data/effects and is no part of the project.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesmembrane.calibration.checks import lag_1
from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.convexity import mode
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import Hypothesis
from tests.studies.tape import Dashpot, Nonaffine, held
from tests.studies.vhb_data import FAST, FOLDER, fast_cycle, kPa

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "miles.md"
PUBLISHED = {"eta": (736.22, 13.37), "gamma": (33.276, 0.177)}
"""kPa s and kPa: mean and standard deviation."""
NOISES = ("white", "ar1", "form", "form_ar1")


@dataclass(frozen=True)
class Row:
    """A posterior: (mean, sd) of eta in kPa s and gamma in kPa; residual of the mean, kPa, and how alike neighbours
    are, before and after its noise model is taken out.
    """

    noise: str
    eta: tuple[float, float]
    gamma: tuple[float, float]
    rms: float
    alike: float
    ess: float
    seconds: float


def posterior(measurement: Measurement, noise: str, seed: int, ess: float) -> Row:
    """Under one noise model."""
    began = time.process_time()
    claim = Hypothesis(Nonaffine, (Dashpot(),), components("noise")[noise](), mode("none"))
    run = sample(measurement, claim, RunSettings(seed, ess=ess, predictions=False))
    gamma, eta = (run.data.posterior[f"dashpot.{n}"].values.ravel() / 1e3 for n in ("gamma", "eta"))
    mean = np.array([[*held(), 1e3 * gamma.mean(), 1e3 * eta.mean()]])
    residual = measurement.force - Forward(claim, measurement, measurement.deflection)(mean, reached=False).force[0]
    return Row(
        noise,
        (float(eta.mean()), float(eta.std())),
        (float(gamma.mean()), float(gamma.std())),
        float(kPa(np.sqrt(np.mean(residual**2)))),
        float(lag_1(residual[None, :])[0]),
        float(run.status["ess_bulk"]),
        time.process_time() - began,
    )


def page(rows: list[Row], seed: int) -> str:
    """The table in Markdown."""
    white = rows[0]
    off = {n: (getattr(white, n)[0] - mean) / sd for n, (mean, sd) in PUBLISHED.items()}
    lines = [
        "# A published posterior, made again",
        "",
        f"Made by `python -m tests.studies.miles --seed {seed}`: one cycle of the acrylic tape VHB 4910 at 0.67 1/s to "
        "a stretch of 5.4, 1275 readings (github.com/prmiles/pymcmcstat_examples, MIT; no part of the project), by its "
        "authors' model: nonaffine chains with Gc 7.55 kPa, Ge 17.7 kPa and a largest stretch of 4.8, all held, a "
        "spring gamma and a dashpot eta beside them. `tests/studies/tape.py` declares it as a user would. Flat priors. "
        "Mean and standard deviation.",
        "",
        "| noise | eta, kPa s | gamma, kPa | residual, kPa | alike neighbours (lag 1) | effective draws | CPU, s |",
        "|---|---|---|---|---|---|---|",
        f"| published, white | {_told(PUBLISHED['eta'])} | {_told(PUBLISHED['gamma'])} | - | - | - | - |",
    ]
    for r in rows:
        lines.append(
            f"| {r.noise} | {_told(r.eta)} | {_told(r.gamma)} | {r.rms:.2f} | {r.alike:.3f} | {r.ess:.0f} | "
            f"{r.seconds:.0f} |"
        )
    lines += [
        "",
        f"- By white noise eta is {off['eta']:+.1f} and gamma {off['gamma']:+.1f} published standard deviations off "
        f"the published means, and the standard deviations are {white.eta[1] / PUBLISHED['eta'][1]:.2f} and "
        f"{white.gamma[1] / PUBLISHED['gamma'][1]:.2f} times the published ones.",
        f"- Neighbouring residuals are alike ({white.alike:.3f}): white noise counts {1275} readings where there are "
        "few, and its intervals are too narrow.",
    ]
    for r in rows[1:]:
        wider = r.eta[1] / white.eta[1], r.gamma[1] / white.gamma[1]
        moved = (r.eta[0] - white.eta[0]) / white.eta[1], (r.gamma[0] - white.gamma[0]) / white.gamma[1]
        lines.append(
            f"- By `{r.noise}` eta is {wider[0]:.1f} and gamma {wider[1]:.1f} times as uncertain, and they lie "
            f"{moved[0]:+.1f} and {moved[1]:+.1f} standard deviations of white noise away."
        )
    if any(r.noise.startswith("form") for r in rows):
        lines.append(
            "- With errors of the forms what is held is free again within them, smoothly along the curve; the residual "
            "in the table is that without them. One curve then says little of how chains and dashpot share the stress."
        )
    return "\n".join(lines) + "\n"


def _told(value: tuple[float, float]) -> str:
    return f"{value[0]:.4g} +- {value[1]:.3g}"


def main() -> None:
    """Sample, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ess", type=float, default=1000.0)
    parser.add_argument("--noises", nargs="+", default=NOISES, choices=NOISES)
    asked = parser.parse_args()
    if not (FOLDER / FAST).is_file():
        print(f"Skipped: {FAST} is not in {FOLDER}.")
        return
    rows: list[Row] = []
    for noise in asked.noises:
        rows.append(posterior(fast_cycle(), noise, asked.seed, asked.ess))
        print(rows[-1], flush=True)
        TARGET.write_text(page(rows, asked.seed), encoding="utf-8")


if __name__ == "__main__":
    main()
