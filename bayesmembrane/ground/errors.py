"""The exceptions a user can meet. Every message is one sentence: what is wrong, where, and how to mend it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class BayesmembraneError(Exception):
    """Base of all errors that the user can mend; the command line prints its text and exits with status 1.

    Parameters
    ----------
    what : the fault, as a clause that starts a sentence.
    where : file, line, column or value at fault.
    remedy : what to do about it.
    """

    def __init__(self, what: str, where: str | None = None, remedy: str | None = None) -> None:
        self.what, self.where, self.remedy = what, where, remedy
        super().__init__(what, where, remedy)

    def __str__(self) -> str:
        text = self.what.rstrip(". ")
        if self.where:
            text = f"{self.where}: {text}"
        if self.remedy:
            text = f"{text}; {self.remedy.rstrip('. ')}"
        return text + "."


class DataError(BayesmembraneError):
    """The measured data, or the specimen file beside it, cannot be used as they are."""


class SettingsError(BayesmembraneError):
    """What the user asked for is unknown or contradicts itself."""


class StorageError(BayesmembraneError):
    """A run or a report cannot be written or read back."""


def unknown_name(kind: str, name: str, known: Iterable[str]) -> SettingsError:
    """The error for a name that nobody declared, with the nearest known names."""
    names = sorted(known)
    nearest = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    guess = f'did you mean "{nearest[0]}"? ' if nearest else ""
    return SettingsError(f'there is no {kind} called "{name}"', remedy=f"{guess}known: {', '.join(names)}")
