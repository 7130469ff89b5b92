"""What is said of a population of specimens."""

from __future__ import annotations

from typing import Any

import numpy as np

from bayesmembrane.calibration.hierarchy.next_curve import NextCurve
from bayesmembrane.calibration.hierarchy.population import Population
from bayesmembrane.calibration.hierarchy.specimens import LN_MODULUS
from bayesmembrane.words.language import listed, percent, three_digits
from bayesmembrane.words.seen import seen_on

FEW = 5
"""Specimens below which the prior of the scatter is named."""
_WORDS = {"mean": "mean", "scatter": "scatter between specimens", "next": "next specimen"}


def rows(found: Population) -> list[tuple[str, float, float, str]]:
    """(what, mean, standard deviation, 94 % interval) of mean, scatter and next specimen, by coordinate."""
    summary = found.summary()
    told = {f"{name}: ": p for name, p in summary["parameters"].items()}
    if "modulus_MPa" in summary:
        told = {"shear modulus (MPa): ": summary["modulus_MPa"], **told}
    return [
        (f"{name}{words}", p[key]["mean"], p[key]["sd"], _interval(p[key]))
        for name, p in told.items()
        for key, words in _WORDS.items()
    ]


def sentences(found: Population) -> tuple[str, ...]:
    """What an engineer should read: stiffness, scatter, and what to expect of the next specimen."""
    said, s = [], found.specimens
    if LN_MODULUS in s.names:
        m = found.modulus()
        said.append(
            f"{len(s.labels)} specimens: the shear modulus is {three_digits(m['mean']['mean'])} MPa on average over "
            f"the population and scatters by {three_digits(m['scatter']['mean'])} MPa "
            f"({percent(m['scatter']['mean'] / m['mean']['mean'])}) between specimens; the next one lies with 94 % "
            f"between {three_digits(m['next']['hdi_94'][0])} and {three_digits(m['next']['hdi_94'][1])} MPa."
        )
    if found.next_curve is not None:
        said.append(_next_curve(found.next_curve))
        if found.next_curve.without_form:
            said.append("The form error of the next specimen is not in the band of its curve.")
    if len(s.labels) < FEW:
        said.append(f"With {len(s.labels)} specimens the prior of the scatter has a say in it.")
    if s.skewed:
        said.append(
            f"The draws of {listed(s.skewed)} are skewed, and a normal distribution stands for them: take the "
            "intervals for rough."
        )
    return tuple(said)


def _next_curve(c: NextCurve) -> str:
    """The force of the next specimen at the last deflection at which there is one."""
    how = seen_on(c.rig, c.thickness)
    there = np.flatnonzero(np.isfinite(c.curve[1]))
    if not there.size:
        return "No force can be predicted for the next specimen: half of the films that may come have none."
    k = int(there[-1])
    low, middle, high = (how.force(float(v)) for v in c.curve[:, k])
    place = how.place(float(c.deflection[k]))
    return (
        f"The next specimen, {1e6 * c.thickness:.4g} um thick, carries {middle} at {place}, "
        f"with 90 % between {low} and {high}."
    )


def _interval(value: dict[str, Any]) -> str:
    low, high = value["hdi_94"]
    return f"{low:.4g} to {high:.4g}"
