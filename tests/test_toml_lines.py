"""Lines of keys, tables and elements, checked against texts whose lines are plain to see."""

import tomllib

from hypothesis import given
from hypothesis import strategies as st

from shadowbench.toml_lines import line_numbers, line_of

TEXT = '''# a comment with [brackets] = "and" # more
title = "x = [1]" # not an array
long = """
a = 1
[[no]]
"""
literal = \'\'\'
b = 2\'\'\'

[[comparison]]
scene = ["one", # the first
    "two",
    {name = "three", values = [1,
        2]},
]
"quoted key".inner = 5

[comparison.deep]
x = 1

[[comparison]]
scene = 'four'
when = 2020-01-01T00:00:00Z
[table."odd name"]
y = [ [1, 2], [3,
 4] ]
'''


def test_each_key_table_and_element_is_found_on_its_line() -> None:
    expected = {
        ("title",): 2,
        ("long",): 3,
        ("literal",): 7,
        ("comparison", 0): 10,
        ("comparison", 0, "scene"): 11,
        ("comparison", 0, "scene", 0): 11,
        ("comparison", 0, "scene", 1): 12,
        ("comparison", 0, "scene", 2): 13,
        ("comparison", 0, "scene", 2, "name"): 13,
        ("comparison", 0, "scene", 2, "values", 0): 13,
        ("comparison", 0, "scene", 2, "values", 1): 14,
        ("comparison", 0, "quoted key", "inner"): 16,
        ("comparison", 0, "deep"): 18,
        ("comparison", 0, "deep", "x"): 19,
        ("comparison", 1): 21,
        ("comparison", 1, "scene"): 22,
        ("comparison", 1, "when"): 23,
        ("table", "odd name"): 24,
        ("table", "odd name", "y", 1, 0): 25,
        ("table", "odd name", "y", 1, 1): 26,
    }
    tomllib.loads(TEXT)
    lines = line_numbers(TEXT)
    assert {path: lines.get(path) for path in expected} == expected


def test_a_path_that_does_not_stand_in_the_text_gives_its_nearest_part() -> None:
    lines = line_numbers(TEXT)
    assert line_of(lines, ("comparison", 1, "scene", 0)) == 22
    assert line_of(lines, ("comparison", 0, "missing")) == 10
    assert line_of(lines, ("nowhere",)) is None


@given(st.dictionaries(st.from_regex(r"[a-z]{1,5}", fullmatch=True), st.text(alphabet="ab\"'#[]{}=,\\ ", max_size=8)))
def test_strings_of_any_content_do_not_shift_the_lines(values: dict[str, str]) -> None:
    escape = str.maketrans({"\\": "\\\\", '"': '\\"'})
    text = "".join(f'{key} = "{value.translate(escape)}"\n' for key, value in values.items())
    assert tomllib.loads(text) == values
    assert line_numbers(text) == {(key,): number for number, key in enumerate(values, 1)}
