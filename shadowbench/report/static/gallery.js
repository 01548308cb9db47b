// The gallery: pictures are put in when they come near the window; one setting of what is shown holds for all of them,
// one crop for all pictures of a view.
const state = { layer: "failures", split: 0, classes: new Set([...page.kinds.map(([name]) => name), "classified"]) };
const cases = new Map();
for (const view of page.views) view.cases.forEach((entry, place) => cases.set(entry.id, { ...entry, view, place }));

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}
function picture(number, alt) {
  const image = element("img");
  image.src = pictures[number];
  image.alt = alt;
  image.draggable = false;
  return image;
}
// Fill a frame with the case's (or, without one, the view's reference) picture as the state asks.
function fill(frame, view, entry) {
  frame.replaceChildren();
  frame.classList.remove("faded");
  const title = entry ? entry.title : "Ray-traced reference";
  const layer = entry ? state.layer : "reference";
  const index = layer.startsWith("layer-") ? Number(layer.slice(6)) : -1;
  const own = index < 0 ? null : (entry.layers.find(([name]) => shortName(name) === page.layers[index]) ?? [null, 0]);
  const number = own ? own[1] : layer === "reference" ? view.reference : entry.result;
  const what = own ? page.layers[index] : layer === "failures" ? "result, failures painted on it" : layer;
  if (pictures[number]) frame.append(picture(number, `${title}: ${what}`));
  else frame.append(element("span", "none", absent(number, own, what)));
  if (entry && layer === "failures") {
    frame.classList.add("faded");
    if (pictures[entry.mask]) {
      const mask = element("img", "mask");
      mask.alt = "";
      mask.draggable = false;
      mask.src = recoloured(pictures[entry.mask], coloursOf(state.classes));
      frame.append(mask);
    }
  }
  if (entry && pictures[view.reference] && index < 0 && layer !== "reference") {
    const over = element("div", "over");
    over.append(picture(view.reference, ""));
    frame.append(over, element("div", "divider"));
  }
}
function shortName(name) {
  return name.length <= 80 ? name : `${name.slice(0, 40)}\u2026${name.slice(name.length - 39)}`;
}
function absent(number, own, what) {
  if (page.leftOut.includes(number)) return `${what}: left out to keep the page small`;
  return own && !number ? `no ${what}` : "no picture";
}
function setSplit(root) {
  root.style.setProperty("--split", `${state.split}%`);
  root.classList.toggle("is-split", state.split > 0);
}

// Zoom and pan: x and y are the shift in shares of the frame; the crop never leaves the picture.
function crop(root) {
  return (root.crop ??= { zoom: 1, x: 0, y: 0 });
}
function setCrop(root, { zoom, x, y }) {
  const held = Math.min(Math.max(zoom, 1), 16);
  const bound = (shift) => Math.min(0, Math.max(1 - held, shift));
  root.crop = { zoom: held, x: bound(x), y: bound(y) };
  root.style.setProperty("--zoom", held);
  root.style.setProperty("--x", `${100 * root.crop.x}%`);
  root.style.setProperty("--y", `${100 * root.crop.y}%`);
  root.classList.toggle("is-zoomed", held > 1);
}
function zoomBy(root, factor, at = [0.5, 0.5]) {
  const old = crop(root);
  const zoom = Math.min(Math.max(old.zoom * factor, 1), 16);
  const shift = (from, place) => place - ((place - from) * zoom) / old.zoom;
  setCrop(root, { zoom, x: shift(old.x, at[0]), y: shift(old.y, at[1]) });
}
function zoomByKey(root, event) {
  const old = crop(root);
  const moves = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "+" || event.key === "=") zoomBy(root, 1.5);
  else if (event.key === "-") zoomBy(root, 1 / 1.5);
  else if (event.key === "0") setCrop(root, { zoom: 1, x: 0, y: 0 });
  else if (event.key in moves && old.zoom > 1) {
    setCrop(root, { zoom: old.zoom, x: old.x + moves[event.key][0], y: old.y + moves[event.key][1] });
  } else return;
  event.preventDefault();
}
// Drag to pan, two fingers to zoom and pan, double-click to zoom in; a click without a drag does `click`.
function watch(frame, root, click) {
  const held = new Map(); // pointer -> where it is, in shares of the frame
  let from = null; // where the gesture began: its middle, how far its fingers were apart, the crop then
  let moved = false;
  const place = (event) => {
    const box = frame.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  const gesture = () => {
    const [[x, y], other] = held.values();
    if (!other) return { middle: [x, y], apart: 0 };
    const [across, down] = [(other[0] - x) * frame.clientWidth, (other[1] - y) * frame.clientHeight];
    return { middle: [(x + other[0]) / 2, (y + other[1]) / 2], apart: Math.hypot(across, down) };
  };
  const begin = () => { from = held.size ? { ...gesture(), crop: crop(root) } : null; };
  const end = (event) => {
    const was = held.delete(event.pointerId);
    if (was) begin();
    return was;
  };
  frame.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || held.size === 2) return;
    if (!held.size) moved = false;
    held.set(event.pointerId, place(event));
    frame.setPointerCapture(event.pointerId);
    begin();
  });
  frame.addEventListener("pointermove", (event) => {
    if (!held.has(event.pointerId)) return;
    held.set(event.pointerId, place(event));
    const { middle: [x, y], apart } = gesture();
    const [fromX, fromY] = from.middle;
    moved ||= held.size > 1 || Math.hypot(x - fromX, y - fromY) > 0.015;
    if (!moved) return;
    const zoom = Math.min(Math.max(from.crop.zoom * (from.apart ? apart / from.apart : 1), 1), 16);
    // what was under the middle of the fingers stays under it
    const shift = (old, then, now) => now - ((then - old) * zoom) / from.crop.zoom;
    setCrop(root, { zoom, x: shift(from.crop.x, fromX, x), y: shift(from.crop.y, fromY, y) });
  });
  frame.addEventListener("pointerup", (event) => {
    if (end(event) && !held.size && !moved && click) click();
  });
  frame.addEventListener("pointercancel", end);
  // one finger scrolls the page over a picture that is shown whole; two belong to the picture
  for (const name of ["touchstart", "touchmove"]) {
    frame.addEventListener(name, (event) => { if (event.touches.length > 1) event.preventDefault(); }, { passive: false });
  }
  frame.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoomBy(root, Math.exp(-event.deltaY / 200), place(event));
  }, { passive: false });
  if (!click) frame.addEventListener("dblclick", (event) => zoomBy(root, 2, place(event)));
}

const tiles = [];
const near = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    const tile = target.tile;
    tile.isNear = isIntersecting;
    if (isIntersecting && tile.stale) refresh(tile);
  }
}, { rootMargin: "600px" });
function refresh(tile) {
  tile.stale = false;
  fill(tile.frame, tile.view, tile.entry);
}
for (const view of page.views) {
  const root = document.getElementById(view.id);
  root.style.setProperty("--aspect", view.size[0] / view.size[1]);
  for (const figure of root.querySelectorAll(".tile")) {
    const frame = figure.querySelector(".frame");
    const entry = cases.get(figure.id);
    if (frame && (entry || pictures[view.reference])) {
      frame.tile = { frame, view, entry, stale: true, isNear: false };
      tiles.push(frame.tile);
      near.observe(frame);
      watch(frame, root, entry ? () => openCase(entry.id) : null);
    } else frame?.remove();
    figure.querySelector(".open")?.addEventListener("click", () => openCase(figure.id));
  }
  root.querySelector(".tiles").addEventListener("keydown", (event) => {
    if (event.target === event.currentTarget) zoomByKey(root, event);
  });
  for (const button of root.querySelectorAll("[data-zoom]")) {
    button.addEventListener("click", () => {
      if (button.dataset.zoom === "all") setCrop(root, { zoom: 1, x: 0, y: 0 });
      else zoomBy(root, button.dataset.zoom === "in" ? 2 : 0.5);
    });
  }
}
function refreshAll() {
  for (const tile of tiles) {
    tile.stale = true;
    if (tile.isNear) refresh(tile);
  }
  refreshCase();
}
addEventListener("beforeprint", () => tiles.filter((tile) => tile.stale).forEach(refresh));

// The two sets of tools, above the gallery and in an open case, are one setting.
function eachTool(selector, use) {
  for (const tool of document.querySelectorAll(`.tools ${selector}`)) use(tool);
}
const gallery = document.getElementById("gallery");
eachTool("select.layer", (select) => select.addEventListener("change", () => {
  state.layer = select.value;
  eachTool("select.layer", (other) => { other.value = state.layer; });
  refreshAll();
}));
eachTool("input.class", (box) => box.addEventListener("change", () => {
  if (box.checked) state.classes.add(box.value);
  else state.classes.delete(box.value);
  eachTool(`input.class[value="${box.value}"]`, (other) => { other.checked = box.checked; });
  refreshAll();
}));
eachTool("input.split", (range) => range.addEventListener("input", () => {
  state.split = Number(range.value);
  eachTool("input.split", (other) => { other.value = range.value; });
  setSplit(document.documentElement);
}));
eachTool("select.tile-size", (select) => select.addEventListener("change", () => { gallery.dataset.tiles = select.value; }));
document.getElementById("find")?.addEventListener("input", (event) => {
  const words = wordsOf(event.target.value);
  let shown = 0;
  for (const view of page.views) {
    let inView = 0;
    for (const entry of view.cases) {
      const figure = document.getElementById(entry.id);
      figure.hidden = !words.every((word) => figure.dataset.words.includes(word));
      inView += !figure.hidden;
    }
    document.getElementById(view.id).hidden = inView === 0;
    shown += inView;
  }
  document.getElementById("found").textContent = words.length ? `${shown} of ${cases.size} cases` : "";
});
