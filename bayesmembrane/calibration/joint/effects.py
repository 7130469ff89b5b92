"""Which effects are claimed of which test."""

from __future__ import annotations

from collections.abc import Sequence

from bayesmembrane.calibration.joint.claim import Joint, JointTest, labelled
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.project import Listed
from bayesmembrane.ground.errors import SettingsError, unknown_name
from bayesmembrane.ground.registry import component
from bayesmembrane.physics.hypothesis import hypothesis


def joint_of(material: str, tests: Sequence[Listed], effects: str, noise: str, convexity: str) -> Joint:
    """One energy on ``tests``; a test that lists its own effects or noise has those.

    ``effects`` by commas: ``a`` is claimed of every test on which it can occur, ``a@strip`` of the test called strip.
    Raises `SettingsError` for a name that nobody declared, a test that is not there, and an effect that can occur in no
    test.
    """
    labels = labelled([(t.label, t.measurement) for t in tests])
    claimed = _claimed(effects, {label: t.measurement for label, t in zip(labels, tests, strict=True)})
    parts = []
    for label, test in zip(labels, tests, strict=True):
        own = claimed[label] if test.effects is None else _names(test.effects)
        parts.append(JointTest(label, test.measurement, hypothesis(material, own, test.noise or noise, convexity)))
    return Joint(tuple(parts))


def _claimed(effects: str, tests: dict[str, Measurement]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {label: [] for label in tests}
    for words in _names(effects):
        name, _, label = words.partition("@")
        effect = component("effects", name)()
        if label:
            if label not in tests:
                raise unknown_name("test", label, tests)
            where = [label]
        else:
            where = [n for n, m in tests.items() if not effect.unavailable(m.rig, m.path)]
            if not where:
                (reason, *_) = (effect.unavailable(m.rig, m.path) for m in tests.values())
                raise SettingsError(f"no test can show it: {reason}", f"effect {name}", "leave it out")
        for n in where:
            found[n].append(name)
    return found


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]
