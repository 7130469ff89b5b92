"""Every verb stores its answer whole, under a name that says what it is, and it is read back as it was."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.app import analyses
from bayesmembrane.app.analyses import Work
from bayesmembrane.app.answers import Asked, asked, kept
from bayesmembrane.app.folders import lying
from bayesmembrane.calibration.fit import fit as least_squares
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground import registry
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.ground.parameters import Array, HalfNormal
from bayesmembrane.ground.plain import plain
from bayesmembrane.ground.stored import answer, read
from bayesmembrane.physics.effects.base import EffectParameter, Sensor
from bayesmembrane.physics.effects.force_gain import ForceGain
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

PLAIN = hypothesis("neo_hookean")


@pytest.fixture
def curve(film: Any) -> Measurement:
    """A neo-Hookean film with noise."""
    return film("neo_hookean", (7.0,), end=0.03, points=10, noise=0.002)


@pytest.fixture
def strip() -> Measurement:
    """A neo-Hookean strip with noise, for what is stored does not depend on the rig, and a strip needs no solver."""
    rig, specimen, stretch = Uniaxial(), Specimen("Strip No. 1", 5e-4), np.linspace(1.1, 2.5, 12)
    noisy = 0.3e6 * (stretch - stretch**-2) + 2e3 * np.random.default_rng(31).standard_normal(12)
    return Measurement(rig.length * (stretch - 1), noisy * rig.width * specimen.thickness, rig, specimen)


def equal(a: Any, b: Any) -> bool:
    return json.dumps(plain(a)) == json.dumps(plain(b))


def named(measurement: Measurement, *claims: Any, verb: str = "fit", seed: int = 0, **options: Any) -> str:
    return asked(verb, least_squares, [measurement], claims or [PLAIN], {"seed": seed, **options}).name


def test_the_folder_says_what_lies_in_it(curve: Measurement) -> None:
    film = replace(curve, specimen=replace(curve.specimen, name="Film No. 1 / µ"))
    assert re.fullmatch(r"film-no-1_neo_hookean_30mm_fit_[0-9a-f]{8}", named(film))


def test_what_was_asked_decides_the_folder(curve: Measurement) -> None:
    """Another seed, option, range or hypothesis is another answer; the same question the same one."""
    several = [
        named(curve),
        named(curve, seed=1),
        named(curve, loss="weighted"),
        named(curve, verb="diagnose"),
        named(curve.up_to(0.02)),
        named(curve, hypothesis("neo_hookean", ["zero_offset"])),
        named(curve, hypothesis("neo_hookean", noise="ar1")),
        named(curve, hypothesis("neo_hookean", convexity="none")),
    ]
    assert len(set(several)) == len(several)
    assert named(curve) == several[0]


@dataclass(frozen=True)
class Squeak(Sensor):
    """An effect that another package brings."""

    name: ClassVar[str] = "squeak"
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("size", "N", "size", HalfNormal(0.03), (0.0, 1.0), 0.0),
    )

    def read(self, p: Array, force: Array, path: Motion) -> Array:
        return force + p[:, :1]


@dataclass(frozen=True)
class Renamed(Yeoh):
    """An energy that another package brings."""

    name: ClassVar[str] = "renamed"


@pytest.mark.parametrize("verb", ["diagnose", "loop", "fit"])
def test_what_seeks_in_the_library_is_asked_anew_when_the_library_is_another(
    curve: Measurement, monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    """A stored diagnosis is not the answer any more once there is one more effect, or energy, that could explain it."""
    names = list[str]()

    def nothing(*_: Any, **__: Any) -> None:
        return None

    nothing.__module__ = getattr(analyses, f"run_{verb}").__module__
    monkeypatch.setattr(analyses, f"run_{verb}", nothing)
    monkeypatch.setattr(analyses, "document", lambda _: {})
    monkeypatch.setattr(analyses, "kept", lambda _kind, _found, _document, what, _out: names.append(what.name))

    def known(group: str, **more: type[Any]) -> None:
        found, before = {**registry.components(group), **more}, registry._discover
        monkeypatch.setattr(registry, "_discover", lambda asked: found if asked == group else before(asked))
        getattr(analyses, verb)(curve, PLAIN, Work())

    known("effects")
    known("effects", squeak=Squeak)
    known("materials", renamed=Renamed)
    known("importers", other=object)
    known("effects", squeak=Squeak, force_gain=ForceGain)
    monkeypatch.setattr(ForceGain, "coordinates", tuple(replace(p, bounds=(-9.0, 9.0)) for p in ForceGain.coordinates))
    known("effects")
    first, effect, energy, importer, same, prior = names
    assert energy == importer == same
    assert len({first, effect, energy, prior}) == (1 if verb == "fit" else 4)


def test_a_name_never_grows_beyond_what_a_disk_takes(curve: Measurement) -> None:
    long = replace(curve, specimen=replace(curve.specimen, name="film " * 100))
    assert len(named(long, *[PLAIN] * 40)) < 200
    assert Asked("reconstruct", "published losses", "", float("nan"), 8 * "0a").name == (
        "published-losses_reconstruct_0a0a0a0a"
    )


def test_without_a_folder_nothing_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = kept("fit", 1, {"loss_N": 2.0}, Asked("fit", "a", "b", 1.0, "0a"), None)
    assert found.document == {"loss_N": 2.0, "stored": None}
    assert found.folder is None
    assert list(tmp_path.iterdir()) == []


def test_fit_and_diagnosis_come_back_as_they_were(strip: Measurement, tmp_path: Path) -> None:
    for kind, found in (
        ("fit", analyses.fit(strip, PLAIN, Work(out=tmp_path))),
        ("diagnosis", analyses.diagnose(strip, PLAIN, Work(out=tmp_path))),
    ):
        folder = found.folder
        assert folder is not None
        assert folder.parent == tmp_path
        again = read(folder, kind)
        assert type(again) is type(found.result)
        assert equal(bm.as_dict(again), bm.as_dict(found.result))
        assert equal(answer(folder, kind), found.document)
        assert bm.load(folder) is not None
    everything = bm.load(tmp_path)
    assert sorted(kind for _, kind in everything) == ["diagnosis", "fit"]


def test_valleys_with_an_effect_come_back_as_they_were(strip: Measurement, tmp_path: Path) -> None:
    claim = hypothesis("neo_hookean", ["force_offset"])
    found = analyses.valleys(strip, claim, Work(out=tmp_path))
    (again,) = lying([tmp_path])
    assert again.kind == "valleys"
    assert equal(bm.as_dict(again.read()), bm.as_dict(found.result))
    np.testing.assert_array_equal(again.read().added.ranges[0].floor, found.result.added.ranges[0].floor)


@pytest.mark.usefixtures("short_walks")
def test_a_loop_is_read_back_with_its_runs_also_where_it_was_moved(strip: Measurement, tmp_path: Path) -> None:
    longer = replace(strip, deflection=1.2 * strip.deflection, specimen=replace(strip.specimen, name="another"))
    how = replace(analyses.ADAPTING, out=tmp_path / "here" / "runs", predict=(longer,))
    found = analyses.loop(strip, PLAIN, Work(out=tmp_path / "here", ess=100), how)
    assert found.folder is not None
    assert found.folder.name.startswith(f"strip-no-1_neo_hookean_{1e3 * strip.deflection[-1]:.4g}mm_loop_")
    (tmp_path / "here").rename(tmp_path / "there")
    (again,) = lying([tmp_path / "there"])
    assert again.kind == "loop"
    first, before = again.read().rounds[0], found.result.rounds[0]
    assert first.before.run.path.is_dir()
    np.testing.assert_array_equal(first.before.run.draws(), before.before.run.draws())
    assert (first.after is first.before) == (before.after is before.before)
    assert first.diagnosis.verdict == before.diagnosis.verdict
    np.testing.assert_array_equal(again.read().others[0].after, found.result.others[0].after)


@pytest.mark.usefixtures("short_walks")
def test_a_comparison_is_read_back(strip: Measurement, tmp_path: Path) -> None:
    found = bm.compare(strip, [PLAIN], ess=100, out=tmp_path)
    kinds = {f.kind: f.read() for f in lying([tmp_path])}
    assert set(kinds) == {"comparison", "run"}
    (again,) = kinds["comparison"].values()
    assert equal(bm.as_dict(again), bm.as_dict(found))
    assert again.rows[0].run == kinds["run"].path


def test_a_folder_without_anything_is_told(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for place in ("empty", "absent"):
        with pytest.raises(StorageError, match=place):
            lying([tmp_path / place])


def test_what_lies_there_and_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    for name in ("fit.json", "fit.npz"):
        (tmp_path / "a" / name).write_text("garbage")
    with pytest.raises(StorageError, match=r"cannot be read: a/fit.json; compute it again"):
        lying([tmp_path])
    with pytest.raises(StorageError, match="this is a file and no folder"):
        lying([tmp_path / "a" / "fit.json"])


def test_what_is_no_result_has_no_document() -> None:
    with pytest.raises(SettingsError, match="a float is no result"):
        bm.as_dict(3.0)
