"""Stretch and nominal stress of a strip: as an export states them, or by the sizes of the specimen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.data.exports.columns import Read, best, read
from bayesmembrane.data.exports.export import Export
from bayesmembrane.data.exports.film import Film
from bayesmembrane.data.exports.relations import contradiction, gauge_length_behind, logarithmic_length_behind
from bayesmembrane.data.exports.signs import lengthened, signed, zeroed
from bayesmembrane.data.exports.words import STRAIN, STRETCH, TRAVEL
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array


def stretch_of(export: Export, film: Film, load: Read | None) -> tuple[Array, Array | None]:
    """(stretch (N,), travel (N,) m or None): by the gauge length if it was said, else as the file has it."""
    roles = {c.role for c in export.found}
    travel = _travel(export, load) if TRAVEL in roles else None
    by_length = 1.0 + travel / film.length if travel is not None and film.length else None
    stated = _stated_stretch(export, travel, load) if roles & {STRAIN, STRETCH} else None
    if by_length is not None and (stated is None or export.hints.gauge_length):
        if stated is not None:
            export.contradict(
                contradiction("travel over gauge length and the file's own strain", by_length, stated, export.lines)
            )
        export.guess(
            "stretch", "1 + travel / gauge length", f"the gauge length is {1e3 * (film.length or 0):g} mm", "--columns"
        )
        return by_length, travel
    if stated is None:
        others = ", ".join(f'"{f.words}" ({f.place})' for f in export.lengths if f.name in ("length", "strain_length"))
        told = f", and nothing says whether it is {others}" if others else ""
        fault = f"the travel cannot become a stretch: the gauge length is not known{told}"
        raise DataError(fault, export.block.place, "say --gauge-length-mm")
    if by_length is not None:
        export.contradict(
            contradiction("travel over gauge length and the file's own strain", by_length, stated, export.lines)
        )
    return stated, travel


def _travel(export: Export, load: Read | None) -> Array:
    travel = export.need(TRAVEL)
    f = load.values if load is not None else np.zeros(travel.values.size)
    x, _ = signed(export, travel.values, f, free=False)
    return zeroed(export, travel, x, f)


def _stated_stretch(export: Export, travel: Array | None, load: Read | None) -> Array:
    """1 + e, exp(e) or l, as the file's column of strain or stretch says."""
    stretch = export.column(STRETCH)
    if stretch is not None:
        if abs(stretch.values[0]) < 0.3 and np.min(np.abs(stretch.values)) < 0.1:
            fault = (
                f'"{stretch.column.header}" is called a stretch and starts at {stretch.values[0]:g}, as a strain does'
            )
            raise DataError(fault, export.block.place, f'say what it is, --columns "strain={stretch.column.header}"')
        return stretch.values
    strain = _strain(export, travel)
    e, kind = strain.values, export.hints.strain or strain.kind
    name = f'"{strain.column.header}"'
    if kind == "stretch":
        export.guess("strain", f"{name} is a stretch", "it was said", "--strain")
        return e
    if not kind and float(np.min(e)) > 0.9 and abs(e[0] - 1) < 0.1:
        fault = f"{name} is called a strain and starts at {e[0]:g}, as a stretch does"
        raise DataError(fault, export.block.place, "say --strain stretch, or engineering if it is one")
    e = lengthened(export, e, travel, load)
    if "travel" in export.hints.zero:
        e = e - e[0]
    elif abs(e[0]) > 0.01 * float(np.ptp(e)):
        export.guess("zero of the strain", f"as the file has it, it starts at {e[0]:.4g}", "it is near", "--zero")
    if kind:
        why = "it was said" if export.hints.strain else "its name says so"
        export.guess("strain", f"{name} is {kind}", why, "--strain")
        return np.exp(e) if kind == "true" else 1.0 + e
    return _unnamed_strain(export, name, e, travel)


def _unnamed_strain(export: Export, name: str, e: Array, travel: Array | None) -> Array:
    """A strain that does not say whether it is engineering or true: asked of the travel, if there is one."""
    why = "machines write change of length over length at rest, and the file does not say"
    if travel is not None:
        (length, linear), (other, logarithmic) = gauge_length_behind(travel, e), logarithmic_length_behind(travel, e)
        if linear < 0.01:
            why = f"it is the travel over {1e3 * length:.5g} mm"
            export.length = float(f"{length:.6g}")
            _against_length(export, length)
        elif logarithmic < 0.01:
            export.guess("strain", f"{name} is true", f"it is ln(1 + travel / {1e3 * other:.5g} mm)", "--strain")
            return np.exp(e)
    export.guess("strain", f"{name} is engineering", why, "--strain")
    return 1.0 + e


def _against_length(export: Export, length: float) -> None:
    """A contradiction if the export states another length than the one that its strain is made with."""
    for fact in export.lengths:
        if fact.name != "strain_length" and fact.name != "length" and abs(fact.value / length - 1) > 0.02:
            export.contradict(
                f'the strain is the travel over {1e3 * length:.5g} mm, and "{fact.words}" ({fact.place}) is not'
            )


def _strain(export: Export, travel: Array | None) -> Read:
    """The column of strain, the engineering one of two; its unit from the data where the file names none."""
    kinds = ("true", "|engineering") if export.hints.strain == "true" else ("|engineering", "true")
    of_kind = ((k, best(export.found, STRAIN, export.block, k)) for k in kinds)
    kind, chosen = next((k, c) for k, c in of_kind if c is not None)
    if not chosen.unit:
        bare = read(export.block, replace(chosen, unit="one"), export.rows, export.hints)
        largest = float(np.max(np.abs(bare.values)))
        unit = "percent" if largest > 15 else "one" if largest < 1.0 and export.hints.strain else ""
        if unit:
            why = f"the file names no unit, and its largest value is {largest:g}"
            export.guess("unit of the strain", unit, why, "--units strain=percent or 1")
            export.found = [c if c is not chosen else replace(chosen, unit=unit) for c in export.found]
    found = export.column(STRAIN, kind)
    assert found is not None
    return found


def nominal_of(
    export: Export, film: Film, loads: tuple[Read | None, Read | None, Read | None], stretch: Array
) -> Array:
    """(N,) Pa: force over width and thickness at rest, or as the file has it."""
    force, stress, true = loads
    area = film.width * film.thickness if film.width and film.thickness else None
    by_force = force.values / area if force is not None and area else None
    kind = export.hints.stress or (stress.kind if stress is not None else "")
    if stress is not None and kind == "true":
        true, stress = stress, None
    if true is not None and by_force is not None:
        what = "true stress and force over width and thickness times stretch"
        export.contradict(contradiction(what, true.values, by_force * stretch, export.lines, true.unit))
    if stress is not None and by_force is not None:
        export.contradict(
            contradiction(
                "stress and force over width and thickness", stress.values, by_force, export.lines, stress.unit
            )
        )
    if by_force is not None and (stress is None or (export.hints.width and export.hints.thickness)):
        size = f"{1e3 * (film.width or 0):g} mm times {1e3 * (film.thickness or 0):g} mm"
        export.guess("nominal stress", "force / (width x thickness)", f"the specimen is {size}", "--columns")
        return by_force
    if stress is not None:
        return _as_nominal(export, stress, kind, force, stretch)
    if true is not None:
        export.guess(
            "nominal stress",
            f'"{true.column.header}" over the stretch',
            "it is true, of an incompressible film",
            "--stress",
        )
        return true.values / stretch
    missing = [o for o, v in (("--width-mm", film.width), ("--thickness-um", film.thickness)) if not v]
    fault = "the force cannot become a nominal stress: width and thickness of the film are not known"
    raise DataError(fault, export.block.place, f"say {' and '.join(missing)}, or --rig annulus if it is no strip")


def _as_nominal(export: Export, stress: Read, kind: str, force: Read | None, stretch: Array) -> Array:
    name = f'"{stress.column.header}"'
    if kind:
        export.guess(
            "stress", f"{name} is engineering", "it was said" if export.hints.stress else "its name says so", "--stress"
        )
        return stress.values
    why = "machines write force over area at rest, and the file does not say"
    if force is not None and np.ptp(stretch) > 0.05:
        area, scatter = _areas(force.values, stress.values)
        _, grown = _areas(force.values * stretch, stress.values)
        if grown < 0.2 * scatter and grown < 0.01:
            export.guess("stress", f"{name} is true", "it grows with force times stretch", "--stress")
            return stress.values / stretch
        if scatter < 0.01:
            why = f"it is the force over {1e6 * area:.4g} mm2"
    export.guess("stress", f"{name} is engineering", why, "--stress")
    return stress.values


def _areas(force: Array, stress: Array) -> tuple[float, float]:
    """(A in m^2, part of the range by which stress = force / A fails)."""
    product = float(np.dot(force, stress))
    if product <= 0 or not np.ptp(stress):
        return np.nan, np.inf
    area = float(np.dot(force, force)) / product
    return area, float(np.max(np.abs(force / area - stress)) / np.ptp(stress))
