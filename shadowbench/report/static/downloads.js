// Downloads that are compressed inside the page are unpacked before they are saved.
for (const link of document.querySelectorAll("a[data-unpacked]")) {
  link.addEventListener("click", async (event) => {
    if (!("DecompressionStream" in window) || link.classList.contains("unpacked")) return;
    event.preventDefault();
    const bytes = Uint8Array.from(atob(link.href.split(",")[1]), (character) => character.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const saved = element("a");
    saved.href = URL.createObjectURL(await new Response(stream).blob());
    saved.download = link.dataset.unpacked;
    saved.click();
    setTimeout(() => URL.revokeObjectURL(saved.href), 10000);
  });
}
document.documentElement.classList.add("scripted");
document.documentElement.dataset.ready = "yes";
