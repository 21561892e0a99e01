"use strict";

// Tables sort by a click on a heading: up, down, as printed. Lines stay below the heading of their section.
const key = cell => {
  const text = (cell.dataset.sort ?? cell.textContent).trim();
  const found = text.match(/^\[?([-−]?\d[\d,]*(\.\d+)?)/);
  return found ? Number(found[1].replace("−", "-").replaceAll(",", "")) : text === "–" ? Infinity : text;
};
const compare = (a, b) => typeof a === "number" && typeof b === "number" ? (a === b ? 0 : a - b)
  : String(a).localeCompare(String(b), "en", { numeric: true });

for (const table of document.querySelectorAll("table.sortable")) {
  const printed = [...table.tBodies].map(body => [...body.rows].filter(row => !row.classList.contains("section")));
  const heads = [...table.querySelectorAll("th[data-column]")];
  for (const head of heads) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const order = { none: "ascending", ascending: "descending", descending: "none" }[head.ariaSort ?? "none"];
      heads.forEach(other => other.removeAttribute("aria-sort"));
      if (order !== "none") head.setAttribute("aria-sort", order);
      const column = Number(head.dataset.column);
      [...table.tBodies].forEach((body, index) => {
        const rows = [...printed[index]];
        if (order !== "none") rows.sort((a, b) => compare(key(a.cells[column]), key(b.cells[column])));
        if (order === "descending") rows.reverse();
        body.append(...rows);
      });
    });
  }
}

// Figures open in full size; Escape, the button or a click beside the picture closes them.
const dialog = document.querySelector("dialog");
const large = dialog.querySelector("img");
for (const picture of document.querySelectorAll("figure img")) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "enlarge";
  button.ariaLabel = `Enlarge: ${picture.dataset.title}`;
  button.textContent = "Enlarge";
  picture.closest("figure").querySelector(".tools").prepend(button);
  const open = () => {
    large.src = picture.src;
    large.alt = picture.alt;
    dialog.showModal();
  };
  button.addEventListener("click", open);
  picture.addEventListener("click", open);
}
dialog.addEventListener("click", event => { if (event.target !== large) dialog.close(); });

// A link to something folded unfolds it, also when it is followed a second time.
const unfold = address => {
  const target = document.getElementById(address.slice(1));
  for (let one = target?.closest("details"); one; one = one.parentElement.closest("details")) one.open = true;
};
document.addEventListener("click", event => {
  const link = event.target.closest("a[href^='#']");
  if (link) unfold(link.getAttribute("href"));
});
addEventListener("hashchange", () => unfold(location.hash));
unfold(location.hash);

// Paper unfolds nothing by itself; lists of files are of no use on it.
addEventListener("beforeprint",
  () => document.querySelectorAll("details:not(.rows)").forEach(one => { one.open = true; }));
