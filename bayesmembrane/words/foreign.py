"""What is foreign in words: as a clause, as a sentence with what makes such a thing, and what to do about it."""

from __future__ import annotations

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.diagnosis.explanation.foreign import CLIPPED, LOST, PASSING, PLAY, RANGE, STOP, SUDDEN, WAVE, Foreign
from bayesmembrane.diagnosis.thresholds import WORDS
from bayesmembrane.words.units import size_in_words

CAUSES = {
    SUDDEN: "; look for a change of temperature, a knock or a tear then.",
    PASSING: ", as a draught, a lamp or a hand near the film would make it.",
    LOST: ", as by a drive that loses steps, a counter that slips, or a clamp that lets go once.",
    WAVE: ", as a drive, a gear or a vibration would make it.",
    PLAY: "; after each reversal the film is behind the counter.",
    STOP: ", as a stop, a cable or a rod that touches would be.",
    RANGE: ", as an amplifier has it whose ranges do not agree.",
}
ADVICE = {
    SUDDEN: "Look for a knock, a tear or a change of temperature then.",
    PASSING: "Look for a draught, a lamp or a hand near the film then.",
    LOST: "Measure the travel at the film itself, or move more slowly.",
    WAVE: "Look at the drive, its gear, and what vibrates.",
    PLAY: "Take the play out of the drive, and test again.",
    STOP: "Look for what is in the way there, and test again.",
    RANGE: "Fix the range of the amplifier, and test again.",
    CLIPPED: "Leave these readings out, or take a larger load cell.",
}
"""What to do, as a sentence."""


def foreign_clause(f: Foreign, rig: Fixture, thickness: float) -> str:
    """What it is, with its size and where it comes, as a clause; of a film so thick on a rig."""
    shown = rig.shown(thickness)
    force = size_in_words(f.size, "N", shown)
    step = f"{100 * abs(f.size):.2g} %" if f.relative else force.removeprefix("-")
    when = f"reading {f.place + 1}" if f.moment is None else f"{f.moment:.4g} s"
    rise, larger = ("rise", "larger") if f.size > 0 else ("drop", "smaller")
    if f.kind == SUDDEN:
        return f"a sudden {rise} of the force by {step} at {when}"
    if f.kind == PASSING:
        return f"a {rise} of the force by {step} that begins at {when} and passes"
    if f.kind == LOST:
        less = "less" if f.size > 0 else "more"
        return f"a way that is {size_in_words(abs(f.size), 'm', shown)} {less} than read since {when}"
    if f.kind == WAVE:
        return f"a wave of {force} every {size_in_words(f.period, 'm' if f.against == 'deflection' else 's', shown)}"
    if f.kind == PLAY:
        return f"a play of {size_in_words(f.size, 'm', shown)} in the drive"
    if f.kind == STOP:
        return f"something that is met at {rig.place(f.level)} and takes {force} at the end"
    if f.kind == RANGE:
        return f"a gain that is {step} {larger} above {size_in_words(f.level, 'N', shown)}"
    if f.kind == CLIPPED:
        limit = "soft limit" if f.soft >= WORDS.soft_limit else "limit"
        return f"the load cell at its {limit} of {force} from reading {f.place + 1} on"
    return f"something smooth, about {100 * f.size:.2g} % of the force, that no effect here leaves"


def foreign_sentence(f: Foreign, rig: Fixture, thickness: float) -> str:
    """What it is: when or where, how large, and what makes such a thing."""
    if f.kind == CLIPPED:
        factor, unit = rig.shown(thickness)["N"]
        softly = f" and yields within about {100 * f.soft:.1g} % of it" if f.soft >= WORDS.soft_limit else ""
        limit = f"{f.size:.4g} N" if unit.endswith("N") else f"{factor * f.size:.4g} {unit}"
        where = f"from reading {f.place + 1} on{softly}"
        return f"The load cell is at its limit of {limit} {where}: leave these readings out."
    of = "" if f.test is None else " of all tests"
    taken = f"takes {100 * f.share:.0f} % of the squares{of} away"
    if f.kind not in CAUSES:
        what = f"Something smooth along the test, of about {100 * f.size:.2g} % of the force"
        return f"{what}, {taken}; no effect in the library has this course."
    clause = foreign_clause(f, rig, thickness)
    return f"{clause[0].upper()}{clause[1:]}: it {taken}{CAUSES[f.kind]}"
