"""Our results beside those that the source paper publishes: losses of its parameter sets, and its break points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.published import PrintedSet, PublishedTable, read_published_table
from bayesmembrane.data.shipped import shipped
from bayesmembrane.data.tables import parse_table, read_text
from bayesmembrane.ground.errors import SettingsError, unknown_name
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.units import FORCE, LENGTH, SPEED
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.base import Films, rig_of


@dataclass(frozen=True)
class Compared:
    """One material over one range: Euclidean losses in N, ours and the paper's.

    Attributes
    ----------
    material, range : which
    end : m, largest deflection of the range
    ours, constrained : loss of our optimum, without and with the convexity prior (None: there is none)
    printed, evaluated : loss of the paper's optimum over this range, as printed, and with our solver on our curve; None
        if the paper has none, or the film has no curve
    least_evaluated : the least loss of any of the paper's parameter sets on our curve; None likewise
    parameters, held_parameters, published : membrane parameters of the two optima and of the paper's
    at_bound : coordinates of our optimum that stopped at a bound
    """

    material: str
    range: str
    end: float
    ours: float
    constrained: float | None
    printed: float | None
    evaluated: float | None
    least_evaluated: float | None
    parameters: dict[str, float]
    held_parameters: dict[str, float]
    published: dict[str, float]
    at_bound: tuple[str, ...] = ()


def compare_with_paper(
    measurement: Measurement,
    fits: Sequence[Fit],
    range_name: str,
    table: PublishedTable | None = None,
    solve: Solve = api.solve,
) -> tuple[Compared, ...]:
    """One row per fit of ``measurement``, which stands for the range ``range_name`` ("OP1", "OP2") of the paper.

    Raises `SettingsError` if a fit has another loss than the paper's, or the paper no such range.
    """
    table = table if table is not None else read_published_table()
    if range_name not in table.ranges:
        raise unknown_name("range of the paper", range_name, table.ranges)
    return tuple(_compared(measurement, found, range_name, table, solve) for found in fits)


def _compared(measurement: Measurement, found: Fit, name: str, table: PublishedTable, solve: Solve) -> Compared:
    if found.loss != "euclidean":
        raise SettingsError("the paper's losses are Euclidean, and the fit is not", remedy="fit with --loss euclidean")
    rows = [row for row in table.rows if row.material == found.hypothesis.material.name]
    loss = {row.column: _loss(measurement, row, solve) for row in rows}
    own = next((row for row in rows if row.column == name), None)
    finite = [v for v in loss.values() if v is not None]
    return Compared(
        material=found.hypothesis.material.name,
        range=name,
        end=float(np.max(measurement.deflection)),
        ours=found.loss_N,
        constrained=None if found.constrained is None else found.constrained.loss_N,
        printed=None if own is None else float(own.loss[table.ranges.index(name)]),
        evaluated=loss.get(name),
        least_evaluated=min(finite) if finite else None,
        parameters=_short(found),
        held_parameters={} if found.constrained is None else _short(found.constrained),
        published={} if own is None else dict(zip(own.names, own.values, strict=True)),
        at_bound=found.at_bound,
    )


def _short(found: Fit) -> dict[str, float]:
    return {name.partition(".")[2]: e.value for name, e in found.parameters.items()}


def _loss(measurement: Measurement, row: PrintedSet, solve: Solve) -> float | None:
    """|F - y| of a published parameter set on our curve, N; None where the film has no curve."""
    films = Films(material(row.material), np.array([row.values]), solve=solve)
    force = rig_of(measurement).curves(films, measurement, measurement.deflection).force[0]
    loss = float(np.linalg.norm(force - measurement.force))
    return loss if np.isfinite(loss) else None


@dataclass(frozen=True)
class BreakPoint:
    """Where a specimen of some thickness broke: m, m, N. Films of one silicone differ in thickness alone."""

    specimen: str
    thickness: float
    deflection: float
    force: float


def paper_break_points() -> tuple[BreakPoint, ...]:
    """The break points that the source paper publishes, from the file that ships."""
    path = shipped("paper_break_points.csv")
    table = parse_table(read_text(path), str(path))
    columns = [table.require("thickness", LENGTH), table.require("deflection", LENGTH), table.require("force", FORCE)]
    values = zip(*(table.column(*c) for c in columns), strict=True)
    names = (row[table.header.index("specimen")] for row in table.rows)
    return tuple(BreakPoint(n, *(float(v) for v in row)) for n, row in zip(names, values, strict=True))


@dataclass(frozen=True)
class SpeedTest:
    """The force in N at 100 mm on a film of 50 um that was lifted at ``speed`` m/s."""

    speed: float
    force: float


def paper_rates() -> tuple[SpeedTest, ...]:
    """The forces at three crosshead speeds that the source paper publishes, from the file that ships."""
    path = shipped("paper_rates.csv")
    table = parse_table(read_text(path), str(path))
    speed, force = (table.column(*table.require(*c)) for c in (("speed", SPEED), ("force", FORCE)))
    return tuple(SpeedTest(float(v), float(f)) for v, f in zip(speed, force, strict=True))
