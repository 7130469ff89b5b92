"""The tables of valleys: one row for each range, and what to measure next."""

from __future__ import annotations

from collections.abc import Sequence

from bayesmembrane.physics.convexity import RESTRICTING
from bayesmembrane.report.blocks import Column, Table, Value
from bayesmembrane.valleys.result import Valley, Valleys
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.next_test import ASSUMPTION, spoken_test
from bayesmembrane.words.seen import seen_by_valley
from bayesmembrane.words.valleys import limit_title, up_to

TESTS = 5

_COLUMNS = (
    Column("valley", "valley from ... to ..."),
    Column("length", "length", ".3g"),
    Column("unit", "in"),
    Column("condition_number", "condition number", ".2g"),
    Column("open", "open end"),
    Column("kept", "left by convexity prior: reached, box, elliptic"),
    Column("published", "published sets inside"),
    Column("next", "shortened most by"),
)


def valley_table(found: Sequence[Valleys]) -> Table:
    """One row per material and range; all are read in the same units."""
    how = seen_by_valley(found[0].ranges[0])
    columns = (
        Column("material", "material"),
        Column(
            "end" if how.bare else "end_mm",
            f"fitted up to ({how.travel_scale[1]})" if not how.bare else f"fitted up to a {how.travel} of",
        ),
        Column(f"loss_{how.load_scale[1]}", f"least loss ({how.load_scale[1]})"),
        *_COLUMNS,
    )
    rows = tuple(_row(v) for f in found for v in f.ranges)
    share = 100 * found[0].ranges[0].rise / found[0].ranges[0].best_loss
    caption = (
        f"Valleys of the loss: films on the floor that fit within {share:.3g} % of the least loss; the condition "
        "number is the squared ratio of the valley's longest to its shortest axis at the optimum."
    )
    return Table("valleys", caption, columns, rows)


def _row(v: Valley) -> tuple[Value, ...]:
    how = seen_by_valley(v)
    ends = [", ".join(f"{x:.3g}" for x in p) for p in (v.floor[0], v.floor[-1])]
    names = ", ".join(n.partition(".")[2] for n in v.chart.names)
    inside = ", ".join(p.label for p in v.published if p.within) or ("none" if v.published else "-")
    low, high = v.profiles[v.along].ends
    name = v.chart.names[v.along].partition(".")[2]
    opened = " and ".join(f"{name} to {e.value:.2g}" for e in (low, high) if e.open)
    first = v.next_tests[0] if v.next_tests else None
    return (
        spoken(v.hypothesis),
        how.rest + how.travel_scale[0] * v.end,
        how.load_scale[0] * v.best_loss,
        f"({names}) = ({ends[0]}) ... ({ends[1]})",
        v.length(v.metric),
        v.metric.unit if v.metric.unit != "-" else "ln",
        v.spectra[0].condition_number,
        (f"{opened}: {limit_title(v) or 'no end'}" if opened else "no"),
        ", ".join(f"{100 * v.share(m.name):.3g} %" for m in RESTRICTING),
        inside,
        "-" if first is None else f"{spoken_test(first.test)}: {100 * first.reduction:.0f} %",
    )


def next_table(v: Valley) -> Table:
    """The short ranked list of what to measure next."""
    columns = (
        Column("test", "test"),
        Column("reduction", "longest axis shorter by", "%"),
        Column("before", "axis now (sd)", ".2g"),
        Column("after", "axis then (sd)", ".2g"),
    )
    rows = tuple((spoken_test(t.test), t.reduction, t.axis_before, t.axis_after) for t in v.next_tests[:TESTS])
    name = f"next measurements {v.hypothesis.material.name} {seen_by_valley(v).place(v.end)}"
    caption = f"{spoken(v.hypothesis)}, fitted {up_to(v)}: what to measure next. {ASSUMPTION}"
    return Table(name, caption, columns, rows)
