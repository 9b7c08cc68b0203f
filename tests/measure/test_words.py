"""Table 3.2's words, and which of them no thresholds give back."""

from __future__ import annotations

from fabricusd.measure.words import COLUMNS, TABLE_3_2, described_words, misses, words
from fabricusd.schema import load
from tests.measure.shoots import FILAMENT


def test_one_pair_of_thresholds_misses_twelve_of_the_table_s_56_words():
    missed = {}
    for name, wanted in TABLE_3_2.items():
        thread = load(f"thread_{name}{{appearance=published}}").thread_list[0]
        missed[name] = misses(words(thread, "microcylinder"), wanted)
    assert sum(len(lines) for lines in missed.values()) == 12
    assert missed["polyester_filament"] == ["back internal: shiny, the table says glossy"]
    assert "forward surface: blurry, the table says shiny" in missed["polyester_spun"]


def test_words_are_told_in_one_line():
    (line,) = described_words(FILAMENT, "microcylinder")
    assert line.startswith("words: back surface high shiny; back internal low ")
    assert all(column in line for column in COLUMNS)


def test_no_word_is_missed_where_all_agree():
    assert misses(TABLE_3_2["wool_spun"], TABLE_3_2["wool_spun"]) == []
