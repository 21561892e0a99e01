"""A page in headless Chromium: what it looks like from inside, at a given width."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

HARNESS = """<!DOCTYPE html><html><head><meta charset="utf-8"></head><body>
<iframe style="width:{width}px;height:900px;border:0" srcdoc="{page}"></iframe>
<script>
addEventListener("load", () => {{
  const page = document.querySelector("iframe").contentDocument;
  const view = page.defaultView.innerWidth;
  const clipped = element => element.closest(".scroll") !== null;
  const found = {{
    pictures: [...page.images].map(image => [image.complete && image.naturalWidth > 0, image.alt]),
    overflow: page.documentElement.scrollWidth - view,
    wide: [...page.body.querySelectorAll("*")].filter(
      element => element.getBoundingClientRect().right > view + 1 && !clipped(element)).map(element => element.tagName),
    ids: [...page.querySelectorAll("[id]")].map(element => element.id),
    links: [...page.querySelectorAll("a")].map(link => link.getAttribute("href")),
    headings: [...page.querySelectorAll("h1,h2,h3")].map(heading => [heading.tagName, heading.textContent.trim()]),
    text: page.body.innerText
  }};
  const out = document.createElement("pre");
  out.id = "found";
  out.textContent = JSON.stringify(found);
  document.body.replaceChildren(out);
}});
</script></body></html>
"""


def inspect(page: str, width: int, folder: Path) -> dict:
    """Facts about ``page`` at ``width`` pixels, and ``console``: what the browser complained about."""
    harness = folder / f"harness_{width}.html"
    harness.write_text(HARNESS.format(width=width, page=html.escape(page)), encoding="utf-8")
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0"]
    command += [f"--user-data-dir={folder / 'profile'}", "--window-size=1400,1000", "--virtual-time-budget=5000"]
    done = subprocess.run(
        [*command, "--dump-dom", harness.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    found = json.loads(html.unescape(re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL).group(1)))
    return found | {"console": [line for line in done.stderr.splitlines() if "CONSOLE" in line]}
