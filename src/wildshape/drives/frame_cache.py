# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What was read lately, kept in memory within a limit of bytes."""

from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable
from uuid import UUID, uuid4
from weakref import WeakValueDictionary

_ROOM = 256_000_000  # bytes; some 180 scans of an HDL-64E


@runtime_checkable
class _Sized(Protocol):
    @property
    def nbytes(self) -> int: ...


K = TypeVar("K", bound=Hashable)
T = TypeVar("T", bound=_Sized)


class FrameCache(Generic[K, T]):
    """What a function gives for keys; that of the keys asked for last is kept.

    Stages of short drives, and objects that are neighbours in time, ask for the same frames.
    Threads may ask at once: drives of one process share what was read of their clusters.
    """

    def __init__(self, give: Callable[[K], T], room: int = _ROOM) -> None:
        """`room`: bytes of all that is kept."""
        self.give, self.room = give, room
        self._name = uuid4()
        self._held: dict[K, T] = {}
        self._bytes = 0
        self._lock = Lock()

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """What is kept does not go along to another process, which may have its own already."""
        return _here, (self.give, self.room, self._name)

    def __contains__(self, key: K) -> bool:
        return key in self._held

    def __call__(self, key: K) -> T:
        """A key's; those not asked for longest are given up for it."""
        with self._lock:
            found = self._held.pop(key, None)
            if found is not None:
                self._held[key] = found
                return found
        given = self.give(key)
        with self._lock:
            if key not in self._held:
                self._held[key] = given
                self._bytes += given.nbytes
            while self._bytes > self.room and len(self._held) > 1:
                self._bytes -= self._held.pop(next(iter(self._held))).nbytes
        return given


_CACHES: "WeakValueDictionary[UUID, FrameCache[Any, Any]]" = WeakValueDictionary()
"""Those that came from another process, by name."""


def _here(give: Callable[[K], T], room: int, name: UUID) -> FrameCache[K, T]:
    """That of the same name: a helper gets its tasks one by one, each with the same drive."""
    found = _CACHES.get(name)
    if found is None:
        _CACHES[name] = found = FrameCache(give, room)
        found._name = name
    return found
