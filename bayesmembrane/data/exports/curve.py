"""From the columns of an export to the curve of a rig: time, zero, sign; each guess said."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.data.exports.blocks import NumberBlock, names_beyond
from bayesmembrane.data.exports.columns import TRUE, Read, trimmed
from bayesmembrane.data.exports.export import Export
from bayesmembrane.data.exports.film import Film, film_of
from bayesmembrane.data.exports.hints import Guess, Hints
from bayesmembrane.data.exports.parts import facts_beside, part
from bayesmembrane.data.exports.redundant import compare_rest
from bayesmembrane.data.exports.relations import far_ends, gaps, jumps, speed_against
from bayesmembrane.data.exports.sheets import Sheet
from bayesmembrane.data.exports.signs import carried, signed, zero_told, zeroed, zeroed_force
from bayesmembrane.data.exports.strip import nominal_of, stretch_of
from bayesmembrane.data.exports.words import COMPRESSION, CYCLE, STRAIN, STRETCH, TRAVEL, plain
from bayesmembrane.data.motion import check_order, holds, legs
from bayesmembrane.data.thinning import kept_rows
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, STRESS, TIME

_CYCLE = re.compile(r"(?P<number>\d{1,6})(?:[-_ ]+(?P<word>[A-Za-z]+))?")
_WAYS = {
    1: ("stretch", "load", "up", "belast"),
    -1: ("recover", "unload", "down", "release", "entlast"),
    0: ("hold", "rest"),
}


@dataclass(frozen=True)
class Curve:
    """What an export says, in SI: the columns of a rig's curve, the film, and how it was understood."""

    columns: Mapping[str, Array]
    film: Film
    rig: str
    lines: Sequence[int]
    guesses: Sequence[Guess]
    contradictions: Sequence[str]
    notes: Sequence[str]


def curve_of(sheets: Sequence[Sheet], file: str, hints: Hints) -> Curve:
    """The curve in the sheets of a file; raises `DataError` or `SettingsError` where that is not sure."""
    block, found, blocks = part(sheets, file, hints)
    export = Export(file, hints, block, found, guesses=list(block.sheet.guesses))
    if len(sheets) > 1:
        export.guess("sheet", block.sheet.name, "it has the readings", "--sheet")
    facts, remarks, name = facts_beside(sheets, blocks, block)
    film = film_of(facts, hints, name, export, grips=not {c.role for c in found} & {STRAIN, STRETCH})
    export.lengths = [f for f in facts if f.name.endswith("length")]
    export.notes += remarks
    export.rows = trimmed(block, found)
    if len(export.rows) < 2:
        raise DataError(f"a curve needs at least two points, and this one has {len(export.rows)}", block.place)
    time = _time(export)
    strip = _is_strip(export, film)
    columns = _strip(export, film, time) if strip else _plain(export, film, time)
    _refuse_nonsense(export, columns)
    _checked_order(export, columns)
    for what in ("force", "nominal_stress", "deflection", "stretch"):
        if what in columns:
            for sentence in (jumps, far_ends):
                export.contradict(sentence(what.replace("_", " "), columns[what], export.lines))
    if TIME in columns:
        export.contradict(gaps(columns[TIME], export.lines))
    _outside(export, blocks)
    ignored = [c.header for c in block.columns if c.header and c.at not in export.used] + names_beyond(block)
    if ignored:
        export.notes.append(f"ignored columns: {', '.join(ignored)}")
    rig = hints.rig or ("uniaxial" if strip else "")
    film = replace(film, length=film.length or export.length)
    columns = _thinned(export, columns)
    return Curve(columns, film, rig, export.lines, export.guesses, export.contradictions, export.notes)


def _outside(export: Export, blocks: Sequence[NumberBlock]) -> None:
    """Say which lines look like readings and stand outside of them; refuse where there are many."""
    block = export.block
    for other in blocks:
        alike = other.sheet is block.sheet and other.header is None and other.numbers == block.numbers
        if not alike or other.rows[0] in set(block.rows):
            continue
        if len(other.rows) > 1:
            fault = f"the readings from {other.sheet.line(other.rows[0])} on stand above the line that names them"
            raise DataError(fault, block.place, "put the names above all readings, or say --columns")
        export.contradict(f"{other.sheet.line(other.rows[0])} looks like a reading and stands outside of them")


def _is_strip(export: Export, film: Film) -> bool:
    """Whether the curve is one of stretch and nominal stress; a guess unless the rig was said."""
    rig, roles = export.hints.rig, {c.role for c in export.found}
    if rig:
        return _homogeneous(rig)
    if {TRAVEL, FORCE} <= roles and not (STRESS in roles and roles & {STRAIN, STRETCH}):
        sizes = {"--width-mm": film.width, "--thickness-um": film.thickness}
        if not roles & {STRAIN, STRETCH}:
            sizes["--gauge-length-mm"] = film.length
        missing = [option for option, size in sizes.items() if not size]
        if missing:
            why = f"the file does not say it; a strip needs --rig uniaxial {' '.join(missing)}"
            export.guess("rig", "none yet, the curve is deflection and force", why, "--rig")
            if any(size for option, size in sizes.items() if option != "--thickness-um"):  # every film has that
                export.contradict(f"some sizes of a strip are known and others are not: say {' '.join(missing)}")
            return False
    why = "the file has strain or stress" if roles & {STRAIN, STRETCH, STRESS} else "the file has length and width"
    export.guess("rig", "uniaxial", why, "--rig")
    return True


def _homogeneous(rig: str) -> bool:
    from bayesmembrane.ground.registry import component

    if rig == "biaxial":
        raise SettingsError(
            "a biaxial test has two forces", remedy="bring stretch_1, stretch_2 and both stresses as CSV"
        )
    kind = component("rigs", rig)
    if kind.homogeneous and "stretch" not in kind.columns:
        names = " and ".join(kind.columns)
        raise SettingsError(f'the rig "{rig}" is not read from exports', remedy=f"bring {names} as CSV")
    return bool(kind.homogeneous)


def _time(export: Export) -> Array | None:
    """(N,) s, or None; readings that bear the time of the one before are left aside."""
    rate = export.hints.readings_per_s
    if rate is not None:
        export.guess("time", f"{rate:g} readings a second", "it was said", "--readings-per-s")
        return np.arange(len(export.rows)) / rate
    found = export.column(TIME)
    if found is None:
        return None
    step = np.diff(found.values)
    if np.any(step < 0):
        k = 1 + int(np.argmax(step < 0))
        fault = f"the time falls ({found.values[k]:g} s after {found.values[k - 1]:g} s)"
        where = export.block.sheet.place(export.rows[k])
        raise DataError(
            fault, where, "keep one test only; or leave the times aside with --columns and --readings-per-s"
        )
    same = np.append(False, step == 0)
    if np.mean(same) > 0.5:
        fault = f"{np.sum(same)} of {same.size} readings bear the time of the one before"
        raise DataError(fault, export.block.place, "leave the times aside with --columns, and say --readings-per-s")
    if np.any(same):
        lines = np.array(export.lines)[same]
        export.notes.append(
            f"{lines.size} readings that bear the time of the one before are left aside "
            f"(lines {lines[0]} to {lines[-1]})"
        )
    export.rows = [r for r, again in zip(export.rows, same, strict=True) if not again]
    return np.asarray(found.values[~same])


def _checked_order(export: Export, columns: Mapping[str, Array]) -> None:
    """Raise `DataError` where readings without times cannot be in the order of a test."""
    if TIME in columns:
        return
    travel = columns.get("deflection", columns.get("stretch"))
    assert travel is not None
    try:
        check_order(travel, [export.block.sheet.place(r) for r in export.rows])
    except DataError as error:
        remedy = (
            f"say how often it was read, --readings-per-s 10, if this is the order of the test; else {error.remedy}"
        )
        raise DataError(
            error.what.replace("mm", "") if "stretch" in columns else error.what, error.where, remedy
        ) from None


def _plain(export: Export, film: Film, time: Array | None) -> dict[str, Array]:
    """Deflection and force, positive for a lifted disc."""
    travel, force = export.need(TRAVEL), export.need(FORCE)
    x, f = signed(export, travel.values, force.values, free=True)
    x = zeroed(export, travel, x, f)
    f = zeroed_force(export, f)
    _against_speed(export, film, x, time)
    return _with(export, time, {"deflection": x, "force": f})


def _strip(export: Export, film: Film, time: Array | None) -> dict[str, Array]:
    """Stretch, and nominal stress in Pa."""
    force = export.column(FORCE)
    stress, true = _stresses(export)
    stretch, travel = stretch_of(export, film, force or stress or true)
    force, stress, true = (carried(export, load) for load in (force, stress, true))
    zero_told(export, force or stress or true, "force" if force is not None else "stress")
    nominal = nominal_of(export, film, (force, stress, true), stretch)
    if np.any(stretch <= 0):
        k = int(np.argmin(stretch))
        fault = f"a stretch of {stretch[k]:g} cannot be"
        raise DataError(fault, export.block.sheet.place(export.rows[k]), "check --gauge-length-mm, --zero and --strain")
    compare_rest(export, stretch, nominal)
    if travel is not None:
        _against_speed(export, film, travel, time)
    return _with(export, time, {"stretch": stretch, "nominal_stress": nominal})


def _stresses(export: Export) -> tuple[Read | None, Read | None]:
    """(stress, true stress), one of them or none: the true one only where that was said, or there is no other."""
    true_first = export.hints.stress == TRUE
    true = export.column(STRESS, TRUE) if true_first else None
    stress = export.column(STRESS, "|engineering") if true is None else None
    if stress is None and not true_first:
        true = export.column(STRESS, TRUE)
    return stress, true


def _with(export: Export, time: Array | None, columns: dict[str, Array]) -> dict[str, Array]:
    columns = {**columns, **_said_phases(export)}
    return columns if time is None else {TIME: time, **columns}


def _said_phases(export: Export) -> dict[str, Array]:
    """``cycle`` and ``direction``, (N,), as a column of the machine says them: 1, 2 or 1-Stretch, 1-Recover."""
    chosen = next((c for c in export.found if c.role == CYCLE), None)
    if chosen is None:
        return {}
    cells = [export.block.sheet.cells(r)[chosen.column.at : chosen.column.at + 1] for r in export.rows]
    numbers = [export.block.sheet.marks.number(c[0]) if c else None for c in cells]
    texts = [f"{v:g}" if v is not None else str(c[0]) if c else "" for v, c in zip(numbers, cells, strict=True)]
    said = [_CYCLE.fullmatch(text) for text in texts]
    number = np.array([float(s["number"]) if s else np.nan for s in said])
    header = f'"{chosen.column.header}"'
    if not np.all(np.diff(number) >= 0):
        export.notes.append(f"{header} does not count cycles in their order and is not used")
        return {}
    export.used.add(chosen.column.at)
    found = {"cycle": 1.0 + number - number[0]}
    ways = [_way(s["word"] if s else "") for s in said]
    if ways[0] and None not in ways:
        found["direction"] = np.array([float(w) for w in _carried_on([w or 0 for w in ways])])
    export.guess(" and ".join(found), f"as {header} says", "it counts them", "--columns")
    return found


def _way(word: str | None) -> int | None:
    """1 for words of loading, -1 of unloading, 0 of standing, None for any other."""
    low = (word or "").lower()
    return next((way for way, words in _WAYS.items() if low.startswith(words)), None)


def _carried_on(ways: Sequence[int]) -> list[int]:
    """The direction of each reading; a hold belongs to the leg before it."""
    out: list[int] = []
    for way in ways:
        out.append(way or out[-1])
    return out


def _thinned(export: Export, columns: dict[str, Array]) -> dict[str, Array]:
    """As many readings as were asked for, with all turning points."""
    most, travel = export.hints.readings, columns.get("deflection", columns.get("stretch"))
    if most is None or travel is None or travel.size <= most:
        return columns
    rows = kept_rows(legs(travel), holds(travel), most)
    why = "so many were asked for; they lie evenly along the test, with all turning points and ends of holds"
    export.guess("readings", f"{rows.size} of {travel.size}", why, "--readings")
    return {name: values[rows] for name, values in columns.items()}


def _against_speed(export: Export, film: Film, travel: Array, time: Array | None) -> None:
    if time is not None and film.speed:
        export.contradict(speed_against(travel, time, film.speed, export.lines))


def _refuse_nonsense(export: Export, columns: Mapping[str, Array]) -> None:
    """Raise `DataError` where nothing moves, nothing is carried, or what was pressed gets longer."""
    for name, what in (
        ("deflection", "travel"),
        ("stretch", "stretch"),
        ("force", "force"),
        ("nominal_stress", "stress"),
    ):
        if name in columns and np.ptp(columns[name]) == 0:
            raise DataError(
                f"the {what} is the same in all rows", export.block.place, "check which column is which, --columns"
            )
    above = [str(c) for r in range(min(20, len(export.block.sheet))) for c in export.block.sheet.cells(r)[:3]]
    text = plain(" ".join([*above, *(c.header for c in export.block.columns if c.at in export.used)]))
    pulls = columns.get("stretch")
    longer = pulls is not None and float(np.max(pulls)) - 1 > max(1 - float(np.min(pulls)), 0.0)
    if longer and COMPRESSION.search(text) and not export.hints.sign:
        fault = "the file speaks of compression, and the film gets longer in it"
        raise DataError(fault, export.block.place, "say --rig compression if it was pressed, --sign keep if not")
