"""What the noise model does to a ranking, in words."""

from __future__ import annotations

from typing import Any

from bayesmembrane.comparison.noises import OverNoises, noises_of, over_noises, several, under
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.ground.registry import components
from bayesmembrane.words.hypothesis import spoken, title
from bayesmembrane.words.language import listed

DECIDED = 1.0
"""A lead in ln Z below this decides nothing."""


def document(found: Comparison) -> dict[str, Any]:
    """The fields of the JSON answer that tell of noise models."""
    sums = [s.summary() for s in over_noises(found)] if several(found) else []
    return {"over_noises": sums, "noise": of_noise(found)}


def of_noise(found: Comparison) -> str:
    """Whether the first place hangs on the noise model, or on one that the residuals contradict; "" otherwise."""
    return " ".join(s for s in (summed(found), leaders(found)) if s) if several(found) else contradicted(found)


def summed(found: Comparison) -> str:
    """How probable each hypothesis is, whatever the noise."""
    sums = over_noises(found)
    if len(sums) < 2 or any(s.posterior_probability is None for s in sums):
        return ""
    told = listed(f"{spoken(s.hypothesis)} {s.posterior_probability:.2g}" for s in sums)
    noises = listed(noise_title(n) for n in noises_of(found))
    return f"Whatever the noise ({noises}, equally probable before), the probabilities are {told}."


def leaders(found: Comparison) -> str:
    """Who is first under each noise model, by how much, and whether that is always the same."""
    sums, noises = over_noises(found), noises_of(found)
    if len(sums) < 2:
        return ""
    first = {n: _lead(sums, n) for n in noises}
    told = listed(f"{who} by {lead:.1f} under {noise_title(n)}" for n, (who, lead) in first.items())
    if len({who for who, _ in first.values()}) > 1:
        return f"The ranking hangs on the noise model: first is {told} in ln Z."
    weak = [noise_title(n) for n, (_, lead) in first.items() if lead < DECIDED]
    rest = f", which decides nothing under {listed(weak)}" if weak else ""
    return f"{first[noises[0]][0]} is first under each noise model: {told} in ln Z{rest}."


def contradicted(found: Comparison) -> str:
    """That a ranking rests on a noise model which the residuals contradict, and how to ask for others; "" if not."""
    doubtful = [r for r in found.fitted if r.quality is not None and r.quality.smooth]
    if not doubtful or not found.ranking:
        return ""
    noise = doubtful[0].hypothesis.noise
    alike = listed(f"{spoken(r.hypothesis)} (p = {r.quality.alike_p:.2g})" for r in doubtful if r.quality)
    return (
        f"The ranking hangs on {title(noise)}, which the residuals contradict: neighbours are alike under {alike}. "
        "--noise auto judges each hypothesis under noise that remembers and under a form error, too."
    )


def noise_title(name: str) -> str:
    """How a noise model is called in running text."""
    return title(components("noise")[name])


def best_noise(found: Comparison) -> Comparison:
    """The rows of the noise model that the data prefer."""
    return under(found, noises_of(found)[0]) if several(found) and found.fitted else found


def _lead(sums: tuple[OverNoises, ...], noise: str) -> tuple[str, float]:
    """Who is first under one noise model, and its lead over the second in ln Z."""
    there = sorted(((s.by_noise[noise], spoken(s.hypothesis)) for s in sums if noise in s.by_noise), reverse=True)
    return there[0][1], there[0][0] - there[1][0] if len(there) > 1 else float("inf")
