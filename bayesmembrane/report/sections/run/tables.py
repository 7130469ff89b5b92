"""The tables of one run: its natural parameters, and the coordinates that were sampled."""

from __future__ import annotations

import numpy as np

from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.ground.draws import shortest_interval
from bayesmembrane.report.blocks import Column, Table
from bayesmembrane.report.runs import Shown
from bayesmembrane.words.language import spoken_parameter


def parameters_table(s: Shown, compared: Compared | None = None) -> Table:
    """Natural parameters of one run: posterior, our optimum, the paper's."""
    columns = (
        Column("parameter", "parameter"),
        Column("unit", "unit"),
        Column("mean", "mean", ".5g"),
        Column("sd", "sd", ".2g"),
        Column("hdi_low", "94 % from"),
        Column("hdi_high", "to"),
        Column("optimum", "least squares", ".5g"),
        Column("optimum_convex", "least squares, convex", ".5g"),
        Column("paper", "paper", ".5g"),
    )
    ours = compared.parameters if compared else {}
    held = compared.held_parameters if compared else {}
    paper = compared.published if compared else {}
    rows = []
    for i, (name, unit) in enumerate(zip(s.hypothesis.natural_names, s.hypothesis.natural_units, strict=True)):
        factor, read = s.read_as(name, unit)
        own, values = name.partition(".")[2], factor * s.natural[:, i]
        material = name.startswith(f"{s.material}.")
        low, high = shortest_interval(values, 0.94)
        rows.append(
            (
                spoken_parameter(name),
                read,
                float(np.mean(values)),
                float(np.std(values)),
                low,
                high,
                *(d.get(own) if material else None for d in (ours, held, paper)),
            )
        )
    caption = "Parameters of the membrane: posterior mean, standard deviation and shortest interval that holds 94 %."
    return Table(f"parameters {s.key}", caption, columns, tuple(rows)).without_empty()


def coordinates_table(s: Shown) -> Table:
    """The coordinates that were sampled: meaning, prior, and what the chains are worth."""
    columns = (
        Column("coordinate", "coordinate"),
        Column("unit", "unit"),
        Column("meaning", "meaning"),
        Column("prior", "prior"),
        Column("mean", "posterior mean", ".5g"),
        Column("sd", "posterior sd", ".2g"),
        Column("tau", "autocorrelation (steps)", ".0f"),
    )
    rows = tuple(
        (
            spoken_parameter(p.name),
            p.unit,
            p.meaning,
            str(p.prior),
            float(np.mean(s.x[:, i])),
            float(np.std(s.x[:, i])),
            float(s.sampling.tau[i]),
        )
        for i, p in enumerate(s.hypothesis.parameters)
    )
    return Table(f"coordinates {s.key}", "Coordinates that were sampled, with their priors.", columns, rows)
