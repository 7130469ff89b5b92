"""What was done to the film: loading, unloading and standing, cycle by cycle, and what of it was read off."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from bayesmembrane.data.phases import Phases
from bayesmembrane.ground.stored import read
from bayesmembrane.report.blocks import Block, Column, Figure, Picture, Table, Text
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.sections.base import Section, of_kind
from bayesmembrane.report.style import FAINT, INK, MUTED
from bayesmembrane.words.language import listed
from bayesmembrane.words.seen import Seen, seen_on

KINDS = {"loading": "#1b6ca8", "unloading": "#c1571a", "standing": "#6b8e23"}
MOST_ROWS = 40


class PhasesSection(Section):
    """One picture and one table for each film that was not just pulled once."""

    name = "phases"
    title = "Phases of the test"
    order = 21
    shows = Phases
    aside = True

    def reads(self, folder: Path) -> Any | None:
        return read(folder, "phases")

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        out: list[Block] = []
        for phases in _different(of_kind(results, Phases)):
            how = seen_on(phases.rig, phases.thickness, phases.origin)
            caption = (
                f"{phases.name}: {how.travel} ({how.travel_scale[1]}) along the test. The thin line is the largest so "
                "far. Hollow marks are turning points that were read off the curve, full ones were said by its columns."
            )
            alt = f"The {how.travel} along the test in {int(phases.cycle.max())} cycles"
            out += [Text(phases_sentence(phases, how)), Figure(picture(phases, how), alt, caption), table(phases, how)]
        return tuple(out)


def phases_sentence(phases: Phases, how: Seen) -> str:
    """What was read off, and by which rule."""
    cycles = int(phases.cycle.max())
    found = f"{len(phases.parts)} phases in {cycles} cycle{'s' if cycles > 1 else ''}"
    guessed = [name for name in ("direction", "cycle") if name not in phases.said]
    small = f"{how.travel_scale[0] * phases.jitter:.3g} {how.travel_scale[1]}".rstrip(" -")
    parts = [f"{phases.name} went through {found}."]
    if phases.said:
        parts.append(f"The columns of the curve say {listed(phases.said)}.")
    if guessed:
        columns = listed(guessed)
        parts.append(
            f"Guessed from the curve: {columns}; a reversal counts beyond {small}. Columns called {columns} in the "
            "curve settle it (direction 1 or -1; cycle 1, 2, 3)."
        )
    if phases.deflection.size < phases.readings:
        parts.append(f"{phases.deflection.size} of {phases.readings} readings are drawn, with all turning points.")
    return " ".join(parts)


def picture(phases: Phases, how: Seen, kind: str = "svg") -> Picture:
    """Travel along the test, and load against travel, coloured by what is done."""
    with style():
        figure = new_figure(3.6)
        left, right = figure.subplots(1, 2, width_ratios=[3, 2])
        along = np.arange(1.0, phases.deflection.size + 1) if phases.time is None else phases.time
        travel, load = how.along(phases.deflection), how.carried(phases.force)
        left.plot(along, how.along(phases.reached), color=MUTED, linewidth=0.8, zorder=1)
        for ax, x, y in ((left, along, travel), (right, travel, load)):
            _coloured(ax, phases, x, y)
            ax.grid(color=FAINT, linewidth=0.6)
        turns = [part[0] for part in phases.parts[1:]]
        face = INK if "direction" in phases.said else "white"
        left.plot(
            along[turns], travel[turns], "o", markersize=5, color=INK, markerfacecolor=face, linestyle="none", zorder=4
        )
        left.set_xlabel("reading (-)" if phases.time is None else "time (s)")
        left.set_ylabel(how.travel_label)
        right.set_xlabel(how.travel_label)
        right.set_ylabel(how.load_label)
        figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        return encoded(figure, kind)


def _coloured(ax: Axes, phases: Phases, x: Any, y: Any) -> None:
    """Each phase as a line from the end of the one before."""
    named: set[str] = set()
    for part in phases.parts:
        kind = _kind(phases, part[0])
        reach = np.arange(max(part[0] - 1, 0), part[-1] + 1)
        ax.plot(x[reach], y[reach], color=KINDS[kind], linewidth=1.3, label=None if kind in named else kind, zorder=2)
        named.add(kind)


def _kind(phases: Phases, reading: int) -> str:
    if phases.still[reading]:
        return "standing"
    return "loading" if phases.leg[reading] > 0 else "unloading"


def table(phases: Phases, how: Seen) -> Table:
    """One row for each phase: cycle, what is done, from where to where, how long and how fast."""
    unit = how.travel_scale[1]
    columns = (
        Column("cycle", "cycle"),
        Column("phase", "phase"),
        Column("from", f"from ({unit})"),
        Column("to", f"to ({unit})"),
        Column("seconds", "duration (s)"),
        Column("speed", f"speed ({unit if unit != '-' else '1'}/s)", ".3g"),
    )
    rows = []
    for part in phases.parts[:MOST_ROWS]:
        ends = how.along(phases.deflection[[part[0], part[-1]]])
        lasts = None if phases.time is None else float(phases.time[part[-1]] - phases.time[part[0]])
        speed = float(abs(ends[1] - ends[0])) / lasts if lasts else None
        rows.append((int(phases.cycle[part[0]]), _kind(phases, part[0]), float(ends[0]), float(ends[1]), lasts, speed))
    more = f" The first {MOST_ROWS} of {len(phases.parts)}." if len(phases.parts) > MOST_ROWS else ""
    return Table(f"phases {phases.name}", f"Phases of {phases.name}.{more}", columns, tuple(rows)).without_empty()


def _different(found: Sequence[Phases]) -> list[Phases]:
    """Those of different tests: every answer about one brings its own."""
    out: list[Phases] = []
    for p in found:
        if not any(q.readings == p.readings and np.array_equal(q.deflection, p.deflection) for q in out):
            out.append(p)
    return out
