// The requirement matrix: rows are made on demand, a catalogue may hold thousands.
const PAGE = 250;
const REQUIREMENT_ORDER = { failed: 0, error: 1, blocked: 2, passed: 3, untested: 4 };
let requirementRows = null;
let requirementLimit = PAGE;

// The part before the number, as `family_of` of the report has it.
function familyOf(id) {
  const dash = id.lastIndexOf("-");
  return (dash > 0 ? id.slice(0, dash) : "") || id.replace(/[0-9]+$/, "").replace(/[._ ]+$/, "") || id;
}

async function showRequirements(query) {
  if (!$("#r-rows")) return;
  requirementRows ??= (await readPacked("data-requirements")).map((row) => {
    const [id, title, section, source, verdict, known, cases, own] = row;
    const names = cases.map(([place]) => INDEX[place].id);
    return { id, title, section, source, verdict, known, cases, own, rank: REQUIREMENT_ORDER[verdict], prefix: familyOf(id), text: [id, title, section, source, ...names].join(" ").toLowerCase() };
  }).sort((a, b) => b.own - a.own || a.rank - b.rank);
  const words = (query.get("q") || "").toLowerCase().split(/\s+/).filter(Boolean);
  const prefix = query.get("p") || "";
  const verdict = query.get("v") || "";
  const wanted = { "": () => true, tested: (row) => row.verdict !== "untested", unknown: (row) => !row.known }[verdict] || ((row) => row.verdict === verdict);
  const found = requirementRows.filter((row) => (!prefix || row.prefix === prefix) && wanted(row) && words.every((word) => row.text.includes(word)));
  if ($("#r-q").value !== (query.get("q") || "")) $("#r-q").value = query.get("q") || "";
  $("#r-p").value = prefix;
  $("#r-v").value = verdict;
  $("#r-count").textContent = `${found.length} of ${requirementRows.length} requirements`;
  const body = $("#r-rows");
  body.replaceChildren(...found.slice(0, requirementLimit).map((row) =>
    h("tr", null,
      h("td", null, verdictTag(row.verdict)),
      h("td", null, row.id),
      h("td", null, row.known ? row.title : h("em", null, "not in the catalogue")),
      h("td", null, [row.source, row.section].filter(Boolean).join(" · ")),
      h("td", null, [...row.cases].sort((a, b) => GRAVITY[a[1]] - GRAVITY[b[1]]).slice(0, 6).map(([place, v]) => h("a", { href: caseLink(INDEX[place].id), title: v }, icon(v), "\u00a0", INDEX[place].id)),
        row.cases.length > 6 && h("a.more", { href: makeHash("cases", "", [["q", row.id.toLowerCase()]]) }, `and ${row.cases.length - 6} more`)))));
  $("#r-more").hidden = found.length <= requirementLimit;
  $("#r-more").textContent = `Show more (${found.length - requirementLimit} left)`;
}

function setUpRequirements() {
  if (!$("#r-rows")) return;
  const change = (values) => {
    requirementLimit = PAGE;
    rewriteQuery(values);
    showRequirements(readHash().query);
  };
  $("#r-filters").addEventListener("submit", (event) => event.preventDefault());
  $("#r-q").addEventListener("input", (event) => change({ q: event.target.value }));
  $("#r-p").addEventListener("change", (event) => change({ p: event.target.value }));
  $("#r-v").addEventListener("change", (event) => change({ v: event.target.value }));
  $("#r-more").addEventListener("click", () => {
    requirementLimit += 2000;
    showRequirements(readHash().query);
  });
}
