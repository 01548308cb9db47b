"""Text that is safe to print."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shadowbench.tables.plain_text import plain, shortened


def test_control_characters_show_as_escapes() -> None:
    assert plain("a\x1b[31m\n\t\x00\x9b\u202e\u2028\udc80é日") == r"a\x1b[31m\n\t\x00\x9b\u202e\u2028\udc80é日"


@given(st.text(st.characters()))
def test_plain_text_is_printable_and_encodable_and_printable_text_is_left_alone(text: str) -> None:
    result = plain(text)
    assert result.isprintable()
    result.encode()
    assert plain(result) == result
    if text.isprintable():
        assert result == text


@given(st.text(max_size=50), st.integers(3, 30))
def test_shortened_text_keeps_its_two_ends(text: str, length: int) -> None:
    result = shortened(text, length)
    assert len(result) == min(len(text), length)
    if len(text) > length:
        head, tail = result.split("…", 1) if text.count("…") == 0 else (result[:1], result[-1:])
        assert text.startswith(head)
        assert text.endswith(tail)
