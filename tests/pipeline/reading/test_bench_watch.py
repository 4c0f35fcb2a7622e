"""What felt parts say of the bench: told while part after part shows it, and no longer."""

from __future__ import annotations

from pipeline.reading.bench_watch import LATEST, SHOWN_BY, BenchWatch

DEAD = "whisker 3, dead whisker: gives 1 % of the moment of land (see whether it is broken)"
STILL_DEAD = "whisker 3, dead whisker: gives 0 % of the moment of land (see whether it is broken)"
SPIKES = "spikes: 40 single samples stand out (screen the wires)"


def test_one_part_alone_tells_nothing() -> None:
    watch = BenchWatch()
    assert not watch.add([SPIKES])
    assert watch.message() == ""
    assert watch.parts == 1


def test_what_parts_show_one_after_the_other_is_told_once_in_the_latest_words() -> None:
    watch = BenchWatch()
    assert [watch.add([DEAD]), watch.add([STILL_DEAD, SPIKES]), watch.add([DEAD])] == [False, True, False]
    assert watch.message() == DEAD
    watch.add([SPIKES])
    assert watch.message() == f"{SPIKES}; {DEAD}"


def test_it_is_over_when_the_latest_parts_are_sound() -> None:
    watch = BenchWatch()
    for _ in range(LATEST):
        watch.add([DEAD])
    for left in range(LATEST - SHOWN_BY + 1, -1, -1):
        assert bool(watch.message()) == (left > 0)
        watch.add([])
