"""TeX in a page to MathML: browsers draw it, print it and read it aloud, without a script or fonts from a network."""

import html
import re

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_DISPLAY = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
_BARE = re.compile(r'(<mi>(?:log|exp)</mi>)(?!<mo stretchy="false">&#x00028;)')
"""The name of a function whose argument has no brackets: TeX leaves a little space there."""


def with_formulas(page: str) -> str:
    """``page`` with every formula that the Markdown extension arithmatex has marked as MathML.

    The TeX stays in ``alttext``. Raises ValueError for TeX that is not understood.
    """
    page = _DISPLAY.sub(lambda found: f'<div class="formula">{mathml(found[1], "block")}</div>', page)
    return _INLINE.sub(lambda found: mathml(found[1], "inline"), page)


def mathml(escaped: str, display: str) -> str:
    r"""The MathML of TeX whose HTML characters are escaped; a command that stays as it was is an error."""
    tex = html.unescape(escaped).strip()
    try:
        found = convert(tex, display=display)
    except Exception as error:
        raise ValueError(f"formula {tex!r}: {type(error).__name__} {error}") from error
    unknown = re.search(r"\\[a-zA-Z]+", re.sub(r"<annotation.*?</annotation>", "", found, flags=re.DOTALL))
    if unknown:
        raise ValueError(f"formula {tex!r}: {unknown[0]} is not understood")
    # the bars of a norm are as high as letters, not as the row
    found = found.replace("<mo>&#x02016;</mo>", '<mo stretchy="false">&#x02016;</mo>')
    found = _BARE.sub(r'\1<mspace width="0.17em"/>', found)
    return found.replace("<math ", f'<math alttext="{html.escape(tex)}" ', 1)
