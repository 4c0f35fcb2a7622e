"""Keys of what answers depend on."""

from __future__ import annotations

from pipeline.common.version import differences, key_of


def test_the_order_of_entries_does_not_matter() -> None:
    assert key_of({"a": 1, "b": [2]}) == key_of({"b": [2], "a": 1}) != key_of({"a": 1, "b": [3]})


def test_what_differs_is_told_in_short() -> None:
    was = {"same": 1, "gone": True, "long": "x" * 99}
    told = differences(was, {"same": 1, "new": [1, 2], "long": "y"})
    assert told == f'gone was true, now not set; long was "{"x" * 56}..., now "y"; new was not set, now 1, 2'
    assert (
        differences({"a": {"b": 1, "long": "x" * 99}}, {"a": {"b": 2, "long": "x" * 99}})
        == "a.b was 1, now 2"
    )
    assert (
        differences({"settings": {}}, {"settings": {"format": ["A9", "vin"]}})
        == "format was not set, now A9, vin"
    )
    assert differences({"a": [1, 2]}, {"a": (1, 2)}) == ""  # as JSON has it
