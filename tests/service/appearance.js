// What a reader would trip over on this page: each fault in words, nothing if there is none.
() => {
  const faults = [];
  const width = document.documentElement.clientWidth;
  const name = (element) =>
    `${element.parentElement?.tagName} > ${element.tagName}.${element.className?.baseVal ?? element.className} '${element.textContent.trim().slice(0, 30)}'`;
  if (document.documentElement.scrollWidth > width)
    faults.push(`the page is ${document.documentElement.scrollWidth} wide, the window ${width}`);
  for (const element of document.body.querySelectorAll("*")) {
    const box = element.getBoundingClientRect();
    const scrolls = element.closest(".scroll, .scroll-plain, .skip-link, svg, pre, .swagger-ui");
    if (box.width && box.right > width + 1 && !scrolls) faults.push(`reaches out of the window: ${name(element)}`);
    const overflow = getComputedStyle(element).overflowX;
    if (["auto", "scroll"].includes(overflow) && element.scrollWidth > element.clientWidth && element.tabIndex < 0)
      faults.push(`can be pushed by pointer only: ${name(element)}`);
  }
  for (const image of document.images) {
    const box = image.getBoundingClientRect();
    if (Math.abs(box.width / box.height - image.naturalWidth / image.naturalHeight) > 0.02)
      faults.push(`picture out of shape: ${image.alt}`);
    if (box.width > image.parentElement.getBoundingClientRect().width + 1) faults.push(`picture cut: ${image.alt}`);
    if (!image.alt) faults.push("picture without a text");
  }
  if (document.querySelectorAll("h1").length !== 1) faults.push("not one h1");
  if (document.querySelectorAll("main").length !== 1) faults.push("not one main");

  // contrast of texts as WCAG 2 computes it
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [red, green, blue, alpha] = canvas.getImageData(0, 0, 1, 1).data;
    return [red, green, blue, alpha / 255];
  };
  const over = (front, back) => [0, 1, 2].map((k) => front[k] * front[3] + back[k] * (1 - front[3]));
  const luminance = (colour) => {
    const [red, green, blue] = colour.map((v) => (v <= 10.31475 ? v / 3294.6 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  };
  const ground = (element) => {
    const layers = [];
    for (let at = element; at; at = at.parentElement) {
      layers.unshift(rgba(getComputedStyle(at).backgroundColor));
      if (layers[0][3] === 1) break;
    }
    return layers.reduce((back, front) => over(front, back), [255, 255, 255]);
  };
  const seen = new Set();
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement;
    if (!texts.currentNode.textContent.trim() || seen.has(element) || ["SCRIPT", "STYLE"].includes(element.tagName)) continue;
    seen.add(element);
    if (!element.checkVisibility({ checkOpacity: true, checkVisibilityCSS: true })) continue;
    const svg = element.closest("svg");
    const back = ground(svg ?? element);
    const front = over(rgba(getComputedStyle(element)[svg ? "fill" : "color"]), back);
    const [dark, light] = [luminance(front), luminance(back)].sort((a, b) => a - b);
    const ratio = (light + 0.05) / (dark + 0.05);
    if (ratio < 4.5) faults.push(`contrast ${ratio.toFixed(2)}: ${name(element)}`);
  }
  return faults;
}
