// The case list: filter, search and sort work on the index; the table holds only the rows that were scrolled to.
const GRAVITY = { failed: 0, error: 1, blocked: 2, passed: 3 };
const ROWS = 100;
const selects = { g: "#f-g", tag: "#f-tag", f: "#f-f", m: "#f-m", c: "#f-c" };
let visibleOrder = INDEX.map((_entry, i) => i);
let rowCount = 0;
let listShown = null; // the query that the table answers

function listFilter(query) {
  const verdicts = new Set((query.get("v") || "").split(",").filter(Boolean));
  const words = (query.get("q") || "").toLowerCase().split(/\s+/).filter(Boolean);
  const group = query.get("g");
  const tag = query.get("tag");
  const [stop, change] = [query.get("m"), query.get("c")];
  const [fault, reaction, state] = [query.get("f"), query.get("r"), query.get("s")];
  return (entry) =>
    (!verdicts.size || verdicts.has(entry.v)) &&
    (!group || entry.g === group) &&
    (!tag || entry.tags.includes(tag)) &&
    (!stop || entry.m.includes(stop)) &&
    (!change || entry.c === change) &&
    (fault === "-" ? !entry.f.length && !reaction && !state :
      !(fault || reaction || state) || entry.f.some(([f, r, st]) => (!fault || f === fault) && (!reaction || r === reaction) && (!state || st === state))) &&
    words.every((word) => entry.text.includes(word));
}

const collator = new Intl.Collator("en", { numeric: true });
const COMPARE = {
  v: (a, b) => GRAVITY[a.v] - GRAVITY[b.v],
  n: (a, b) => collator.compare(a.id, b.id),
  s: (a, b) => (a.s ?? 0) - (b.s ?? 0),
  w: (a, b) => (a.w ?? 0) - (b.w ?? 0),
};

function duration(value) {
  if (value === null || value === undefined) return "unknown";
  if (value >= 120) {
    const minutes = Math.floor(Math.round(value) / 60);
    const two = (number) => String(number).padStart(2, "0");
    return minutes >= 60 ? `${Math.floor(minutes / 60)} h ${two(minutes % 60)} min` : `${minutes} min ${two(Math.round(value) % 60)} s`;
  }
  return value >= 1 ? value.toFixed(2) + " s" : value ? (value * 1000).toFixed(0) + " ms" : "0 s";
}

/** Columns that the words of a case may take: the others are hidden in a narrow window (case.css). */
const COLUMN_LIMITS = [matchMedia("(min-width: 901px)"), matchMedia("(min-width: 1101px)")];
const wordColumns = () => 1 + COLUMN_LIMITS.filter((limit) => limit.matches).length;

function listRow(place, position) {
  const entry = INDEX[place];
  const several = (values) => values.map((value) => h("span", { title: value }, value));
  const happened = entry.fl.length + entry.al.length > 0; // the words of other cases take the empty columns, too
  return h("tr.row-" + entry.v, { "data-i": place, "aria-rowindex": position + 2 },
    h("td.c-v", null, verdictTag(entry.v)),
    h("td.c-case", { colspan: happened ? null : wordColumns() },
      h("div.line", null, h("a.id", { href: caseLink(entry.id) }, entry.id), entry.c && h("span.change", null, entry.c), entry.t && h("span.title", { title: entry.t }, entry.t)),
      entry.h && h("span.head", null, entry.h)),
    happened && [h("td.c-fault", null, several(entry.fl)), h("td.c-alarm", null, several(entry.al))],
    h("td.num.c-time", null, duration(entry.s)), h("td.num.c-time", null, duration(entry.w)));
}

/** Put more rows into the table: up to a number of them, by default one step more. */
function growList(wanted = rowCount + ROWS) {
  const body = $("#cases tbody");
  const end = Math.min(wanted, visibleOrder.length);
  const rows = document.createDocumentFragment();
  for (; rowCount < end; rowCount++) rows.append(listRow(visibleOrder[rowCount], rowCount));
  body.append(rows);
  const left = visibleOrder.length - rowCount;
  $("#c-more").hidden = !left;
  $("#c-more").textContent = `Show more (${left} left)`;
}

/** The link of a case in the table, whose row is made if it has to be; nothing for a case that the filter hides. */
function linkInList(place) {
  const position = visibleOrder.indexOf(place);
  if (position < 0) return null;
  if (position >= rowCount) growList(position + 1);
  return $(`#cases tbody tr[data-i="${place}"] a.id`);
}

function showList(query) {
  const signature = query.toString();
  if (signature === listShown) return;
  listShown = signature;
  const matches = listFilter(query);
  const sort = query.get("o") || "v";
  const down = sort.startsWith("-");
  const key = sort.replace("-", "");
  const compare = COMPARE[key] || (() => 0);
  visibleOrder = [];
  INDEX.forEach((entry, i) => matches(entry) && visibleOrder.push(i));
  visibleOrder.sort((a, b) => compare(INDEX[a], INDEX[b]) * (down ? -1 : 1) || a - b);
  rowCount = 0;
  $("#cases tbody").replaceChildren();
  $("#cases").setAttribute("aria-rowcount", visibleOrder.length + 1);
  growList();
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

function walkList(step) {
  const row = document.activeElement?.closest?.("#cases tbody tr");
  if (!row) {
    const first = visibleOrder.length ? linkInList(visibleOrder[0]) : null;
    first?.focus();
    return Boolean(first);
  }
  const there = visibleOrder.indexOf(Number(row.dataset.i)) + step;
  if (there < 0) $("#f-q").focus();
  else if (there < visibleOrder.length) linkInList(visibleOrder[there]).focus();
  return true;
}

function setUpList() {
  for (const limit of COLUMN_LIMITS) {
    limit.addEventListener("change", () => {
      listShown = null;
      if (readHash().view === "cases") showList(readHash().query);
    });
  }
  const clear = () => changeList({ q: "", v: "", g: "", tag: "", f: "", r: "", s: "", m: "", c: "" });
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
  $("#c-more").addEventListener("click", () => growList());
  new IntersectionObserver((seen) => seen.some((one) => one.isIntersecting) && growList(), { rootMargin: "800px" }).observe($("#c-more"));
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
      if (walkList(event.key === "ArrowDown" || event.key === "j" ? 1 : -1)) event.preventDefault();
    }
  });
}
