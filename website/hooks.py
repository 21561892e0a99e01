"""What MkDocs calls while it builds the site.

A page may link to any file of the checkout, as on a forge. Such a file gets a page of its own below ``checkout/``:
Markdown as it is, other text as code; a picture is copied.
"""

import os
import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from website.formulas import with_formulas

CHECKOUT = Path(__file__).resolve().parents[1]
ALWAYS = ("CONTRIBUTING.md", "CHANGELOG.md")
"""Files that the navigation names."""
PICTURES = {".png", ".gif", ".svg"}
LANGUAGES = {".py": "python", ".yaml": "yaml", ".json": "json", ".smk": "python"}
_LINK = re.compile(r"(?<=\]\()([^)#\s]+)(#[^)\s]*)?(?=\))")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for every file outside docs/ that a page links to, and for those that such a page links to."""
    waiting = [CHECKOUT / name for name in ALWAYS]
    waiting += [path for file in files.documentation_pages() for path in _outside(Path(file.abs_src_path))]
    while waiting:
        path = waiting.pop()
        if files.get_file_from_path(_address(path)) is None:
            files.append(_file(path, config))
            waiting += _outside(path) if path.suffix == ".md" else []
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links into the checkout into links within the site."""
    here = page.file.src_uri
    place = CHECKOUT / here.removeprefix("checkout/") if here.startswith("checkout/") else CHECKOUT / "docs" / here

    def within(found: re.Match[str]) -> str:
        path = _target(place, found[1])
        if path is None:
            return found[0]
        return posixpath.relpath(_address(path), posixpath.dirname(here) or ".") + (found[2] or "")

    return _LINK.sub(within, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn formulas into MathML, which browsers draw without a script."""
    return with_formulas(html)


def _target(place: Path, link: str) -> Path | None:
    """The file of the checkout that a link on the page at ``place`` leads to; None for addresses and what is absent."""
    if re.match(r"[a-z]+:", link):
        return None
    path = Path(os.path.normpath(place.parent / link))
    return path if path.is_relative_to(CHECKOUT) and path.is_file() else None


def _outside(page: Path) -> list[Path]:
    """Files outside docs/ that a page links to."""
    links = (_target(page, found[1]) for found in _LINK.finditer(page.read_text(encoding="utf-8")))
    return [path for path in links if path is not None and not path.is_relative_to(CHECKOUT / "docs")]


def _address(path: Path) -> str:
    """Where a file of the checkout is in the site's sources."""
    if path.is_relative_to(CHECKOUT / "docs"):
        return path.relative_to(CHECKOUT / "docs").as_posix()
    name = f"checkout/{path.relative_to(CHECKOUT).as_posix()}"
    return name if path.suffix in {".md", *PICTURES} else f"{name}.md"


def _file(path: Path, config: MkDocsConfig) -> File:
    if path.suffix in {".md", *PICTURES}:
        return File.generated(config, _address(path), abs_src_path=str(path))
    name = path.relative_to(CHECKOUT).as_posix()
    fence = f"```{LANGUAGES.get(path.suffix, 'text')}\n{path.read_text(encoding='utf-8').rstrip()}\n```"
    text = f"---\nsearch:\n  exclude: true\n---\n\n# {name}\n\n{fence}\n"
    return File.generated(config, _address(path), content=text)
