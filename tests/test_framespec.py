"""Frame ranges and the file names made of them."""

import pytest
from pxr import UsdUtils

from warprender.cli.framespec import frame_paths, parse_frames


@pytest.mark.parametrize(
    "text",
    [
        "123", "101:105", "105:101", "101:109x2", "101:110x2", "101:104x0.5", "105:101x-2", "1.5:3", "0:0x1",
        "-3:3x1.5", "101:104x0.25", "3:-3",
    ],
)  # fmt: skip
def test_ranges_have_the_times_that_usd_gives_them(text):
    expected = [code.GetValue() for code in UsdUtils.TimeCodeRange.CreateFromFrameSpec(text)]
    assert list(parse_frames(text).times) == expected


def test_several_ranges_are_drawn_in_the_order_given():
    assert parse_frames("5,1:2,10:9").times == (5, 1, 2, 10, 9)


def test_decimal_strides_neither_drift_nor_lose_the_end():
    times = parse_frames("0:1x0.1").times
    assert times == (0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1)


@pytest.mark.parametrize(
    ("text", "decimals"), [("1:3", 0), ("1:3x0.25", 2), ("1.5", 1), ("1:3x2.0", 0), ("1:3,7.125", 3)]
)
def test_decimals_tell_the_frames_apart(text, decimals):
    assert parse_frames(text).decimals == decimals


@pytest.mark.parametrize("text", ["", "a", "1:", "1:2:3", "5x2", "1:5x0", "105:101x2", "1:5x-1", "1,,2", "1:1e9"])
def test_what_is_no_range_is_named(text):
    with pytest.raises(ValueError, match="frame range"):
        parse_frames(text)


def test_an_endless_range_is_refused_before_it_fills_the_memory():
    with pytest.raises(ValueError, match="more than 1,000,000 frames"):
        parse_frames("0:1x0.000000001")


def test_placeholders_give_width_and_decimals():
    assert frame_paths("a.####.png", parse_frames("7:8")) == ["a.0007.png", "a.0008.png"]
    assert frame_paths("#.png", parse_frames("101")) == ["101.png"]
    assert frame_paths("a.###.#.png", parse_frames("1:2x0.5")) == [
        "a.001.0.png",
        "a.001.5.png",
        "a.002.0.png",
    ]
    assert frame_paths("a_##.#x.exr", parse_frames("-1:0")) == ["a_-1.0x.exr", "a_00.0x.exr"]


def test_without_a_range_the_path_stays_as_it_is():
    assert frame_paths("{a}/b.png", None) == ["{a}/b.png"]
    assert frame_paths("a#/b#.png", None) == ["a#/b#.png"]


@pytest.mark.parametrize(
    ("pattern", "frames", "message"),
    [
        ("a.###.png", None, "needs --frames"),
        ("a.png", "1", "exactly one placeholder"),
        ("#/a.#.png", "1", "exactly one placeholder"),
        ("a.###.png", "1:2x0.5", r"1 decimals, as in ###\.#$"),
    ],
)
def test_placeholder_and_range_must_fit(pattern, frames, message):
    with pytest.raises(ValueError, match=message):
        frame_paths(pattern, parse_frames(frames) if frames else None)
