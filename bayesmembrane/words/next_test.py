"""Further tests in words."""

from __future__ import annotations

from typing import Any

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.ground.registry import component
from bayesmembrane.next_test.further import FurtherTest, Kind

ASSUMPTION = (
    "Each test has as many points as the present one (a biaxial point holds two tensions), and its noise is the same "
    "share of its largest force; films in strips are stretched as far as the present test stretches them."
)


def spoken_test(test: FurtherTest, present: Fixture | None = None) -> str:
    """What to do, as a clause: ``the same film from 35.1 to 43.9 mm``; on the rig of the ``present`` test."""
    stretched = present is not None and present.homogeneous
    match test.kind:
        case Kind.REPEAT:
            return "the same test once more"
        case Kind.FURTHER:
            risk = ", further than it was tested (it may break)" if test.beyond else ""
            if stretched:
                return f"the same film from {_stretch(test.start, present)} to {_stretch(test.end, present)}{risk}"
            return f"the same film from {1e3 * test.start:.3g} to {1e3 * test.end:.3g} mm{risk}"
        case Kind.SMALL:
            if stretched:
                return f"small stretches, up to {_stretch(test.end, present)}"
            return f"small deflections, up to {1e3 * test.end:.3g} mm"
        case Kind.OTHER_RIG:
            rig: Any = component("rigs", test.rig)
            return f"{rig.proposal}, stretched up to {test.stretch:.3g}"
        case Kind.UNLOADING:
            return "unloading after the same loading"
        case Kind.CYCLES:
            return "unloading cycles to rising peaks"
        case Kind.FASTER:
            return f"the same test {test.speed:g} times faster"
        case Kind.HOLD:
            return f"the same test with {test.hold:.3g} s holds, then again"
        case Kind.OTHER_SIZE:
            return f"the same test {test.change}"
        case Kind.BLANK:
            return "a blank run on a rigid dummy, which shows how the frame yields (its curve goes in as blank_run)"


def _stretch(deflection: float, rig: Fixture | None) -> str:
    assert rig is not None
    return rig.place(deflection)
