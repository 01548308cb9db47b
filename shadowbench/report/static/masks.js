// Failure masks: palette pictures whose colours are rewritten when a class is switched on or off (masks.py says how).
const page = JSON.parse(document.getElementById("page-content").textContent);
const pictures = JSON.parse(document.getElementById("page-pictures").textContent);
const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let bit = 0; bit < 8; bit += 1) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n;
});
function crc(bytes) {
  let value = 0xffffffff;
  for (const byte of bytes) value = CRC[(value ^ byte) & 255] ^ (value >>> 8);
  return (value ^ 0xffffffff) >>> 0;
}
// The colour of each index, null for none: a part of a class that is off counts as its class.
function coloursOf(classes) {
  const kindColour = (index) => {
    for (let kind = index; kind > 0;) {
      const [name, whole] = page.kinds[kind - 1];
      if (classes.has(name)) return page.palette[kind];
      kind = page.kinds.findIndex(([other]) => other === whole) + 1;
    }
    return null;
  };
  const step = page.kinds.length + 1;
  return page.palette.map((_, index) => {
    const colour = kindColour(index % step);
    return colour ?? (index >= step && classes.has("classified") ? page.palette[step] : null);
  });
}
function recoloured(address, colours) {
  const [head, text] = address.split(",");
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  for (let at = 8; at < bytes.length;) {
    const length = view.getUint32(at);
    const name = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    if (name === "PLTE") colours.forEach((colour, i) => { if (3 * i < length) bytes.set(colour ?? [0, 0, 0], at + 8 + 3 * i); });
    if (name === "tRNS") colours.forEach((colour, i) => { if (i < length) bytes[at + 8 + i] = colour ? 255 : 0; });
    if (name === "PLTE" || name === "tRNS") view.setUint32(at + 8 + length, crc(bytes.subarray(at + 4, at + 8 + length)));
    at += 12 + length;
  }
  let characters = "";
  for (let at = 0; at < bytes.length; at += 8192) characters += String.fromCharCode(...bytes.subarray(at, at + 8192));
  return `${head},${btoa(characters)}`;
}
