// The case list: filter, search, sort, keyboard. Rows come with the page; here they are only hidden and ordered.
const GRAVITY = { failed: 0, error: 1, blocked: 2, passed: 3 };
const listRows = $$("#cases tbody tr").map((row) => ({ row, i: Number(row.dataset.i), entry: INDEX[Number(row.dataset.i)] }));
const selects = { g: "#f-g", tag: "#f-tag", f: "#f-f" };
let visibleOrder = INDEX.map((_entry, i) => i);

function listFilter(query) {
  const verdicts = new Set((query.get("v") || "").split(",").filter(Boolean));
  const words = (query.get("q") || "").toLowerCase().split(/\s+/).filter(Boolean);
  const group = query.get("g");
  const tag = query.get("tag");
  const [fault, reaction, state] = [query.get("f"), query.get("r"), query.get("s")];
  return (entry) =>
    (!verdicts.size || verdicts.has(entry.v)) &&
    (!group || entry.g === group) &&
    (!tag || entry.tags.includes(tag)) &&
    (!(fault || reaction || state) || entry.f.some(([f, r, st]) => (!fault || f === fault) && (!reaction || r === reaction) && (!state || st === state))) &&
    words.every((word) => entry.q.includes(word));
}

function showList(query) {
  const matches = listFilter(query);
  const sort = query.get("o") || "v";
  const down = sort.startsWith("-");
  const key = sort.replace("-", "");
  const numbers = (item) => Number(item.row.cells[key === "s" ? 4 : 5].dataset.value ?? 0);
  const compare = {
    v: (a, b) => GRAVITY[a.entry.v] - GRAVITY[b.entry.v],
    n: (a, b) => a.entry.id.localeCompare(b.entry.id, "en", { numeric: true }),
    s: (a, b) => numbers(a) - numbers(b),
    w: (a, b) => numbers(a) - numbers(b),
  }[key] || (() => 0);
  listRows.sort((a, b) => (compare(a, b) * (down ? -1 : 1)) || a.i - b.i);
  const body = $("#cases tbody");
  visibleOrder = [];
  for (const item of listRows) {
    const show = matches(item.entry);
    item.row.hidden = !show;
    if (show) visibleOrder.push(item.i);
    body.append(item.row);
  }
  for (const th of $$("#cases thead th")) {
    const button = $("button", th);
    if (button && button.dataset.sort === key) th.setAttribute("aria-sort", down ? "descending" : "ascending");
    else th.removeAttribute("aria-sort");
  }
  $("#f-q").value !== (query.get("q") || "") && ($("#f-q").value = query.get("q") || "");
  const verdicts = (query.get("v") || "").split(",");
  for (const chip of $$("#filters .chip[data-verdict]")) chip.setAttribute("aria-pressed", verdicts.includes(chip.dataset.verdict));
  for (const [name, selector] of Object.entries(selects)) if ($(selector)) $(selector).value = query.get(name) || "";
  $$("#filters .token").forEach((token) => token.remove());
  for (const [name, label] of [["r", "reaction"], ["s", "state"]]) {
    const value = query.get(name);
    if (value) $("#f-clear").before(h("button.chip.token", { type: "button", title: "Remove this filter", onclick: () => changeList({ [name]: "" }) }, `${label}: ${value} ×`));
  }
  const filtered = visibleOrder.length !== INDEX.length;
  $("#f-count").textContent = filtered ? `${visibleOrder.length} of ${INDEX.length} cases` : `${INDEX.length} cases`;
  $("#f-clear").hidden = ![...query.keys()].some((name) => name !== "o");
  $("#no-match").hidden = visibleOrder.length > 0 || !INDEX.length;
}

function changeList(change) {
  rewriteQuery(change);
  listHash = location.hash;
  showList(readHash().query);
}

function setUpList() {
  const clear = () => changeList({ q: "", v: "", g: "", tag: "", f: "", r: "", s: "" });
  $("#f-clear").addEventListener("click", clear);
  $("#f-clear2").addEventListener("click", clear);
  $("#filters").addEventListener("submit", (event) => event.preventDefault());
  $("#f-q").addEventListener("input", (event) => changeList({ q: event.target.value }));
  for (const [name, selector] of Object.entries(selects)) $(selector)?.addEventListener("change", (event) => changeList({ [name]: event.target.value }));
  for (const chip of $$("#filters .chip[data-verdict]")) {
    chip.addEventListener("click", () => {
      const verdicts = new Set((readHash().query.get("v") || "").split(",").filter(Boolean));
      if (!verdicts.delete(chip.dataset.verdict)) verdicts.add(chip.dataset.verdict);
      changeList({ v: [...verdicts].join(",") });
    });
  }
  for (const button of $$("#cases th button")) {
    button.addEventListener("click", () => {
      const now = readHash().query.get("o") || "v";
      changeList({ o: now === button.dataset.sort ? "-" + now : button.dataset.sort });
    });
  }
  $("#cases tbody").addEventListener("click", (event) => {
    const row = event.target.closest("tr");
    if (row && !event.target.closest("a") && !String(getSelection())) location.hash = caseLink(INDEX[row.dataset.i].id);
  });
  document.addEventListener("keydown", (event) => {
    if (readHash().view !== "cases" || event.ctrlKey || event.metaKey || event.altKey) return;
    const typing = event.target.matches("input, select, textarea");
    if (event.key === "/" && !typing) {
      event.preventDefault();
      $("#f-q").focus();
    } else if (event.key === "Escape" && event.target.id === "f-q") {
      changeList({ q: "" });
    } else if (event.key === "ArrowDown" || event.key === "ArrowUp" || (!typing && (event.key === "j" || event.key === "k"))) {
      if (event.target.matches("select")) return;
      const links = $$("#cases tbody tr:not([hidden]) a.id");
      const here = links.indexOf(document.activeElement);
      const there = here < 0 ? 0 : here + (event.key === "ArrowDown" || event.key === "j" ? 1 : -1);
      if (links[there]) {
        event.preventDefault();
        links[there].focus();
      } else if (there < 0) $("#f-q").focus();
    }
  });
}
