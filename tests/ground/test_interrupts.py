"""Interrupts that arrive where Python lets no exception through."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from bayesmembrane.ground.interrupts import deferred, held_back, raised

LONGEST = 30.0  # s, for what takes a hundredth

INTERRUPTED_WHILE_READING = """
import signal, time
import numpy as np
from scipy.stats import qmc
from bayesmembrane.ground.interrupts import raised

np.load = lambda *given, **named: signal.raise_signal(signal.SIGTERM)
try:
    with raised():
        qmc.Sobol(2, scramble=False)
        time.sleep(30)
except KeyboardInterrupt:
    print("interrupted")
"""
INTERRUPTED_AT_THE_FIRST_SEQUENCE = """
import signal, time
import numpy as np
from bayesmembrane.ground.interrupts import raised
from bayesmembrane.ground.sobol import scrambled_sobol

load = np.load

def interrupted(*given, **named):
    signal.raise_signal(signal.SIGTERM)
    return load(*given, **named)

np.load = interrupted
try:
    with raised():
        scrambled_sobol(2, 0)
        time.sleep(30)
except KeyboardInterrupt:
    print("interrupted")
points = np.sort(scrambled_sobol(2, 0).random(4)[:, 0])
print(np.floor(4 * points[1]) / 4)  # one in each quarter
"""


class Fragile:
    """Something whose finaliser does what it was told."""

    def __init__(self, last: Callable[[], object]) -> None:
        self.last = last

    def __del__(self) -> None:
        self.last()


def interrupted_in_a_finaliser() -> None:
    thing = Fragile(lambda: signal.raise_signal(signal.SIGINT))
    del thing
    time.sleep(LONGEST)


def test_interrupt_in_a_finaliser_ends_the_body_and_is_not_told(capfd: pytest.CaptureFixture[str]) -> None:
    with raised(), pytest.raises(KeyboardInterrupt):
        interrupted_in_a_finaliser()
    assert capfd.readouterr().err == ""


def test_second_interrupt_in_a_finaliser_ends_a_deferred_body(capfd: pytest.CaptureFixture[str]) -> None:
    with raised(), deferred() as asked:
        signal.raise_signal(signal.SIGTERM)
        assert asked()
        with pytest.raises(KeyboardInterrupt):
            interrupted_in_a_finaliser()
    assert capfd.readouterr().err == ""


def test_interrupt_in_a_compiled_function_that_cannot_raise_is_not_told(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """In a process of its own, since SciPy reads those numbers once in a process."""
    program = tmp_path / "interrupted.py"
    program.write_text(INTERRUPTED_WHILE_READING)
    subprocess.run([sys.executable, program], check=True)
    out, err = capfd.readouterr()
    assert (out, err) == ("interrupted\n", "")


def signalled_while_held_back(done: list[str]) -> None:
    with held_back():
        signal.raise_signal(signal.SIGTERM)
        done.append("the body")
    time.sleep(LONGEST)
    done.append("what follows")


def test_what_is_held_back_arrives_after_it() -> None:
    done = list[str]()
    with raised(), pytest.raises(KeyboardInterrupt):
        signalled_while_held_back(done)
    assert done == ["the body"]
    with raised(), deferred() as asked:
        with held_back():
            signal.raise_signal(signal.SIGINT)
            assert not asked.signalled
        assert asked.signalled


def test_an_interrupt_does_not_take_the_numbers_of_a_sobol_sequence(tmp_path: Path) -> None:
    program = tmp_path / "sobol.py"
    program.write_text(INTERRUPTED_AT_THE_FIRST_SEQUENCE)
    told = subprocess.run([sys.executable, program], check=True, capture_output=True, text=True)
    assert (told.stdout, told.stderr) == ("interrupted\n0.25\n", "")


def test_other_lost_exceptions_are_told_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    told = list[type[BaseException]]()
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: told.append(lost.exc_type))
    hook = sys.unraisablehook
    with raised():
        thing = Fragile(lambda: 1 / 0)
        del thing
    assert told == [ZeroDivisionError]
    assert sys.unraisablehook is hook
