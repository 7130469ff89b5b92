"""Tests that no fit saw: their readings, what the model as given said, and the band of all that is probable."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayesmembrane.diagnosis.other_tests import OtherTest
from bayesmembrane.report.blocks import Block, Column, Figure, Heading, Picture, Table, points
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.style import FAINT, INK, RANGE_COLOURS
from bayesmembrane.words.language import listed
from bayesmembrane.words.loop import other_sentence
from bayesmembrane.words.seen import in_one_unit, seen

BEFORE, AFTER = RANGE_COLOURS[:2]
ACROSS = 2


def others(found: Sequence[OtherTest], end: str) -> list[Block]:
    """The heading, a sentence each, a picture of all, and the table; nothing where nothing was predicted."""
    if not found:
        return []
    return [
        Heading("Tests that no fit saw"),
        *points([other_sentence(f) for f in found]),
        _figure(found),
        *(others_table(group, f"loop predicted{end}") for group in in_one_unit(found, lambda f: seen(f.measurement))),
    ]


def others_table(found: Sequence[OtherTest], name: str) -> Table:
    """Errors before and after, and what the band holds, of tests that are read in the same units."""
    unit = seen(found[0].measurement).small[1]
    columns = (
        Column("specimen", "test"),
        Column("points", "readings", "d"),
        Column("before", f"before ({unit})"),
        Column("after", f"after ({unit})"),
        Column("inside_90", "inside the 90 % band", "%"),
    )
    rows = tuple(
        (f.measurement.specimen.name, len(f.measurement), factor * f.rmse_before, factor * f.rmse_after, f.covered)
        for f in found
        for factor in [seen(f.measurement).small[0]]
    )
    caption = (
        "Root mean squares of the readings less what was predicted: by the model as given, and by all that the "
        "diagnosis holds probable, each hypothesis with its own probability."
    )
    return Table(name, caption, columns, rows)


def _figure(found: Sequence[OtherTest]) -> Figure:
    every = (seen(group[0].measurement) for group in in_one_unit(found, lambda f: seen(f.measurement)))
    axes = listed(f"{how.load_label} over {how.travel_label}" for how in every)
    return Figure(
        others_picture(found),
        "Readings of other tests with the curve of the model as given and the band of all that is probable",
        f"{axes[0].upper()}{axes[1:]} of tests that no fit saw.",
    )


def others_picture(found: Sequence[OtherTest], kind: str = "png") -> Picture:
    """A panel for each test; loops are drawn as loops."""
    with style():
        rows = -(-len(found) // ACROSS)
        figure = new_figure(3.1 * rows, 7.2)
        panels = figure.subplots(rows, min(ACROSS, len(found)), squeeze=False).ravel()
        for ax, f in zip(panels, found, strict=False):
            m, how = f.measurement, seen(f.measurement)
            x = how.along(m.deflection)
            line = "-" if m.rig.has_path else "."
            for part in _legs(f):
                ax.fill_between(
                    x[part], how.carried(f.low[part]), how.carried(f.high[part]), color=AFTER, alpha=0.25, linewidth=0
                )
            ax.plot(x, how.carried(f.before), line, color=BEFORE, linewidth=1.4)
            ax.plot(x, how.carried(f.after), line, color=AFTER, linewidth=1.8)
            ax.plot(x, how.carried(m.force), "o", color=INK, markersize=2.2, alpha=0.7)
            ax.set_title(m.specimen.name, fontsize="small")
            ax.set_xlabel(how.travel_label)
            ax.set_ylabel(how.load_label)
            ax.grid(color=FAINT, linewidth=0.5)
        for ax in panels[len(found) :]:
            ax.set_visible(False)
        figure.legend(handles=_handles(seen(found[0].measurement).origin), loc="outside upper center", ncols=4)
        return encoded(figure, kind)


def _legs(found: OtherTest) -> list[slice]:
    """Where the disc goes one way: a band over deflection has no inside where the test turns."""
    leg = found.measurement.leg
    turns = [i for i in range(1, leg.size) if leg[i] != leg[i - 1]]
    return [slice(a, b) for a, b in zip([0, *turns], [*turns, leg.size], strict=True)]


def _handles(origin: str) -> list[Line2D | Patch]:
    return [
        Line2D([], [], color=INK, marker="o", linewidth=0, markersize=4, label=origin),
        Line2D([], [], color=BEFORE, linewidth=1.4, label="model as given"),
        Line2D([], [], color=AFTER, linewidth=1.8, label="predicted"),
        Patch(color=AFTER, alpha=0.25, label="90 % of readings"),
    ]
