"""A few answers that were found lately, for whoever asks the same again soon."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Lately(Generic[Key, Value]):
    """The values of the ``most`` keys that were made last; the oldest goes first.

    It holds its keys: one that is compared by identity stays the only one of its kind for as long as it is known.
    """

    most: int
    _known: dict[Key, Value] = field(default_factory=dict, init=False, repr=False)

    def of(self, key: Key, make: Callable[[], Value]) -> Value:
        """The value of ``key``, made if it is not known."""
        if key not in self._known:
            self.keep(key, make())
        return self._known[key]

    def get(self, key: Key) -> Value | None:
        """The value of ``key``, or None."""
        return self._known.get(key)

    def keep(self, key: Key, value: Value) -> None:
        """Know this value of ``key`` from now on."""
        while len(self._known) >= self.most:
            del self._known[next(iter(self._known))]
        self._known[key] = value
