"""The page on the paper's break points and speeds: tables, and the sentences that follow from their numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from bayesmembrane.calibration.beside_paper import BreakPoint, SpeedTest
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from tests.studies.paper_breaks import (
    LEVEL,
    SPEEDS_AT,
    Film,
    Scatter,
    between,
    beyond_scatter,
    specimens_needed,
    trend,
    within,
)


def page(
    curve: Measurement,
    breaks: Sequence[BreakPoint],
    rates: Sequence[SpeedTest],
    scaled: Array,
    films: Sequence[Film],
) -> str:
    """Markdown of the whole page."""
    thickness = [b.thickness for b in breaks]
    force = np.array([b.force for b in breaks])
    known = np.isfinite(scaled)
    ratio = np.log(force[known] / scaled[known])
    carried = within(ratio, [t for t, k in zip(thickness, known, strict=True) if k])
    parts = [
        "# The paper's break points and its three speeds",
        "Made by `python -m tests.studies.paper_breaks` from numbers that the paper prints (six specimens, two of each "
        "thickness, deflection and force at break; the force at 100 mm at three speeds) and from the curve of specimen "
        "1 that was reconstructed from its losses. Tests are on logarithms, so that scatter is a part of the value.",
        "## Where the specimens broke",
        _table(breaks, scaled, films),
        "\n".join(_breaking(breaks)),
        "## Does the force go with the thickness?",
        "\n".join(_proportional(breaks, scaled, carried)),
        "\n".join(_films(breaks, films, scaled, float(curve.deflection[-1]))),
        "## Speed",
        "\n".join(_speed(curve, rates, carried)),
        "## What these numbers cannot tell",
        "\n".join(_open(rates, carried)),
    ]
    return "\n\n".join(parts) + "\n"


def _table(breaks: Sequence[BreakPoint], scaled: Array, films: Sequence[Film]) -> str:
    head = "| specimen | thickness, um | broke at, mm | force, N | force over thickness, N/mm | curve x thickness, N |"
    head += "".join(f" {f.title}, N |" for f in films)
    rows = [head, "|" + "---|" * (head.count("|") - 1)]
    for i, b in enumerate(breaks):
        cells = [b.specimen, f"{1e6 * b.thickness:.0f}", f"{1e3 * b.deflection:.0f}", f"{b.force:.1f}"]
        cells += [f"{1e-3 * b.force / b.thickness:.0f}", _newtons(scaled[i]), *(_newtons(f.force[i]) for f in films)]
        rows.append("| " + " | ".join(cells) + " |")
    rows.append("| misses the curve by | | | | | | " + " | ".join(f"{f.rmse:.2g}" for f in films) + " |")
    note = (
        'Curve x thickness: the curve of specimen 1 at that deflection times thickness / 50 um, "-" beyond its end. '
        "Energies: fitted to the whole curve by least squares, root mean square in the last row, and scaled alike."
    )
    return "\n".join(rows) + "\n\n" + note


def _newtons(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"


def _breaking(breaks: Sequence[BreakPoint]) -> list[str]:
    """Thickness and what the specimens bore: analysis of variance with the pairs as the error."""
    thickness = [b.thickness for b in breaks]
    measures = {
        "deflection at break": ([1e3 * b.deflection for b in breaks], "mm"),
        "force at break": ([b.force for b in breaks], "N"),
        "force over thickness at break": ([1e-3 * b.force / b.thickness for b in breaks], "N/mm"),
    }
    told, shown = [], {}
    for words, (values, unit) in measures.items():
        logs = np.log(values)
        pairs, p = within(logs, thickness), between(logs, thickness)
        shown[words] = p < LEVEL
        means = {t: np.exp(np.mean(logs[[x == t for x in thickness]])) for t in dict.fromkeys(thickness)}
        listed = ", ".join(f"{v:.3g} {unit} at {1e6 * t:.0f} um" for t, v in means.items())
        verdict = "thickness matters" if p < LEVEL else "no effect of thickness is shown"
        told.append(
            f"- {words[0].upper()}{words[1:]}: {listed}; pairs scatter by {_percent(pairs)}. {_p(p)}: {verdict}."
        )
    thin = np.mean([b.force / b.thickness for b in breaks if b.thickness == min(thickness)])
    for t in sorted(set(thickness))[1:]:
        own = np.mean([b.force for b in breaks if b.thickness == t])
        told.append(
            f"- With the mean force over thickness of the thinnest films, those of {1e6 * t:.0f} um would have borne "
            f"{thin * t:.0f} N; they bore {own:.1f} N, {thin * t - own:.0f} N less."
        )
    if shown["force over thickness at break"] and not shown["force at break"]:
        told.append(
            "- A limit of the film's stretch or stress would make the force at break go with the thickness: it does "
            "not. A limit of the force itself, as of the glue or of the edge of the disc, is not contradicted."
        )
    return [*told, _second(breaks)]


def _second(breaks: Sequence[BreakPoint]) -> str:
    """The second specimen of each pair was covered with colour."""
    pairs = [[b.force for b in breaks if b.thickness == t] for t in dict.fromkeys(b.thickness for b in breaks)]
    change = np.array([b - a for a, b in pairs])
    p = float(stats.ttest_1samp([np.log(b / a) for a, b in pairs], 0.0).pvalue)
    return (
        "- The second film of each pair, and only that, was covered with blue colour. It broke at a force "
        f"{', '.join(f'{c:+.1f}' for c in change)} N different (mean {change.mean():+.1f} N; {_p(p)}): colour and "
        "scatter cannot be told apart, and the scatter of the pairs may hold an effect of the colour."
    )


def _proportional(breaks: Sequence[BreakPoint], scaled: Array, carried: Scatter) -> list[str]:
    """Forces over those of the scaled curve at the same deflection, for specimens that broke within it."""
    known = [(b, s) for b, s in zip(breaks, scaled, strict=True) if np.isfinite(s)]
    ratios = ", ".join(f"{b.force / s:.2f} ({1e6 * b.thickness:.0f} um)" for b, s in known)
    low, high = carried.interval
    told = [
        "- In a membrane the force at a deflection is proportional to the thickness. Force at break over that of the "
        f"scaled curve at the same deflection: {ratios}; 1 is expected.",
        f"- Within pairs these ratios scatter by {_percent(carried)} (95 %: {100 * low:.0f} to {100 * high:.0f} %; "
        f"{carried.dof} degrees of freedom).",
    ]
    for t in dict.fromkeys(b.thickness for b, _ in known):
        logs = np.array([np.log(b.force / s) for b, s in known if b.thickness == t])
        # The curve is that of one specimen and scatters as one.
        half = carried.half_width(1 / logs.size + 1)
        factor, force = np.exp(logs.mean()), np.mean([s for b, s in known if b.thickness == t])
        off = abs(logs.mean()) > half
        told.append(
            f"- {1e6 * t:.0f} um: {factor:.2f} times what proportionality asks for, 95 % {factor * np.exp(-half):.2f} "
            f"to {factor * np.exp(half):.2f}, that is {force * (factor - 1):+.1f} N of {force:.1f} N. "
            + ("Not proportional." if off else "Proportionality is not contradicted, and hardly tested.")
        )
    return told


def _films(breaks: Sequence[BreakPoint], films: Sequence[Film], scaled: Array, end: float) -> list[str]:
    """Predictions at the breaks, within the range of the curve and beyond it."""
    force = np.array([b.force for b in breaks])
    inside = np.isfinite(scaled)
    best = min(films, key=lambda f: f.rmse)
    told = []
    for words, part in (("within the range of the curve", inside), ("beyond its end", ~inside)):
        if not np.any(part):
            continue
        spans = ", ".join(
            f"{f.title} {_span(f.force[part] / force[part])}" for f in films if np.any(np.isfinite(f.force[part]))
        )
        told.append(f"- Predicted over published force {words} ({np.count_nonzero(part)} specimens): {spans}.")
    reached = ", ".join(f"{s:.1f} ({1e6 * b.thickness:.0f} um)" for b, s in zip(breaks, best.stretch, strict=True))
    told.append(
        f"- Largest stretch at break by {best.title}, which misses the curve least: {reached}; the curve ends at "
        f"{1e3 * end:.1f} mm, and what lies beyond is no prediction to rely on."
    )
    return told


def _span(ratio: Array) -> str:
    known = ratio[np.isfinite(ratio)]
    lost = ratio.size - known.size
    return f"{known.min():.3g} to {known.max():.3g}" + (f" ({lost} without a solution)" if lost else "")


def _speed(curve: Measurement, rates: Sequence[SpeedTest], carried: Scatter) -> list[str]:
    speed, force = np.array([(r.speed, r.force) for r in rates]).T
    decades, logs = np.log10(speed), np.log(force)
    line = stats.linregress(decades, force)
    slope, half = trend(decades, logs, carried)
    steps = ", ".join(f"{1e3 * v:g} mm/s {f:.1f} N" for v, f in zip(speed, force, strict=True))
    end, at_end = float(curve.force[-1]), 1e3 * float(curve.deflection[-1])
    same = float(force[np.argmin(np.abs(np.log(speed / 1e-3)))])
    middle, powers = float(np.exp(np.mean(logs))), np.diff(logs) / np.diff(np.log(speed))
    p = beyond_scatter(logs, carried)
    return [
        f"- Force at {1e3 * SPEEDS_AT:.0f} mm: {steps}, one test each. From the slowest to the fastest it rises by "
        f"{force[-1] - force[0]:.1f} N, {force[1] - force[0]:.1f} N of it over the first decade and "
        f"{force[-1] - force[1]:.1f} N over the second: as a power of the speed {powers[0]:.3f} and {powers[1]:.3f}.",
        f"- By themselves: {line.slope:.2f} N a decade, {_p(float(line.pvalue))} (one degree of freedom is left).",
        "- With the scatter of the pairs as the error (deflections and thicknesses differ, the share is taken as the "
        f"same): {middle * slope:.2f} +- {middle * half:.1f} N a decade (95 %), {_p(p)}. "
        + ("The effect is shown." if p < LEVEL else "The three differ no more than replicates do: no effect is shown."),
        f"- The paper holds one pair of tests at the same speed, 1 mm/s: specimen 1 already bore {end:.1f} N at "
        f"{at_end:.1f} mm on its first loading, and the film of the speed test {same:.1f} N at "
        f"{1e3 * SPEEDS_AT:.0f} mm. At equal deflection they differ by more than {end - same:.1f} N, which is "
        f"{100 * (end - same) / (force[-1] - force[0]):.0f} % of the whole rise with the speed, if it was another "
        "film; if it was the same, its earlier cycles took that much away.",
    ]


def _open(rates: Sequence[SpeedTest], carried: Scatter) -> list[str]:
    effect = float(np.log(rates[-1].force / rates[0].force))
    return [
        "- Whether film or glue failed, in which cycle, and after how many: not printed. Each thickness is another "
        "sheet, so that thickness, sheet and history are one and the same factor here.",
        "- Whether the three speeds were run on one film, and in which order: softening by earlier cycles and speed "
        "are then one factor.",
        f"- To show a rise of {100 * np.expm1(effect):.0f} % between two speeds nine times in ten, with this scatter, "
        f"{specimens_needed(carried, effect)} films at each speed would be needed; or one film at small deflections, "
        "where it softens least, at all speeds and again in reverse order.",
    ]


def _percent(scatter: Scatter) -> str:
    return f"{100 * scatter.sd:.0f} %"


def _p(value: float) -> str:
    return f"p = {value:.2g}"
