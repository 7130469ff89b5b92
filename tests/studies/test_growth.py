"""The studies of cost: powers are found again, lists of effects have the sizes asked for, pages have their rows."""

import numpy as np
import pytest

from tests.studies import growth, growth_page, side_page


def test_a_power_is_found_again() -> None:
    sizes = np.array([10, 30, 100, 300])
    p, sd = growth_page.exponent(sizes, 2.5 * sizes**1.3)
    assert p == pytest.approx(1.3)
    assert sd == pytest.approx(0.0, abs=1e-9)
    rng = np.random.default_rng(0)
    found = [growth_page.exponent(sizes, sizes**0.8 * np.exp(0.1 * rng.standard_normal(4))) for _ in range(400)]
    assert np.std([p for p, _ in found]) == pytest.approx(np.sqrt(np.mean([sd**2 for _, sd in found])), rel=0.15)


@pytest.mark.parametrize("count", growth.AXES["parameters"][1])
def test_effects_make_as_many_parameters_as_asked_for(count: int) -> None:
    assert len(growth.of_size(count).parameters) == count


def test_the_page_has_a_line_for_every_size() -> None:
    rows = [
        {"axis": "readings", "size": n, "seconds": 2.0 * n, "density": 1.0 * n, "evaluations": 10, "ess_bulk": None}
        for n in (15, 60, 250, 15)
    ]
    text = growth_page.page(rows, ["readings", "walkers"])
    assert "| readings | 15, 250 | 1.00 ± 0.00 | 1.00 ± 0.00 | 0.00 ± 0.00 | 1.00 ± 0.00 | 1.00 ± 0.00 |" in text
    assert "| 15 | 2 | 30 |" in text
    assert "\n## Walkers" not in text


def run(sampler: str, **more: object) -> dict[str, object]:
    return {"material": "gent", "sampler": sampler, "seconds": 2.0, "density": 1.0, "evaluations": 500, **more}


def test_samplers_are_judged_by_cubature_and_by_each_other() -> None:
    drawn = {"effective": 100.0, "sd": [1.0, 2.0]}
    rows = [
        {"material": "gent", "sampler": side_page.REFERENCE, "log_evidence": 3.0, "coarse": 3.001},
        run("one", mean=[0.1, -0.2], log_evidence=3.03, log_evidence_sd=0.04, **drawn),
        run("two", mean=[0.0, 0.0], **drawn),
        {"material": "gent", "sampler": "three", "error": "ValueError: no"},
    ]
    assert side_page.means_off(rows[1:2], rows[2:3]) == pytest.approx(np.sqrt(0.5))
    text = side_page.page(rows, ["one", "two", "three"])
    assert "| one | 1 | 2.0 | 50% | 500 | 100 | 5.0 | 50 | 0.7 | 0.030 | 0.040 |" in text
    assert "| three | 1 | ValueError: no |" in text
