"""Counts before nouns in messages."""

from ctrlgen.core.counts import listed, number_of


def test_one_thing_has_no_plural():
    assert [number_of(k, "axis", "axes") for k in (0, 1, 2)] == ["0 axes", "1 axis", "2 axes"]
    assert [number_of(k, "reading is", "readings are") for k in (1, 3)] == ["1 reading is", "3 readings are"]
    assert [number_of(k, "drive") for k in (1, 6)] == ["1 drive", "6 drives"]


def test_names_in_a_row_have_commas_and_one_and():
    assert [listed("xyz"[:k]) for k in range(4)] == ["", "x", "x and y", "x, y and z"]
