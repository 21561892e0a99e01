"""What a stranger's file is called cannot move a terminal's cursor, nor make two lines of one."""

import pytest

from mtcsirl.files.console import plain


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("results/expert/ü s0: changed", "results/expert/ü s0: changed"),
        ("a\nb", "a b"),
        ("part\x1b[31m", "part\\x1b[31m"),
        ("a\rb\tc", "a\\rb\\tc"),
        ("\u202egnp", "\\u202egnp"),
        ("odd \udcff", "odd \\udcff"),
    ],
)
def test_a_line_is_a_line_and_shows_what_it_holds(text: str, printed: str) -> None:
    assert plain(text) == printed
