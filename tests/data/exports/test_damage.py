"""A damaged export is refused in a sentence, or read: no traceback, no hang, nothing that is no number."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.data.exports.damage import FAULTS, damages, every_layout, judged


@pytest.mark.parametrize("name", every_layout())
@given(data=st.data())
@settings(deadline=None, max_examples=40)
def test_no_damage_is_a_fault(name: str, data: st.DataObject) -> None:
    how, content = data.draw(damages(name))
    verdict = judged(name, content)
    assert verdict.outcome not in FAULTS, f"{how}: {verdict.detail}"


@pytest.mark.parametrize("name", every_layout())
def test_the_whole_file_is_read(name: str) -> None:
    from tests.data.exports.damage import FILES

    verdict = judged(name, FILES[name])
    assert (verdict.outcome, verdict.said) == ("same", False), verdict.detail
