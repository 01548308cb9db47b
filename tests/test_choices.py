"""What may be written for a scene, a method or a size."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.choices import MESH_SUFFIXES, Choice, choice_of_text, size_of, thread_count_of
from shadowbench.scenes.formats import EXTENSIONS


@pytest.mark.parametrize(
    ("text", "name", "values"),
    [
        ("pcf", "pcf", {}),
        ("pcf:kernel=3", "pcf", {"kernel": ("3",)}),
        ("pcf:kernel=3/7,filter=box", "pcf", {"kernel": ("3", "7"), "filter": ("box",)}),
        ("models/bunny.ply", "models/bunny.ply", {}),
        ("models/bunny.ply:ground=false", "models/bunny.ply", {"ground": ("false",)}),
        ("a:b/c.ply:ground=false/true", "a:b/c.ply", {"ground": ("false", "true")}),
        ("C:\\models\\bunny.ply", "C:\\models\\bunny.ply", {}),
        ("bunny.glb", "bunny.glb", {}),
        ('mesh-file:path="a/b,c.ply",up=z', "mesh-file", {"path": ("a/b,c.ply",), "up": ("z",)}),
        ("shadow-map:bias=1e-5/-0.5", "shadow-map", {"bias": ("1e-5", "-0.5")}),
    ],
)
def test_a_text_names_a_plugin_and_its_values(text: str, name: str, values: dict[str, tuple[str, ...]]) -> None:
    assert choice_of_text(text) == Choice(name, values)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must not be empty"),
        ("pcf:5", "after the colon come parameters, as in pcf:key=value"),
        ("pcf:", "after the colon come parameters"),
        ("pcf:a=1,b", "'b' is not key=value"),
        ("pcf:a=1,a=2", "parameter 'a' is given twice"),
        ("pcf:a=", "parameter 'a' has an empty value"),
        ("pcf:a=1//2", "parameter 'a' has an empty value"),
    ],
)
def test_a_wrong_text_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        choice_of_text(text)
    assert "\n" not in str(caught.value)


def test_a_sweep_expands_to_every_combination_the_last_parameter_fastest() -> None:
    assert list(choice_of_text("m:a=1/2,b=x/y").expand()) == [
        {"a": "1", "b": "x"},
        {"a": "1", "b": "y"},
        {"a": "2", "b": "x"},
        {"a": "2", "b": "y"},
    ]
    assert list(choice_of_text("m").expand()) == [{}]


@given(
    st.from_regex(r"[a-z][a-z-]{0,6}", fullmatch=True),
    st.dictionaries(
        st.from_regex(r"[a-z_]{1,5}", fullmatch=True),
        st.lists(st.text("abc/,.=-", min_size=1, max_size=5), min_size=1, max_size=3).map(tuple),
        max_size=3,
    ),
)
def test_a_choice_written_out_reads_back_the_same(name: str, values: dict[str, tuple[str, ...]]) -> None:
    choice = Choice(name, dict(values))
    assert choice_of_text(str(choice)) == choice


def test_every_mesh_format_that_is_read_is_known_by_its_ending() -> None:
    assert set(EXTENSIONS) == MESH_SUFFIXES


@pytest.mark.parametrize("text", ["640x480", " 640 X 480 "])
def test_a_size_is_width_x_height(text: str) -> None:
    assert size_of(text) == (640, 480)


@pytest.mark.parametrize("text", ["0x0", "640x0", "-1x5", "1000000000x2", "16385x1"])
def test_an_impossible_size_is_refused_with_the_limit(text: str) -> None:
    with pytest.raises(ValueError, match="a picture has 1 to 16384 pixels a side"):
        size_of(text)


@pytest.mark.parametrize("text", ["640", "640x480x3", "axb", "1e3x5", ""])
def test_what_is_no_size_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match="like 1024x768"):
        size_of(text)


@pytest.mark.parametrize("value", [0, -1, 1025, True, 1.5, "2"])
def test_an_impossible_number_of_threads_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match="a number of threads lies between 1 and 1024"):
        thread_count_of(value)
