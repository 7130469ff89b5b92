"""How it was made: sampling, curve cache, settings, seed and versions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from bayesmembrane.physics.cache import Tally
from bayesmembrane.report.blocks import Block, Column, Table, Value, fact, facts_table
from bayesmembrane.report.runs import Shown, end_column, ends, in_order
from bayesmembrane.report.sections.base import Section, of_kind


class MadeSection(Section):
    """What somebody needs to make it again."""

    name = "made"
    title = "How it was made"
    order = 110
    takes = (Tally,)

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        shown = in_order(of_kind(results, Shown))
        cache = next(iter(of_kind(results, Tally)), None)
        if not shown:
            return ()
        out: list[Block] = [sampling_table(shown)]
        if cache is not None or any(s.cache for s in shown):
            out.append(cache_table(shown, cache))
        common = _common([s.facts for s in shown])
        several = len(shown) > 1
        caption = "Settings, seed and versions" + (" common to all runs." if several else ".")
        out.append(facts_table("settings", caption, common))
        return [*out, *([own_facts_table(shown, common)] if several else [])]


def _common(facts: Iterable[Any]) -> dict[str, Any]:
    every = list(facts)
    return {k: v for k, v in every[0].items() if all(k in f and f[k] == v for f in every)}


def sampling_table(shown: Sequence[Shown]) -> Table:
    """How each run was sampled."""
    columns = (
        Column("run", "material"),
        end_column(shown),
        Column("status", "status"),
        Column("sampler", "proposals"),
        Column("k_hat", "Pareto k-hat (-)", ".2f"),
        Column("ess", "ESS, worst (-)", ".0f"),
        Column("r_hat", "R-hat, worst (-)", ".4f"),
        Column("tau", "autocorrelation, worst (steps)", ".0f"),
        Column("ensembles", "ensembles", "d"),
        Column("walkers", "walkers each", "d"),
        Column("steps", "steps", "d"),
        Column("burn", "of these discarded", "d"),
        Column("acceptance", "acceptance", "%"),
        Column("evaluations", "evaluations", ",d"),
        Column("failed", "numerical failures", "%"),
        Column("seconds", "time (s)", ".1f"),
    )
    rows = tuple(
        (
            s.name,
            end,
            s.sampling.status,
            s.sampling.sampler,
            s.sampling.k_hat,
            s.case.ess,
            s.case.r_hat,
            float(np.max(s.sampling.tau)),
            s.sampling.ensembles,
            s.sampling.walkers,
            s.sampling.steps,
            s.sampling.burn,
            s.sampling.acceptance,
            s.sampling.evaluations,
            s.case.failed,
            s.sampling.seconds,
        )
        for s, end in zip(shown, ends(shown), strict=True)
    )
    return Table("sampling", "How each run was sampled: steps without unit, time in s.", columns, rows)


def cache_table(shown: Sequence[Shown], total: Tally | None = None) -> Table:
    """What the curve cache did in each run, beside the films that were solved directly; and in all."""
    columns = (
        Column("run", "material"),
        end_column(shown),
        Column("hits", "found", ",d"),
        Column("from_disk", "curves read from disk", ",d"),
        Column("misses", "solved and kept", ",d"),
        Column("bypassed", "solved directly", ",d"),
        Column("rebuilt", "damaged, made anew", ",d"),
        Column("seconds_looking", "looking up (s)", ".2g"),
        Column("seconds_solving", "solving what is kept (s)", ".2g"),
        Column("seconds_saved", "saved (s)", ".2g"),
    )
    keys = [c.key for c in columns[2:]]
    rows: list[tuple[Value, ...]] = [
        (s.name, end, *(s.cache.get(k) for k in keys)) for s, end in zip(shown, ends(shown), strict=True) if s.cache
    ]
    if total is not None:
        summary = total.summary()
        rows.append(("all work, predictions included", None, *(summary[k] for k in keys)))
    caption = (
        "The curve cache, in numbers of films: those found in it, those solved once and kept, and those solved "
        "directly because draws of a material with shape parameters never repeat; curves of a material without them "
        "are scaled from one before the cache is asked. Saved: calls that needed no solution, times the mean time of "
        "one film, less the time spent looking up; negative where nothing repeats."
    )
    return Table("cache", caption, columns, tuple(rows))


def own_facts_table(shown: Sequence[Shown], common: Mapping[str, Any]) -> Table:
    """Settings in which the runs differ."""
    names = list(dict.fromkeys(k for s in shown for k in s.facts if k not in common))
    columns = (Column("run", "material"), end_column(shown), *(Column(n, n) for n in names))
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (s.name, end, *(fact(s.facts.get(n)) for n in names)) for s, end in zip(shown, ends(shown), strict=True)
    )
    return Table("settings_of_runs", "Settings in which the runs differ.", columns, rows)
