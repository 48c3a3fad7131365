// One case: headline, plot, and the inspector with checks, story, bus, faults and alarms, evidence.
let opened = null; // { id, data, plot, marks }

function gauge(check) {
  if (check.value === null || (check.low === null && check.high === null)) return null;
  const known = [check.value, check.low, check.high].filter((v) => v !== null);
  let [low, high] = [Math.min(...known), Math.max(...known)];
  if (check.low === null) low = Math.min(low, check.scale || low >= 0 ? 0 : low);
  const span = high - low || Math.abs(high) || 1;
  [low, high] = [low - (check.low === null && low === 0 ? 0 : span * 0.12), high + span * 0.12];
  const x = (v) => 3 + ((v - low) / (high - low)) * 144;
  const [a, b] = [check.low === null ? 3 : x(check.low), check.high === null ? 147 : x(check.high)];
  const bad = check.v === "failed";
  const px = x(check.value);
  return s("svg", { viewBox: "0 0 150 16", role: "img", "aria-label": `measured ${plainNumber(check.value)} ${check.unit}, limits ${check.limits}` },
    s("rect", { x: 3, y: 6, width: 144, height: 4, rx: 2, fill: css("--line") }),
    s("rect", { x: a, y: 5, width: Math.max(1, b - a), height: 6, fill: css("--bar-ok"), opacity: 0.55 }),
    [check.low, check.high].filter((v) => v !== null).map((v) => s("line", { x1: x(v), x2: x(v), y1: 1, y2: 15, stroke: css("--ok"), "stroke-width": 1.6 })),
    bad ? s("path", { d: `M${px - 4} 4l8 8M${px + 4} 4l-8 8`, stroke: css("--bar-bad"), "stroke-width": 2.4 }) : s("path", { d: `M${px} 3l5 5-5 5-5-5z`, fill: css("--ok") }));
}

const requirementLinks = (names) => names.length > 0 && h("div.reqlist", null, names.map((name) => h("a", { href: makeHash("requirements", "", [["q", name]]) }, name)));

/** A row of a check: what happened in one sentence; what was expected and observed is folded. */
function checkRow(check, i, data, jump) {
  const target = check.t ?? check.since;
  const go = () => target !== null && jump(target, check.since === check.t ? null : check.since, i);
  return h("tr.v-" + check.v + (target !== null ? ".go" : ""), { "data-check": i, onclick: (event) => event.target.closest("a, summary, details") || go() },
    h("td", null, verdictTag(check.v)),
    h("td", null, h("div.line", null, h("button.name", { type: "button", disabled: target === null, title: target === null ? null : "Show in the plot" }, check.sentence),
      check.t !== null && h("span.when", null, seconds(check.t), data.zero !== null && ` (${relative(check.t, data.zero)})`)),
      check.limits && !(check.v === "passed" && check.low === check.high) && h("div.gauge", null, gauge(check), h("span", null, h("span.lim", null, check.limits), check.margin && [" · ", h("span.margin", null, check.margin)])),
      h("details.fold", null, h("summary", null, check.name),
        h("dl", null, h("dt", null, "expected"), h("dd", null, check.expected || "–"), h("dt", null, "observed"), h("dd.observed", null, check.observed || "–")),
        check.v === "passed" && requirementLinks(check.reqs)),
      check.v !== "passed" && requirementLinks(check.reqs)));
}

/** The expectations of the case, the bad ones first; rules that hold in every run are folded while they do hold. */
function checksView(data, jump) {
  if (!data.checks.length) return [h("p.empty", null, "No expectation was evaluated.")];
  const rank = ([check]) => GRAVITY[check.v] * 2 + (check.rule ? 1 : 0);
  const sorted = data.checks.map((check, i) => [check, i]).sort((a, b) => rank(a) - rank(b));
  const folded = sorted.filter(([check]) => check.rule && check.v === "passed");
  const table = (rows, caption) => h("div.scroll", null, h("table.checks", null, h("caption.sr", null, caption),
    h("thead", null, h("tr", null, h("th", { scope: "col" }, "Verdict"), h("th", { scope: "col" }, "Check"))),
    h("tbody", null, rows.map(([check, i]) => checkRow(check, i, data, jump)))));
  return [
    sorted.length > folded.length && table(sorted.filter((row) => !folded.includes(row)), "Checks"),
    folded.length > 0 && h("details.rules", { open: folded.length === sorted.length }, h("summary", null, icon("passed"), folded.length === 1 ? "1 rule of the bench held" : `${folded.length} rules of the bench held`), table(folded, "Rules of the bench")),
  ];
}

/** What the case said when it ended, where its headline and checks do not say it; a traceback is folded. */
function messageView(data) {
  const fold = (text) => h("details.rules", null, h("summary", null, "Traceback"), h("p.message", null, text));
  const more = data.message && data.message !== data.head;
  if (data.traceback) return [more && data.message.includes("\n") && h("p.message", null, data.message), fold(data.traceback)];
  if (!more) return null;
  if (data.message.includes("\n")) return fold(data.message);
  return data.checks.some((check) => check.v !== "passed") ? null : h("p.message", null, data.message);
}

function storyView(data, jump) {
  return h("ol.story", null, data.story.map(([t, kind, text, detail]) => {
    const check = kind === "expect" && data.checks.find((c) => text === c.sentence || (c.t !== null && Math.abs(c.t - t) < 1e-6 && text.startsWith(c.name)));
    const mood = check ? (check.v === "failed" ? ".bad" : check.v === "passed" ? ".good" : "") : "";
    const known = ["do", "inject", "observe", "expect"].includes(kind);
    const sign = check && check.v in GRAVITY ? check.v : known ? kind : "observe";
    return h(`li.k-${known ? kind : "observe"}${mood}`, { "data-t": t, onclick: () => t !== null && jump(t) },
      h("time", null, seconds(t), data.zero !== null && t !== null && h("span.rel", null, relative(t, data.zero))),
      h("span.dot", null, icon(sign)),
      h("div", null, h("button", { type: "button" }, h("span.kind", null, kind), text),
        detail.length > 0 && h("small", null, detail.map(([name, value]) => `${name} ${value}`).join(" · "))));
  }));
}

/** The meaning of a message: its name, the decoded values folded below it. Other columns have station and unit of a Modbus frame. */
function meaning(text, id) {
  const modbus = id.startsWith("unit");
  if (modbus) text = text.replace(/^([^:]+: )?(transaction \d+ )?unit \d+ /, "");
  const at = text.search(modbus ? /: | = / : /: /);
  if (at < 0 || text.length < 60) return text;
  return h("details", null, h("summary", null, text.slice(0, at)), text.slice(at).replace(/^(: | = )/, "").split(/, | (?=\()/).map((part) => h("div", null, part)));
}

const NEAR = 60; // messages that are shown before anybody asks for more

function busView(data, jump) {
  if (!data.messageTotal) return [h("p.empty", null, "No bus message was recorded.")];
  const filter = h("input", { type: "search", placeholder: "Filter", "aria-label": "Filter messages", spellcheck: "false" });
  const onlyErrors = h("input", { type: "checkbox" });
  const count = h("span");
  const body = h("tbody");
  const more = h("button.plain", { type: "button", onclick: () => grow() });
  const rest = h("p.empty");
  const errors = data.messages.filter((row) => row[6]).length;
  let messages = data.messages;
  let whole = messages.length <= NEAR;
  const events = [
    ...data.faults.flatMap((f) => [[f[3], "fault", `${f[0]} on ${f[1]} applied`], [f[4], "fault", `${f[0]} on ${f[1]} removed`]]),
    ...data.alarms.map((a) => [a[0], "alarm", `${a[2]}: alarm ${a[3]}, ${a[5]}`]),
  ].filter((event) => event[0] !== null).sort((a, b) => a[0] - b[0]);
  const time = (t) => [h("time", null, seconds(t)), data.zero !== null && h("small", null, relative(t, data.zero))];
  /** The messages to begin with: those with errors, and the nearest to what has happened. */
  const near = () => {
    const moments = data.focus.length ? data.focus : [messages[0][0] ?? 0];
    const far = (row) => (row[6] ? -1 : Math.min(...moments.map((t) => Math.abs(t - row[0]))));
    const kept = new Set(messages.map((row, i) => [far(row), i]).sort((a, b) => a[0] - b[0] || a[1] - b[1]).slice(0, Math.max(NEAR, errors)).map(([, i]) => i));
    let gap = 0;
    return messages.flatMap((row, i) => {
      gap += row[7];
      if (!kept.has(i)) {
        gap++;
        return [];
      }
      const found = [...row.slice(0, 7), gap];
      gap = 0;
      return [found];
    });
  };
  const grow = async () => {
    if (data.log) messages = await unpacked(data.log);
    whole = true;
    fill();
  };
  const fill = () => {
    const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const plain = !words.length && !onlyErrors.checked;
    const rows = [];
    let next = 0;
    const eventsUntil = (t) => {
      for (; next < events.length && events[next][0] <= t; next++) {
        const [at, kind, text] = events[next];
        rows.push(h("tr.event." + kind, { "data-t": at, onclick: () => jump(at) }, h("td", null, time(at)), h("td", { colspan: 2 }, icon(kind === "fault" ? "inject" : "alarm"), " ", text)));
      }
    };
    const chosen = plain && !whole ? near() : messages;
    for (const [t, bus, id, hex, sender, text, error, gap] of chosen) {
      if (onlyErrors.checked && !error) continue;
      if (words.length && !words.every((word) => `${bus} ${id} ${sender} ${text} ${error} ${hex}`.toLowerCase().includes(word))) continue;
      if (plain && gap) rows.push(h("tr.gap", null, h("td", { colspan: 3 }, `${gap} messages left out`)));
      eventsUntil(t ?? Infinity);
      rows.push(h("tr" + (error ? ".err" : ""), { "data-t": t, onclick: () => t !== null && jump(t) }, h("td", null, time(t)),
        h("td", null, id && h("span.id", null, id), h("small", null, sender)),
        h("td", null, error && h("span.what", null, icon("error"), " ", error), meaning(text, id), h("small", null, bus, " ", h("span.data", null, hex)))));
    }
    eventsUntil(Infinity);
    body.replaceChildren(...rows);
    const shown = plain ? chosen.length : rows.filter((row) => !row.classList.contains("event")).length;
    count.textContent = shown < data.messageTotal ? `${shown} of ${data.messageTotal}` : `${shown} messages`;
    const held = data.log ? data.messageTotal : messages.length;
    more.hidden = whole || !plain;
    more.textContent = `Show all ${held}`;
    rest.textContent = whole && messages.length < data.messageTotal ? `Shown are frames with errors and those nearest to faults, alarms and failed checks. All ${data.messageTotal} are in the bus log of the case.` : "";
    rest.hidden = !rest.textContent;
    opened?.marks?.();
  };
  filter.addEventListener("input", fill);
  onlyErrors.addEventListener("change", fill);
  fill();
  return [h("div.bus-tools", null, h("label.search", null, icon("search"), filter), h("label", null, onlyErrors, `errors (${errors})`), count),
    h("table.bus", null, h("caption.sr", null, "Bus messages"), h("colgroup", null, h("col", { style: "width:94px" }), h("col", { style: "width:78px" }), h("col")), body),
    h("p.grow", null, more), rest];
}

function faultsView(data, jump) {
  const at = (t, none) => (t === null ? none : h("button.time", { type: "button", onclick: () => jump(t) }, seconds(t), data.zero !== null && ` (${relative(t, data.zero)})`));
  const pair = (name, value) => value && value !== "" && [h("dt", null, name), h("dd", null, value)];
  const faults = data.faults.map((f) => h("div.card", null, h("h3", null, icon("inject"), f[0], " → ", f[1]), h("dl", null,
    pair("trigger", f[5]), pair("armed", at(f[2], "–")), pair("applied", at(f[3], "never: the trigger did not come, or the bench cannot inject it")), pair("removed", at(f[4], "stayed until the end")),
    pair("axis state", f[6]), pair("parameters", f[7].map(([name, value]) => `${name} = ${value}`).join(", ")))));
  const alarms = data.alarms.map((a) => h("div.card.alarm", null, h("h3", null, icon("alarm"), `Alarm ${a[3]} on ${a[2]}`), h("dl", null,
    pair("text", a[6]), pair("reaction", `${a[4]} – ${a[5]}`), pair("raised", at(a[0], "–")), pair("cause gone", at(a[7], "")), pair("cleared", at(a[1], "stayed until the end")))));
  return [h("h2", null, "Faults"), faults.length ? faults : h("p.empty", null, "None injected."), h("h2", null, "Alarms"), alarms.length ? alarms : h("p.empty", null, "None raised.")];
}

function evidenceView(data) {
  const pair = (name, ...value) => [h("dt", null, name), h("dd", null, ...value)];
  return [
    h("h2", null, "Repeat this case"),
    h("dl.kv", null, data.token && [pair("command", h("code", null, data.replay), " ", copyButton(data.replay, "the command")), pair("token", h("code", null, data.token), " ", copyButton(data.token, "the token"))],
      pair("seed", h("span.mono", null, data.seed)), pair("trace digest", h("span.mono", null, data.digest || "–"))),
    h("h2", null, "Requirements"), h("dl.kv", null, pair("claimed", requirementLinks(data.reqs) || "none")),
    h("h2", null, "Files"), h("dl.kv", null, data.files.length ? data.files.map(([name, path, link]) => pair(name, link ? h("a", { href: link }, path) : path)) : pair("", "none")),
    h("h2", null, "Bench and environment"), h("dl.kv", null, pair("", h("a", { href: "#/run" }, "versions, machine and bench file of the run"))),
  ];
}

let opening = 0; // counts what was asked for: of two cases that are on their way the later one is shown

async function openCase(identifier, query) {
  const place = PLACE.get(identifier);
  const view = $("#view-case");
  closeCase();
  if (place === undefined) {
    view.replaceChildren(h("p.empty", null, "This run has no case ", h("code", null, identifier), ". ", h("a", { href: "#/cases" }, "All cases")));
    return;
  }
  const mine = opening;
  const waiting = h("p.empty", { role: "status" }, "Loading the case …");
  view.replaceChildren(waiting);
  try {
    const data = await caseData(place);
    if (mine === opening) await showCase(identifier, place, data, query);
  } catch (error) {
    const where = FOLDER && ` The folder ${FOLDER} of the same run has to be next to the page.`;
    waiting.replaceChildren(`The data of this case cannot be read: ${error.message}.${where || ""} `, h("a", { href: "#/cases" }, "All cases"));
  }
}

/** Choose what lies under the curves: the last run in which the case passed, or another case of this run. */
function compareTool(data, place, query) {
  const group = INDEX.filter((entry, i) => i !== place && entry.g === INDEX[place].g).slice(0, 300);
  const option = (value, text) => h("option", { value }, text);
  const pick = h("select.tool.pick-run", { "aria-label": "Compare with another run", title: "Draw another run broad and pale under the curves" }, option("", "Compare with …"),
    data.passed && option("passed", data.passed[0]), group.length > 0 && h("optgroup", { label: "Cases of the group" }, group.map((entry) => option("case " + entry.id, entry.id))));
  const align = h("button.tool", { type: "button", hidden: true, title: "What both runs have at the same place: their start or their first fault" });
  let onFault = query.get("by") !== "start";
  const show = async (plot) => {
    const chosen = pick.value;
    const other = !chosen ? null : chosen === "passed" ? await unpacked(data.passed[1]) : await caseData(PLACE.get(chosen.slice(5)));
    const both = other && other.zero !== null && data.zero !== null;
    align.hidden = !both;
    align.textContent = onFault ? "Aligned on the fault" : "Aligned on the start";
    plot.compare(other, both && onFault ? data.zero - other.zero : 0);
    rewriteQuery({ with: chosen, by: both && !onFault ? "start" : "" });
  };
  return (plot) => {
    if (pick.options.length < 2) return null;
    pick.addEventListener("change", () => show(plot));
    align.addEventListener("click", () => {
      onFault = !onFault;
      show(plot);
    });
    pick.value = query.get("with") ?? "";
    if (pick.selectedIndex < 0) pick.value = "";
    if (pick.value) queueMicrotask(() => show(plot));
    return [pick, align];
  };
}

function showCase(identifier, place, data, query) {
  const view = $("#view-case");
  const order = visibleOrder.includes(place) ? visibleOrder : INDEX.map((_entry, i) => i);
  const here = order.indexOf(place);
  const step = (offset, name, key) => {
    const other = order[here + offset];
    return h("a", { href: other === undefined ? null : caseLink(INDEX[other].id), "aria-disabled": other === undefined, title: `${name} case, key ${key}`, "data-step": offset }, offset < 0 && icon("back"), name, offset > 0 && icon("next"));
  };
  const head = h("div.case-head", null, verdictTag(data.v), h("div.words", null,
    h("h1", null, data.head || data.title || data.id),
    h("div.sub", null, h("span.id", null, data.id), data.head && data.title && h("span", null, data.title), data.sim !== null && h("span", null, `${plainNumber(data.sim)} s simulated in ${plainNumber(data.wall)} s`),
      data.tags.length > 0 && h("span", null, data.tags.map((tag) => h("span.tag", null, tag)))),
    data.token && h("div.replay", null, h("code", { title: data.replay }, data.replay), copyButton(data.replay, "the replay command"))),
  h("nav", { "aria-label": "Cases" }, step(-1, "Previous", "["), h("a", { href: listHash, title: "Key Escape" }, "All cases"), step(1, "Next", "]")));

  const pane = h("div.plot-pane");
  if (data.homings.length) append(pane, [h("section.homings", { "aria-label": "Homing", tabindex: 0 }, data.homings.map((homing, i) => homingView(homing, i, (t) => jump(t))))]);
  if (data.cams.length) append(pane, [h("section.homings", { "aria-label": "Followers and cams", tabindex: 0 }, data.cams.map(camView))]);
  const plotted = data.panels.length + data.lanes.length > 0;
  const jump = (t, since, check) => {
    opened.plot?.goTo(t, since);
    for (const row of $$(".checks tr", view)) row.classList.toggle("now", check !== undefined && Number(row.dataset.check) === check);
  };
  const tabs = [
    ["checks", "Checks", data.checks.length, () => [h("h2", null, "Checks"), checksView(data, jump), messageView(data), h("h2", null, "What happened"), storyView(data, jump)]],
    ["bus", "Bus", data.messages.length, () => busView(data, jump)],
    ["faults", "Faults, alarms", data.faults.length + data.alarms.length, () => faultsView(data, jump)],
    ["evidence", "Evidence", "", () => evidenceView(data)],
  ];
  const panels = tabs.map(([key]) => h("div.tabpanel", { role: "tabpanel", id: "panel-" + key, "aria-labelledby": "tab-" + key, tabindex: 0, hidden: true }));
  const built = new Set();
  const build = (i) => {
    if (!built.has(i)) append(panels[i], [tabs[i][3]()]);
    built.add(i);
  };
  const select = (i, focus) => {
    build(i);
    panels.forEach((panel, k) => { panel.hidden = k !== i; });
    buttons.forEach((button, k) => {
      button.setAttribute("aria-selected", k === i);
      button.tabIndex = k === i ? 0 : -1;
    });
    if (focus) buttons[i].focus();
    rewriteQuery({ tab: i ? tabs[i][0] : "" });
    opened?.marks?.();
  };
  const buttons = tabs.map(([key, title, count], i) => h("button", {
    type: "button", role: "tab", id: "tab-" + key, "aria-controls": "panel-" + key, onclick: () => select(i),
    onkeydown: (event) => {
      const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (move) select((i + move + tabs.length) % tabs.length, true);
    },
  }, title, count !== "" && [" ", h("b", null, String(count))]));
  const article = h("div.case.v-" + data.v, null, head, pane, h("aside.inspector", { "aria-label": "Details" }, h("div.tabs", { role: "tablist" }, buttons), panels));
  view.replaceChildren(article);
  opened = { id: identifier, data, plot: null, marks: null, buildAll: () => panels.forEach((_panel, i) => build(i)) };
  select(Math.max(0, tabs.findIndex(([key]) => key === query.get("tab"))));

  opened.marks = () => {
    const t = opened.plot?.a ?? null;
    for (const panel of panels.slice(0, 2)) {
      if (panel.hidden) continue;
      const rows = $$(".story li, .bus tr[data-t]", panel);
      const now = t === null ? null : rows.filter((row) => Number(row.dataset.t) <= t + 1e-6).at(-1);
      rows.forEach((row) => row.classList.toggle("now", row === now));
      if (panel.id === "panel-bus" && matchMedia("(min-width: 1101px)").matches) now?.scrollIntoView({ block: "nearest" });
    }
  };
  if (!plotted) {
    pane.append(h("p.no-plot", null, "No signal was recorded in this case."));
    return;
  }
  addPlot(data, pane, query, compareTool(data, place, query));
}

function addPlot(data, pane, query, tools) {
  const plot = makePlot(data, pane, {
    tools,
    moved: (t) => {
      rewriteQuery({ t: t === null ? "" : t.toFixed(6) });
      opened?.marks?.();
    },
    ranged: (range) => rewriteQuery({ z: range ? range.map((t) => t.toFixed(6)).join(",") : "" }),
  });
  opened.plot = plot;
  const zoom = (query.get("z") || "").split(",").map(Number);
  if (zoom.length === 2 && zoom.every(Number.isFinite) && zoom[1] > zoom[0]) plot.setRange(...zoom);
  const t = query.has("t") ? Number(query.get("t")) : NaN;
  const first = data.v === "failed" && !query.has("z") && data.checks.find((check) => check.v === "failed");
  if (Number.isFinite(t)) plot.setCursor(t);
  else if (first && (first.t ?? first.since) !== null) plot.setCursor(first.t ?? first.since);
}

const ON_PAPER = 40; // steps of the story that are printed

/** Leave out of the story what is far from all that happened: a printed case has two pages. */
function shortenForPaper(data) {
  const steps = $$("#view-case .story li:not(.left-out)");
  const moments = data.focus.length ? data.focus : [data.end];
  const far = (step) => (step.matches(".k-inject, .k-do, .bad") ? -1 : Math.min(...moments.map((t) => Math.abs(t - Number(step.dataset.t)))));
  const kept = new Set(steps.map((step) => [far(step), step]).sort((a, b) => a[0] - b[0]).slice(0, ON_PAPER).map(([, step]) => step));
  for (const step of steps) step.classList.toggle("beyond", !kept.has(step));
  $("#view-case .story .left-out")?.remove();
  if (steps.length > kept.size) $("#view-case .story").append(h("li.left-out", null, `${steps.length - kept.size} steps further from what happened are in the page`));
}

function closeCase() {
  opened?.plot?.destroy();
  opened = null;
  opening++;
}
