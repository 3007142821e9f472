"""The films of a renderer: two that take turns, so that a frame's statistics can wait for who asks for them."""

from __future__ import annotations

import weakref

from .film import Film
from .filters import FILTERS
from .frame import Stats


class Films:
    """Two films of one size, made when they are first needed.

    The statistics of a frame are read from the film that it was drawn on. When its turn comes again, they are settled,
    but in a loop nobody has the frame before the last any more.
    """

    def __init__(self, width: int, height: int, device: str, filter: str, terms: tuple[int, ...] = ()) -> None:
        """For pictures of this size in pixels, which also keep these terms apart.

        Raises:
            ValueError: there is no such filter.
        """
        if filter not in FILTERS:
            raise ValueError(f"filter {filter!r} is not one of {', '.join(FILTERS)}")
        self._size = width, height, device, filter, terms
        self._films: list[Film] = []
        self._described: list[list[weakref.ref[Stats]]] = [[], []]
        self._turn = 1

    @property
    def last(self) -> Film:
        """The film of the last frame; an empty one before the first."""
        if not self._films:
            self.turn()
        return self._films[self._turn]

    def turn(self) -> None:
        """Take the other film, cleared."""
        self._turn = 1 - self._turn
        for stats in self._described[self._turn]:
            if (waiting := stats()) is not None:
                waiting.settle()
        self._described[self._turn] = []
        if len(self._films) <= self._turn:
            self._films.append(Film(*self._size))
        else:
            self._films[self._turn].clear()

    def describe(self, stats: Stats) -> None:
        """Settle these statistics before the last film is cleared."""
        self._described[self._turn].append(weakref.ref(stats))
