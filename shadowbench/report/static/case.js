// A case in full: its picture, large; everything that was measured; and the command that measures it again.
const dialog = document.getElementById("case");
const stage = document.getElementById("case-stage");
let opened = null;
function part(name) {
  return document.getElementById(`case-${name}`);
}
function factTable([title, columns, lines]) {
  const section = element("section");
  section.append(element("h3", "", title));
  const table = element("table", columns.length ? "" : "facts");
  if (columns.length) {
    const head = table.createTHead().insertRow();
    for (const column of columns) {
      const cell = element(column ? "th" : "td", "figure", column);
      if (column) cell.scope = "col";
      head.append(cell);
    }
  }
  const body = table.createTBody();
  for (const [name, ...values] of lines) {
    const row = body.insertRow();
    const heading = element("th", "", name);
    heading.scope = "row";
    row.append(heading, ...values.map((value) => element("td", columns.length ? "figure" : "", value)));
  }
  section.append(table);
  return section;
}
function openCase(id) {
  const entry = cases.get(id);
  if (!entry || !dialog) return false;
  opened = entry;
  part("title").textContent = entry.title;
  part("view").textContent = [entry.outcome, entry.method, entry.view.title].filter(Boolean).join(" \u00b7 ");
  part("reason").textContent = entry.reason;
  part("command").textContent = entry.command;
  part("copied").textContent = "";
  const links = [...entry.files, ...entry.view.files].map(([name, address]) => {
    const link = element("a", "", name);
    link.href = address;
    return link;
  });
  part("files").replaceChildren(...(links.length ? ["In full size: ", ...links] : []));
  const facts = entry.sections.map(factTable);
  if (entry.warnings.length) {
    const section = element("section");
    const list = element("ul");
    list.append(...entry.warnings.map((warning) => element("li", "", warning)));
    section.append(element("h3", "", "Warnings"), list);
    facts.unshift(section);
  }
  if (entry.stderr) {
    const section = element("section", "wide");
    section.append(element("h3", "", "The end of what the worker wrote"), element("pre", "", entry.stderr));
    facts.push(section);
  }
  part("facts").replaceChildren(...facts);
  part("before").disabled = entry.place === 0;
  part("after").disabled = entry.place === entry.view.cases.length - 1;
  stage.style.setProperty("--aspect", entry.view.size[0] / entry.view.size[1]);
  setCrop(stage, crop(document.getElementById(entry.view.id)));
  refreshCase();
  if (!dialog.open) { dialog.showModal(); part("close").focus(); }
  dialog.scrollTop = 0;
  return true;
}
// The link to the case that a table's cell belongs to: the line's only one, or the nearest to its left.
function linkOfLine(target) {
  const cell = target.closest?.("table.sortable tbody :is(td, th)");
  if (!cell || target.closest("button, input, summary") || !cell.textContent.trim()) return null;
  const selected = getSelection(); // who marks text to copy it opens nothing
  if (!selected.isCollapsed && selected.containsNode(cell.parentElement, true)) return null;
  const links = cell.parentElement.querySelectorAll("a.case");
  if (links.length < 2) return links[0] ?? null;
  let at = cell;
  while (at && !at.querySelector("a.case")) at = at.previousElementSibling;
  return at && at.querySelector("a.case");
}
function refreshCase() {
  if (!opened) return;
  const hasPicture = pictures[opened.result] || opened.layers.length;
  stage.hidden = !hasPicture;
  dialog.querySelector(".tools").hidden = !hasPicture;
  const frame = stage.firstElementChild ?? stage.appendChild(element("div", "frame"));
  if (hasPicture) fill(frame, opened.view, opened);
}
if (dialog) {
  const frame = stage.appendChild(element("div", "frame"));
  watch(frame, stage, null);
  stage.addEventListener("keydown", (event) => zoomByKey(stage, event));
  part("close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
  dialog.addEventListener("close", () => { opened = null; });
  for (const [name, step] of [["before", -1], ["after", 1]]) {
    part(name).addEventListener("click", () => openCase(opened.view.cases[opened.place + step].id));
  }
  part("copy").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(opened.command);
      part("copied").textContent = "copied";
    } catch {
      getSelection().selectAllChildren(part("command"));
      part("copied").textContent = "selected; copy it with the keyboard";
    }
  });
  // links to cases, in tables, claims and charts, open them; so does a click anywhere on a table's line
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("a") ?? linkOfLine(event.target);
    const address = link && link.getAttribute("href");
    if (address?.startsWith("#view-") && !event.ctrlKey && !event.metaKey && openCase(address.slice(1))) event.preventDefault();
  });
}
