"""Noticing that a scene's description was changed, without comparing all of it for every frame."""

from operator import is_


class Watched:
    """Counts the assignments to attributes of all objects of derived classes."""

    assignments = 0

    def __setattr__(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)
        Watched.assignments += 1


def contents(thing: object, but: tuple[str, ...] = ()) -> list[object]:
    """The values of an object's attributes, of what it watches in turn, and of its dictionaries, all in a row.

    Small arrays that are written in place, transforms, go as bytes.
    """
    found: list[object] = []
    for name, value in vars(thing).items():
        if name in but:
            continue
        if isinstance(value, Watched):
            found += contents(value)
        elif isinstance(value, dict):
            found += [*value.keys(), *value.values()]
        else:
            found.append(value.tobytes() if name == "transform" else value)
    return found


def same(these: list[object], those: list[object]) -> bool:
    """Whether two rows of `contents` are of the same objects; equal numbers and bytes count as such."""
    if these is those or (len(these) == len(those) and all(map(is_, these, those))):
        return True
    plain = (bytes, int)
    return len(these) == len(those) and all(
        a is b or (a.__class__ in plain and a.__class__ is b.__class__ and a == b)
        for a, b in zip(these, those, strict=True)
    )
