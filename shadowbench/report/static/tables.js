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
    if (heading.tagName !== "TH" || heading.colSpan > 1 || heading.classList.contains("unsorted")) return;
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => sortBy(heading, column));
  });
}
// Filtering: lines stay that hold every word, in any of their cells.
function wordsOf(text) {
  return text.toLowerCase().split(/\s+/).filter(Boolean);
}
for (const field of document.querySelectorAll("input.filter")) {
  const table = document.getElementById(field.getAttribute("aria-controls"));
  const status = field.closest(".table-tools").querySelector(".status");
  field.addEventListener("input", () => {
    const words = wordsOf(field.value);
    let shown = 0;
    for (const row of table.tBodies[0].rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      shown += !row.hidden;
    }
    status.textContent = words.length ? `${shown} of ${table.tBodies[0].rows.length} lines` : "";
  });
}
