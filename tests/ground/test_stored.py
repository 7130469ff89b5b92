"""What was stored is what is read, to the last bit; what was damaged is told in a sentence."""

from __future__ import annotations

import json
import math
import struct
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground import registry, stored
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.ground.parameters import LogNormal, Normal, Parameter, Uniform
from bayesmembrane.ground.stored import answer, answer_folders, read, store, stored_kinds
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics.solution import Note, Status
from bayesmembrane.physics.rigs.annulus import Annulus


def same(a: Any, b: Any) -> bool:
    """Equal in type and to the last bit, all the way down."""
    if type(a) is not type(b):
        return False
    if isinstance(a, float):
        return struct.pack("<d", a) == struct.pack("<d", b) or (math.isnan(a) and math.isnan(b))
    if isinstance(a, np.floating) and np.isnan(a):  # which nan it is carries no meaning
        return bool(np.isnan(b))
    if isinstance(a, np.ndarray | np.generic):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return same(list(a.items()), list(b.items()))
    if isinstance(a, Parameter | Normal | Uniform | LogNormal):
        return same(vars(a), vars(b))
    return bool(a == b)


floats = st.floats(allow_nan=True, allow_infinity=True)
scalars = st.one_of(
    floats.map(np.float64),
    st.floats(width=32).map(np.float32),
    st.integers(-(2**63), 2**63 - 1).map(np.int64),
    st.booleans().map(np.bool_),
    st.text().map(np.str_),
)
leaves = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    floats,
    st.text(),
    scalars,
    arrays.arrays(
        st.sampled_from([np.float64, np.float32, np.int64, np.int8, np.bool_, np.complex128]),
        arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3),
    ),
    st.sampled_from([*Status, Note.WRINKLED | Note.SLACK if hasattr(Note, "SLACK") else Note(1)]),
    st.sampled_from(sorted(registry.materials().values(), key=lambda m: m.name)),
    st.sampled_from([kind() for kind in registry.components("effects").values()]),
    st.frozensets(st.integers()),
    st.from_regex(r"[a-z]{1,5}(/[a-z]{1,5}){0,2}", fullmatch=True).map(Path),
)
keys = st.one_of(st.text(), st.just("!"), st.integers(), st.tuples(st.integers(), st.text()))


def inside(parts: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.one_of(
        st.lists(parts, max_size=4),
        st.lists(parts, max_size=4).map(tuple),
        st.dictionaries(keys, parts, max_size=4),
        st.builds(Parameter, parts, parts, parts, st.builds(Normal, parts, floats), parts),
        st.builds(LogNormal, parts, parts),
    )


@settings(deadline=None, max_examples=200)
@given(st.recursive(leaves, inside, max_leaves=12))
def test_what_was_stored_is_read_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, value: Any) -> None:
    folder = store(tmp_path_factory.mktemp("stored") / "answer", "fit", value, {"a": 1})
    assert same(read(folder, "fit"), value)


def test_a_hypothesis_and_a_measurement_come_back(tmp_path: Path) -> None:
    claim = hypothesis("ogden", ["zero_offset", "mullins"], "ar1", "box")
    assert claim.names  # a property that is remembered is no field
    film = Measurement(
        np.array([0.01, 0.02]), np.array([0.1, 0.3]), Annulus(0.01, 0.035), Specimen("µ", 5e-5), covariance=np.eye(2)
    )
    store(tmp_path, "fit", (claim, film), {})
    again, read_film = read(tmp_path, "fit")
    assert again == claim
    assert again.material is claim.material
    assert read_film.data_hash == film.data_hash
    assert not read_film.force.flags.writeable
    assert read_film.rig == film.rig


def test_what_was_one_object_is_one_object_again(tmp_path: Path) -> None:
    curve, prior = np.arange(3.0), Normal(0.0, 1.0)
    store(tmp_path, "loop", [prior, prior, curve, curve, replace(prior)], {})
    a, b, first, second, other = read(tmp_path, "loop")
    assert a is b
    assert first is second
    assert other is not a
    assert other == a


def test_a_path_beside_the_answer_moves_with_it(tmp_path: Path) -> None:
    store(tmp_path / "here" / "loop", "loop", (tmp_path / "here" / "run", Path("/elsewhere/run")), {})
    (tmp_path / "here").rename(tmp_path / "there")
    assert read(tmp_path / "there" / "loop", "loop") == (tmp_path / "there" / "run", Path("/elsewhere/run"))


def test_a_class_may_say_how_it_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Normal, "to_stored", lambda self: {"half": self.mean / 2}, raising=False)
    monkeypatch.setattr(
        Normal, "from_stored", classmethod(lambda cls, value: cls(2 * value["half"], 7.0)), raising=False
    )
    store(tmp_path, "fit", [Normal(3.0, 1.0)], {})
    assert read(tmp_path, "fit") == [Normal(3.0, 7.0)]


@dataclass(frozen=True)
class Foreign(NeoHookean):
    """W = c1 K, of another package; G d = 2 c1."""

    name: ClassVar[str] = "foreign"


def test_a_component_of_another_package_is_stored_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = registry.components("materials")
    monkeypatch.setattr(
        registry, "_discover", lambda group: {**known, "foreign": Foreign} if group == "materials" else {}
    )
    store(tmp_path, "fit", (Foreign, Foreign(3.0)), {})
    assert read(tmp_path, "fit") == (Foreign, Foreign(3.0))
    monkeypatch.undo()
    with pytest.raises(StorageError, match='no material called "foreign"'):
        read(tmp_path, "fit")


def test_the_answer_lies_beside_the_result(tmp_path: Path) -> None:
    assert read(tmp_path, "fit") is None
    assert answer(tmp_path, "fit") is None
    assert answer_folders(tmp_path) == []
    store(tmp_path / "a", "fit", 1, {"loss_N": np.float64(0.5), "sd": math.nan, "names": ("c1",)})
    store(tmp_path / "a", "valleys", 2, {})
    store(tmp_path / "b", "fit", 3, {})
    assert answer(tmp_path / "a", "fit") == {"loss_N": 0.5, "sd": None, "names": ["c1"]}
    assert stored_kinds(tmp_path / "a") == ("fit", "valleys")
    assert answer_folders(tmp_path) == [tmp_path / "a", tmp_path / "b"]
    assert answer_folders(tmp_path / "a") == [tmp_path / "a"]
    store(tmp_path / "a", "fit", 4, {})
    assert read(tmp_path / "a", "fit") == 4


class _Local:
    pass


@pytest.mark.parametrize(
    "value",
    [
        print,
        lambda: 0,
        _Local(),
        _Local,
        np.array([None]),
        Counter("aa"),
        np.ma.array([1.0]),
        np.datetime64("2020"),
        1j,
    ],
)
def test_what_is_no_value_is_refused_and_nothing_is_written(tmp_path: Path, value: Any) -> None:
    with pytest.raises(TypeError, match="cannot be stored"):
        store(tmp_path, "fit", {"x": [value]}, {})
    assert list(tmp_path.iterdir()) == []


def test_what_holds_itself_is_refused(tmp_path: Path) -> None:
    ring = Normal([], 1.0)  # type: ignore[arg-type]
    ring.mean.append(ring)  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="holds itself"):
        store(tmp_path, "fit", ring, {})


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    return store(tmp_path / "kept", "fit", (Normal(1.0, 2.0), np.arange(4.0)), {"loss_N": 0.25})


def test_every_damaged_byte_is_told_in_a_sentence(kept: Path) -> None:
    """One bit changed, anywhere in either file, or the file cut there: never another answer, never a traceback."""
    right = read(kept, "fit")
    for name in ("fit.json", "fit.npz"):
        whole = (kept / name).read_bytes()
        for at in range(0, len(whole) - 1, 7):
            for bad in (whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :], whole[:at]):
                (kept / name).write_bytes(bad)
                with pytest.raises(StorageError) as fault:
                    read(kept, "fit")
                assert str(kept / "fit") in str(fault.value)
        (kept / name).write_bytes(whole)
    assert read(kept, "fit")[0] == right[0]


def test_a_missing_half_is_told(kept: Path) -> None:
    (kept / "fit.npz").unlink()
    with pytest.raises(StorageError, match="No such file"):
        read(kept, "fit")
    assert stored_kinds(kept) == ()


@pytest.mark.parametrize("text", ["", "[]", "3", '{"material": "yeoh"}', "{" * 5000, '{"program": "other"}', "\xff"])
def test_another_program_s_file_is_told(kept: Path, text: str) -> None:
    (kept / "fit.json").write_text(text, encoding="latin-1")
    with pytest.raises(StorageError, match=r"fit\.json"):
        read(kept, "fit")
    with pytest.raises(StorageError, match=r"fit\.json"):
        answer(kept, "fit")
    assert stored_kinds(kept) == ()


def test_another_program_s_file_alone_is_no_answer(tmp_path: Path) -> None:
    (tmp_path / "valleys.json").write_text('{"material": "yeoh"}')
    assert read(tmp_path, "valleys") is None
    assert answer(tmp_path, "valleys") is None
    assert answer_folders(tmp_path) == []


def test_another_kind_and_another_format_are_told(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for suffix in ("json", "npz"):
        (kept / f"fit.{suffix}").rename(kept / f"valleys.{suffix}")
    with pytest.raises(StorageError, match="not what was written"):
        read(kept, "valleys")
    monkeypatch.setattr(stored, "FORMAT", 2)
    with pytest.raises(StorageError, match="format 1, and this version reads format 2"):
        read(kept, "valleys")


def forged(folder: Path, tree: Any) -> Path:
    """An answer whose checksums are right and whose tree nobody here wrote."""
    path = store(folder, "fit", None, {})
    body = json.dumps({"answer": {}, "result": tree})
    document = json.loads((path / "fit.json").read_text()) | {
        "sha256": stored.hashlib.sha256(body.encode()).hexdigest()
    }
    (path / "fit.json").write_text(json.dumps(document | {"answer": {}, "result": tree}))
    return path


@pytest.mark.parametrize(
    "tree",
    [
        {"!": "object", "class": "os:system", "fields": {}, "number": 0},
        {"!": "object", "class": "bayesmembrane.ground.files:os", "fields": {}, "number": 0},
        {"!": "object", "class": "bayesmembrane.ground.files:write_text", "fields": {}, "number": 0},
        {"!": "object", "class": "bayesmembrane.ground.parameters:ABC", "fields": {}, "number": 0},
        {"!": "object", "class": "bayesmembrane.no:Where", "fields": {}, "number": 0},
        {"!": "object", "class": "bayesmembrane.ground.parameters:Normal", "fields": {"mean": 1.0}, "number": 0},
        {"!": "enum", "class": "subprocess:Popen", "is": ["ls"]},
        {"!": "enum", "class": "bayesmembrane.physics.mechanics.solution:Status", "is": 99},
        {"!": "named tuple", "class": "bayesmembrane.ground.parameters:Normal", "is": [1.0, 2.0]},
        {"!": "class", "group": "verbs", "name": "yeoh"},
        {"!": "array", "is": "a7"},
        {"!": "same", "as": 5},
        {"!": "pickle", "is": "gASV"},
        {"!": []},
        {"!": "scalar", "type": "O", "is": "x"},
    ],
)
def test_only_what_this_package_defines_is_made(tmp_path: Path, tree: Any) -> None:
    with pytest.raises(StorageError, match=r"fit\.json"):
        read(forged(tmp_path / "forged", tree), "fit")


def test_an_unwritable_folder_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(StorageError, match="the fit cannot be"):
        store(tmp_path / "file" / "here", "fit", 1, {})
    assert (tmp_path / "file").read_text() == "mine"


def test_a_component_error_while_reading_is_wrapped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(cls: type[Any], value: Any) -> Any:
        raise SettingsError("the run is gone", remedy="sample again")

    monkeypatch.setattr(Normal, "to_stored", lambda self: None, raising=False)
    monkeypatch.setattr(Normal, "from_stored", classmethod(refuse), raising=False)
    store(tmp_path, "fit", Normal(0.0, 1.0), {})
    with pytest.raises(StorageError, match="the run is gone; sample again"):
        read(tmp_path, "fit")
