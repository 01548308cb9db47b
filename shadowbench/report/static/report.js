"use strict";
// Sorting: a heading's button sorts its table by that column; numbers by value, absent values always last.
function keyOf(row, column) {
  const cell = row.cells[column];
  const text = cell.dataset.value ?? cell.textContent.trim();
  return { text, value: text === "" ? NaN : Number(text), absent: text === "" || text === "\u2014" };
}
function sortBy(heading, column) {
  const table = heading.closest("table");
  const falling = heading.getAttribute("aria-sort") === "ascending";
  for (const other of table.tHead.querySelectorAll("[aria-sort]")) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", falling ? "descending" : "ascending");
  for (const body of table.tBodies) {
    const keyed = [...body.rows].map((row) => [keyOf(row, column), row]);
    keyed.sort(([a], [b]) => {
      if (a.absent !== b.absent) return a.absent ? 1 : -1;
      const numeric = !Number.isNaN(a.value) && !Number.isNaN(b.value);
      const order = numeric ? a.value - b.value : a.text.localeCompare(b.text, "en", { numeric: true });
      return falling ? -order : order;
    });
    body.append(...keyed.map(([, row]) => row));
  }
}
for (const table of document.querySelectorAll("table.sortable")) {
  const headings = table.tHead.rows[table.tHead.rows.length - 1].cells;
  [...headings].forEach((heading, column) => {
    if (heading.tagName !== "TH" || heading.colSpan > 1) return;
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => sortBy(heading, column));
  });
}
// Flicker comparison: a case's picture gives way to its view's reference, in the same place.
for (const view of document.querySelectorAll(".view")) {
  const reference = view.querySelector(".reference img");
  for (const button of view.querySelectorAll(".flicker")) {
    const picture = button.closest("figure").querySelector("img");
    if (!reference) { button.remove(); continue; }
    const own = { src: picture.src, alt: picture.alt };
    button.addEventListener("click", () => {
      const shown = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(shown));
      picture.src = shown ? reference.src : own.src;
      picture.alt = shown ? reference.alt : own.alt;
    });
  }
}
for (const button of document.querySelectorAll(".enlarge")) {
  button.addEventListener("click", () => {
    const large = button.closest(".pair").classList.toggle("large");
    button.setAttribute("aria-pressed", String(large));
  });
}
document.documentElement.classList.add("scripted");
