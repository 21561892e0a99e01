"""A grid as a tabular with booktabs, and text as LaTeX."""

from mtcsirl.tables.grid import Grid, Line

SIGNS = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "|": r"$|$",
    "±": r"$\pm$",
    "−": "$-$",
    "τ": r"$\tau$",
    "α": r"$\alpha$",
    "π": r"$\pi$",
    "∈": r"$\in$",
    "∉": r"$\notin$",
    "†": r"$^{\dagger}$",
    "‡": r"$^{\ddagger}$",
    "§": r"$^{\S}$",
    "¶": r"$^{\P}$",
    "‖": r"$\|$",
    "–": "--",
    "×": r"$\times$",
}


def latex(text: str) -> str:
    """Text with every sign that LaTeX would take for a command spelled out."""
    return "".join(SIGNS.get(character, character) for character in text)


def grid_latex(grid: Grid) -> list[str]:
    """The tabular; needs booktabs."""
    width = len(grid.columns)
    head = " & ".join(latex(text) for text in [grid.corner, *(column.title for column in grid.columns)])
    return [
        rf"\begin{{tabular}}{{l{'r' * width}}}",
        r"\toprule",
        *_groups(grid),
        head + r" \\",
        r"\midrule",
        *(_line(line, width, first=i == 0) for i, line in enumerate(grid.lines)),
        r"\bottomrule",
        r"\end{tabular}",
    ]


def _line(line: Line, width: int, *, first: bool) -> str:
    rule = r"\midrule" + "\n" if line.rule and not first else ""
    if line.section:
        return rf"{rule}\multicolumn{{{width + 1}}}{{l}}{{\emph{{{latex(line.label)}}}}} \\"
    texts = [rf"\textbf{{{latex(text)}}}" if i in line.strong else latex(text) for i, text in enumerate(line.texts)]
    return rule + " & ".join([latex(line.label), *texts]) + r" \\"


def _groups(grid: Grid) -> list[str]:
    """Group headings with a rule under each."""
    names, rules, start = [""], [], 2
    for group, span in grid.groups:
        names.append(rf"\multicolumn{{{span}}}{{c}}{{{latex(group)}}}")
        rules.append(rf"\cmidrule(lr){{{start}-{start + span - 1}}}" if group else "")
        start += span
    return [" & ".join(names) + r" \\", "".join(rules)] if grid.groups else []
