r"""Formulas of the pages as MathML, which browsers draw without a script and without a network.

A page has a formula in a block of code named `math`, as GitHub draws it, with its number last:
`\tag{3}`. Zensical leaves such a block as it is.
"""

import re
from html import unescape

from latex2mathml.converter import convert

_BLOCK = re.compile(
    r'<div class="language-text highlight"><pre><span></span><code>'
    r"(?P<formula>[^<]*?)\\tag\{(?P<number>\d+)\}\s*</code></pre></div>"
)
# latex2mathml sets no space between a function and its argument.
_FUNCTION = re.compile(r"<m[io]>(?:a?sinh?|cosh?|tanh|sech|ln|asinh)</m[io]>")


def with_drawn_formulas(page: str) -> str:
    """Return a page of the site with its numbered formulas as MathML."""
    return _BLOCK.sub(_drawn, page)


def _drawn(block: re.Match[str]) -> str:
    formula = convert(unescape(block["formula"]).strip(), display="block")
    formula = _FUNCTION.sub(r'\g<0><mspace width="0.17em" />', formula)
    number = block["number"]
    # A class that offline.js knows: a long formula scrolls, and the keyboard reaches it.
    return (
        f'<div class="md-typeset__scrollwrap" id="equation-{number}" '
        'style="display: flex; align-items: center; overflow-y: hidden">'
        f'<div style="flex: 1; padding-right: 1em">{formula}</div><div>({number})</div></div>'
    )
