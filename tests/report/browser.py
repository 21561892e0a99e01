"""A page in headless Chromium: what it looks like from inside, at a given width, and what axe-core says of it."""

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

from tests.conftest import CHECKOUT

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
AXE_PLACES = [
    Path(folder) / "axe-core/axe.min.js" for folder in (os.environ.get("NODE_PATH", ""), CHECKOUT / "node_modules")
]
"""Where the accessibility checker axe-core may be; its licence (MPL) keeps it out of the repository."""

HARNESS = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>harness</title></head><body>
<iframe title="page" style="width:{width}px;height:900px;border:0" srcdoc="{page}"></iframe>
<script>{script}</script></body></html>
"""
REPORT = """
const report = found => {
  const out = document.createElement("pre");
  out.id = "found";
  out.textContent = JSON.stringify(found);
  document.body.replaceChildren(out);
};
"""
INSPECT = (
    REPORT
    + """
addEventListener("load", async () => {
  const page = document.querySelector("iframe").contentDocument;
  const view = page.defaultView.innerWidth;
  const clipped = element => element.closest(".scroll, dialog") !== null;
  const images = [...page.querySelectorAll("figure img")];
  const found = {
    pictures: images.map(image => [image.complete && image.naturalWidth > 0, image.alt]),
    overflow: page.documentElement.scrollWidth - view,
    wide: [...page.body.querySelectorAll("*")].filter(
      element => element.getBoundingClientRect().right > view + 1 && !clipped(element)).map(element => element.tagName),
    ids: [...page.querySelectorAll("[id]")].map(element => element.id),
    links: [...page.querySelectorAll("a")].map(link => link.getAttribute("href")),
    headings: [...page.querySelectorAll("h1,h2,h3")].map(heading => [heading.tagName, heading.textContent.trim()]),
    text: page.body.innerText
  };
  const buttons = [...page.querySelectorAll("button.enlarge")];
  found.enlarge = buttons.map(button => button.ariaLabel);
  const dialog = page.querySelector("dialog");
  buttons[0].click();
  found.enlarged = [dialog.open, dialog.querySelector("img").alt === images[0].alt];
  dialog.close();
  found.enlarged.push(dialog.open);
  const table = page.querySelector("#table_1 table.sortable");
  const head = [...table.querySelectorAll("th[data-column]")].at(-2);
  const labels = () => [...table.querySelectorAll("tbody th[scope=row]")].map(label => label.textContent);
  const order = () => [head.ariaSort ?? "none", ...labels()];
  found.sorted = [order()];
  for (let click = 0; click < 3; click++) { head.querySelector("button").click(); found.sorted.push(order()); }
  const number = page.querySelector("a.number");
  const rows = page.getElementById(number.getAttribute("href").slice(1));
  found.unfolded = [rows.open];
  number.click();
  await new Promise(done => setTimeout(done, 500));
  found.unfolded.push(rows.open);
  report(found);
});
"""
)
AUDIT = (
    REPORT
    + """
addEventListener("load", async () => {
  const inside = document.querySelector("iframe").contentWindow;
  inside.document.querySelectorAll("details").forEach(one => { one.open = true; });
  inside.eval(axeSource);
  const found = await inside.axe.run(inside.document, { resultTypes: ["violations"] });
  const where = fault => fault.nodes.map(node => node.html).slice(0, 3).join(" | ");
  report(found.violations.map(fault => `${fault.id}: ${fault.impact}: ${where(fault)}`));
});
"""
)


def inspect(page: str, width: int, folder: Path) -> dict:
    """Facts about ``page`` at ``width`` pixels, and ``console``: what the browser complained about."""
    found, console = _run(page, width, folder, INSPECT)
    return found | {"console": console}


def audit(page: str, width: int, folder: Path, axe: Path) -> list[str]:
    """Faults that axe-core finds in ``page`` at ``width`` pixels, everything unfolded.

    The checker is put into the page, whose policy forbids foreign scripts: that one line is taken out first.
    """
    open_page = re.sub(r"<meta http-equiv=.Content-Security-Policy.*?>", "", page)
    source = json.dumps(axe.read_text(encoding="utf-8")).replace("</", "<\\/")
    return _run(open_page, width, folder, f"const axeSource = {source};\n{AUDIT}")[0]


def _run(page: str, width: int, folder: Path, script: str) -> tuple:
    harness = folder / f"harness_{width}.html"
    text = HARNESS.format(width=width, page=html.escape(page), script="SCRIPT").replace("SCRIPT", script)
    harness.write_text(text, encoding="utf-8")
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    command += ["--enable-logging=stderr", "--v=0", f"--user-data-dir={folder / 'profile'}"]
    command += ["--window-size=1400,1000", "--virtual-time-budget=20000", "--dump-dom", harness.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = json.loads(html.unescape(re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL).group(1)))
    return found, [line for line in done.stderr.splitlines() if "CONSOLE" in line]
