// Views and what holds for the whole page.
let listHash = "#/cases";
let present = null;
let listScroll = 0;

async function route() {
  const asked = location.hash;
  let { view, argument, query } = readHash();
  if (!$("#view-" + view)) [view, argument, query] = ["cases", "", new URLSearchParams()];
  if (present?.view === "cases" && view !== "cases") listScroll = scrollY;
  for (const section of $$("main > section")) section.hidden = section.id !== "view-" + view;
  for (const link of $$(".top nav a")) {
    if (link.dataset.view === (view === "case" ? "cases" : view)) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  if (view === "cases") {
    listHash = location.hash || "#/cases";
    showList(query);
    scrollTo(0, present?.view === "case" ? listScroll : 0);
    if (present?.view === "case") linkInList(PLACE.get(present.argument))?.focus({ preventScroll: true });
  } else scrollTo(0, 0);
  present = { view, argument };
  if (view === "coverage") showCoverage(query);
  if (view === "requirements") await showRequirements(query);
  if (view === "case") await openCase(argument, query);
  else closeCase();
  if (location.hash.split("?")[0] !== asked.split("?")[0]) return; // the reader is somewhere else by now
  document.title = (view === "case" ? argument + " – " : "") + TITLE;
  document.documentElement.dataset.shown = asked;
}

function showCoverage(query) {
  const stop = $$("#view-coverage [data-stop]").some((part) => part.dataset.stop === query.get("m")) ? query.get("m") : "";
  for (const part of $$("#view-coverage [data-stop]")) part.hidden = part.dataset.stop !== stop;
  if ($("#m-stop")) $("#m-stop").value = stop;
}

const TITLE = document.title;
setUpList();
setUpRequirements();
$("#m-stop")?.addEventListener("change", (event) => {
  rewriteQuery({ m: event.target.value });
  showCoverage(readHash().query);
});
addEventListener("hashchange", route);
for (const link of document.querySelectorAll("[data-pair]")) {
  link.addEventListener("click", (event) => {
    event.preventDefault();
    const pair = document.getElementById(link.dataset.pair);
    pair.open = true;
    pair.scrollIntoView();
  });
}
document.addEventListener("keydown", (event) => {
  if (readHash().view !== "case" || event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea")) return;
  const link = { "[": '[data-step="-1"]', "]": '[data-step="1"]' }[event.key];
  if (link) $(`#view-case ${link}[href]`)?.click();
  else if (event.key === "Escape") {
    const menu = $("#view-case .menu[open]");
    if (menu) menu.open = false;
    else location.hash = listHash;
  }
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  if (!opened || printing) return;
  const { view, argument, query } = readHash();
  if (view === "case") openCase(argument, query);
});
const print = (on) => {
  printing = on;
  document.documentElement.classList.toggle("printing", on);
  if (on) opened?.buildAll();
  if (on && opened) shortenForPaper(opened.data);
  if (on && present?.view === "cases") growList(Infinity);
  opened?.plot?.render();
};
addEventListener("beforeprint", () => print(true));
addEventListener("afterprint", () => print(false));
route();
