"""Errors read as one sentence: where, what, how to mend it."""

import pickle

from bayesmembrane.ground.errors import BayesmembraneError, DataError, SettingsError, unknown_name


def test_message_is_place_fault_and_remedy() -> None:
    error = DataError("the cell is empty", "a.csv, line 3", "fill it.")
    assert str(error) == "a.csv, line 3: the cell is empty; fill it."
    assert str(DataError("the file is empty.")) == "the file is empty."


def test_errors_survive_the_way_between_processes() -> None:
    error = SettingsError("what", "where", "remedy")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is SettingsError
    assert (str(again), again.remedy) == (str(error), "remedy")
    assert isinstance(again, BayesmembraneError)


def test_unknown_name_suggests_the_nearest() -> None:
    said = str(unknown_name("material", "yeo", ["yeoh", "ogden"]))
    assert said == 'there is no material called "yeo"; did you mean "yeoh"? known: ogden, yeoh.'
    assert "did you mean" not in str(unknown_name("material", "zzz", ["yeoh"]))
