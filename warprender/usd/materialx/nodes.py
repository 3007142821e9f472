"""MaterialX's standard nodes that compute: one function a node, over rows of numbers.

A function gets `i(name, default)`, an input's values (P, width), P 1 where it does not vary, and answers the same.
Names, defaults and formulas are those of MaterialX's own libraries (stdlib_defs, stdlib_ng and genglsl, 1.39).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .noise import perlin_noise_2d

Values = np.ndarray
Inputs = Callable[[str, object], Values]

#: Weights of luminance and saturate where none are given: those of ACEScg.
_LUMA = (0.2722287, 0.6740818, 0.0536895)


def column(values: Values, number: int) -> Values:
    """One component (P, 1); the last one stands for those that are missing."""
    return values[:, [min(number, values.shape[1] - 1)]]


def joined(*parts: Values) -> Values:
    """Components side by side."""
    count = max(len(part) for part in parts)
    return np.concatenate([np.broadcast_to(part, (count, part.shape[1])) for part in parts], 1)


def converted(values: Values, width: int) -> Values:
    """Values as another type: one number everywhere, a colour made opaque, or the first components."""
    if values.shape[1] == 1:
        return np.repeat(values, width, 1)
    if values.shape[1] >= width:
        return values[:, :width]
    filler = 1.0 if width == 4 else 0.0
    return joined(values, np.full((1, width - values.shape[1]), filler))


def _mixed(bg: Values, fg: Values, amount: Values) -> Values:
    return bg * (1.0 - amount) + fg * amount


def _range(i: Inputs) -> Values:
    low, high = i("inlow", 0.0), i("inhigh", 1.0)
    unit = (i("in", 0.0) - low) / (high - low)
    gamma = i("gamma", 1.0)
    if np.any(gamma != 1.0):
        unit = np.sign(unit) * np.abs(unit) ** (1.0 / gamma)
    result = _mixed(i("outlow", 0.0), i("outhigh", 1.0), unit)
    return np.where(i("doclamp", 0.0) > 0, np.clip(result, i("outlow", 0.0), i("outhigh", 1.0)), result)


def _smoothstep(i: Inputs) -> Values:
    low, high = i("low", 0.0), i("high", 1.0)
    t = np.clip((i("in", 0.0) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _luminance(i: Inputs) -> Values:
    values = i("in", (0.0, 0.0, 0.0))
    grey = (values[:, :3] * i("lumacoeffs", _LUMA)).sum(1, keepdims=True)
    return joined(np.repeat(grey, 3, 1), values[:, 3:])


def _saturate(i: Inputs) -> Values:
    values = i("in", (0.0, 0.0, 0.0))
    return joined(_mixed(_luminance(i)[:, :3], values[:, :3], i("amount", 1.0)), values[:, 3:])


def _to_hsv(rgb: Values) -> Values:
    largest, smallest = rgb.max(1), rgb.min(1)
    spread = largest - smallest
    r, g, b = rgb.T
    safe = np.where(spread > 0, spread, 1.0)
    hue = np.where(largest == r, (g - b) / safe, np.where(largest == g, 2 + (b - r) / safe, 4 + (r - g) / safe)) / 6
    hue = np.where(spread > 0, hue - np.floor(hue), 0.0)
    return np.stack([hue, np.where(largest > 0, spread / np.where(largest > 0, largest, 1.0), 0.0), largest], 1)


def _to_rgb(hsv: Values) -> Values:
    hue, saturation, value = hsv.T
    step = (np.array([[5.0], [3.0], [1.0]]) + 6.0 * (hue - np.floor(hue))) % 6.0
    return (value - value * saturation * np.clip(np.minimum(step, 4.0 - step), 0.0, 1.0)).T


def _hsvadjust(i: Inputs) -> Values:
    values, amount = i("in", (0.0, 0.0, 0.0)), i("amount", (0.0, 1.0, 1.0))
    hsv = _to_hsv(values[:, :3])
    moved = joined(hsv[:, :1] + amount[:, :1], hsv[:, 1:2] * amount[:, 1:2], hsv[:, 2:] * amount[:, 2:3])
    return joined(_to_rgb(moved), values[:, 3:])


def _swizzle(i: Inputs, channels: str) -> Values:
    values = i("in", 0.0)
    parts = [np.full((1, 1), float(c)) if c in "01" else column(values, "rgbaxyzw".index(c) % 4) for c in channels]
    return joined(*parts)


def _switch(i: Inputs) -> Values:
    which = np.floor(i("which", 0.0))
    result = i("in1", 0.0)
    for number in range(1, 10):
        result = np.where(which == number, i(f"in{number + 1}", 0.0), result)
    return result


def _if(compare: Callable) -> Callable[[Inputs], Values]:
    def chosen(i: Inputs) -> Values:
        return np.where(compare(i("value1", 1.0), i("value2", 0.0)), i("in1", 0.0), i("in2", 0.0))

    return chosen


def rotated(values: Values, degrees: Values) -> Values:
    """Turned clockwise, as rotate2d does."""
    angle = np.radians(degrees)
    x, y = values[:, :1], values[:, 1:2]
    return joined(np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x)


def placed(st: Values, pivot: Values, scale: Values, rotate: Values, offset: Values, order: Values) -> Values:
    """place2d: scale, rotate and move about a pivot, or the other way round."""
    centred = st - pivot
    first = rotated(centred / scale, rotate) - offset
    second = rotated(centred - offset, rotate) / scale
    return np.where(order > 0, second, first) + pivot


def _place2d(i: Inputs) -> Values:
    return placed(
        i("texcoord", "st"), i("pivot", (0.0, 0.0)), i("scale", (1.0, 1.0)), i("rotate", 0.0),
        i("offset", (0.0, 0.0)), i("operationorder", 0.0),
    )  # fmt: skip


def _transform2d(i: Inputs) -> Values:
    scaled = i("in", (0.0, 0.0)) * i("scale", (1.0, 1.0))
    return rotated(scaled, -i("rotation", 0.0)) + i("translation", (0.0, 0.0))


def _normalmap(i: Inputs) -> Values:
    scale = i("scale", 1.0)
    factor = joined(converted(scale, 2), np.ones((1, 1)))
    return (2.0 * i("in", (0.5, 0.5, 1.0)) - 1.0) * factor


def _ramp4(i: Inputs) -> Values:
    st = np.clip(i("texcoord", "st"), 0.0, 1.0)
    top = _mixed(i("valuetl", 0.0), i("valuetr", 0.0), st[:, :1])
    bottom = _mixed(i("valuebl", 0.0), i("valuebr", 0.0), st[:, :1])
    return _mixed(bottom, top, st[:, 1:2])


def _ramp(axis: int, first: str, second: str) -> Callable[[Inputs], Values]:
    def ramp(i: Inputs) -> Values:
        position = np.clip(column(i("texcoord", "st"), axis), 0.0, 1.0)
        return _mixed(i(first, 0.0), i(second, 0.0), position)

    return ramp


def _split(axis: int, first: str, second: str) -> Callable[[Inputs], Values]:
    def split(i: Inputs) -> Values:
        beyond = column(i("texcoord", "st"), axis) >= i("center", 0.5)
        return np.where(beyond, i(second, 0.0), i(first, 0.0))

    return split


def _checkerboard(i: Inputs) -> Values:
    cell = np.floor(i("texcoord", "st") * i("uvtiling", (8.0, 8.0)) - i("uvoffset", (0.0, 0.0)))
    odd = np.mod(cell.sum(1, keepdims=True), 2.0)
    return _mixed(i("color2", (0.0, 0.0, 0.0)), i("color1", (1.0, 1.0, 1.0)), odd)


def _noise2d(i: Inputs) -> Values:
    amplitude = i("amplitude", 1.0)
    return perlin_noise_2d(i("texcoord", "st"), min(amplitude.shape[1], 3)) * amplitude + i("pivot", 0.0)


#: What each node computes, by its category.
NODES: dict[str, Callable[[Inputs], Values]] = {
    "constant": lambda i: i("value", 0.0),
    "dot": lambda i: i("in", 0.0),
    "add": lambda i: i("in1", 0.0) + i("in2", 0.0),
    "subtract": lambda i: i("in1", 0.0) - i("in2", 0.0),
    "multiply": lambda i: i("in1", 0.0) * i("in2", 1.0),
    "divide": lambda i: i("in1", 0.0) / i("in2", 1.0),
    "modulo": lambda i: np.mod(i("in1", 0.0), i("in2", 1.0)),
    "power": lambda i: np.power(i("in1", 0.0), i("in2", 1.0)),
    "min": lambda i: np.minimum(i("in1", 0.0), i("in2", 0.0)),
    "max": lambda i: np.maximum(i("in1", 0.0), i("in2", 0.0)),
    "absval": lambda i: np.abs(i("in", 0.0)),
    "sign": lambda i: np.sign(i("in", 0.0)),
    "floor": lambda i: np.floor(i("in", 0.0)),
    "ceil": lambda i: np.ceil(i("in", 0.0)),
    "round": lambda i: np.floor(i("in", 0.0) + 0.5),
    "fract": lambda i: i("in", 0.0) - np.floor(i("in", 0.0)),
    "sqrt": lambda i: np.sqrt(i("in", 0.0)),
    "exp": lambda i: np.exp(i("in", 0.0)),
    "ln": lambda i: np.log(i("in", 1.0)),
    "sin": lambda i: np.sin(i("in", 0.0)),
    "cos": lambda i: np.cos(i("in", 0.0)),
    "tan": lambda i: np.tan(i("in", 0.0)),
    "invert": lambda i: i("amount", 1.0) - i("in", 0.0),
    "mix": lambda i: _mixed(i("bg", 0.0), i("fg", 0.0), i("mix", 0.0)),
    "clamp": lambda i: np.clip(i("in", 0.0), i("low", 0.0), i("high", 1.0)),
    "remap": _range,
    "range": _range,
    "smoothstep": _smoothstep,
    "contrast": lambda i: (i("in", 0.0) - i("pivot", 0.5)) * i("amount", 1.0) + i("pivot", 0.5),
    "luminance": _luminance,
    "saturate": _saturate,
    "rgbtohsv": lambda i: joined(_to_hsv(i("in", (0.0, 0.0, 0.0))[:, :3]), i("in", (0.0, 0.0, 0.0))[:, 3:]),
    "hsvtorgb": lambda i: joined(_to_rgb(i("in", (0.0, 0.0, 0.0))[:, :3]), i("in", (0.0, 0.0, 0.0))[:, 3:]),
    "hsvadjust": _hsvadjust,
    "dotproduct": lambda i: (i("in1", 0.0) * i("in2", 0.0)).sum(1, keepdims=True),
    "magnitude": lambda i: np.linalg.norm(i("in", 0.0), axis=1, keepdims=True),
    "extract": lambda i: column(i("in", 0.0), int(i("index", 0.0)[0, 0])),
    "separate2": lambda i: i("in", (0.0, 0.0)),
    "separate3": lambda i: i("in", (0.0, 0.0, 0.0)),
    "separate4": lambda i: i("in", (0.0, 0.0, 0.0, 0.0)),
    "combine2": lambda i: joined(i("in1", 0.0), i("in2", 0.0)),
    "combine3": lambda i: joined(i("in1", 0.0), i("in2", 0.0), i("in3", 0.0)),
    "combine4": lambda i: joined(i("in1", 0.0), i("in2", 0.0), i("in3", 0.0), i("in4", 0.0)),
    "convert": lambda i: i("in", 0.0),
    "switch": _switch,
    "ifgreater": _if(np.greater),
    "ifgreatereq": _if(np.greater_equal),
    "ifequal": _if(np.equal),
    "rotate2d": lambda i: rotated(i("in", (0.0, 0.0)), i("amount", 0.0)),
    "place2d": _place2d,
    "UsdTransform2d": _transform2d,
    "normalmap": _normalmap,
    "normal": lambda i: np.array([[0.0, 0.0, 1.0]]),
    "ramplr": _ramp(0, "valuel", "valuer"),
    "ramptb": _ramp(1, "valueb", "valuet"),
    "ramp4": _ramp4,
    "splitlr": _split(0, "valuel", "valuer"),
    "splittb": _split(1, "valueb", "valuet"),
    "checkerboard": _checkerboard,
    "noise2d": _noise2d,
}  # fmt: skip

#: Nodes that take a string beside their numbers: here the channels of a swizzle.
SWIZZLE = _swizzle
