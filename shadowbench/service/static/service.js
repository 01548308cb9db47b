// Colours: as the system has them, or light or dark by choice, the same choice as in reports.
const THEMES = { system: "as the system", light: "light", dark: "dark" };
const themeButton = document.getElementById("theme");
function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  themeButton.textContent = `Colours: ${THEMES[theme]}`;
}
function storedTheme() {
  try { return localStorage.getItem("shadowbench-theme"); } catch { return null; }
}
setTheme(storedTheme() in THEMES ? storedTheme() : "system");
themeButton.addEventListener("click", () => {
  const names = Object.keys(THEMES);
  const next = names[(names.indexOf(document.documentElement.dataset.theme) + 1) % names.length];
  setTheme(next);
  try { localStorage.setItem("shadowbench-theme", next); } catch { /* then it lasts as long as the page */ }
});
document.documentElement.classList.add("scripted");
