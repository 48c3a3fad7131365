// A running campaign: progress, results as they come, workers, stop and resume, earlier runs.

import { enter } from "./connection.js";
import { h, mark, number, s, show, text, toast } from "./dom.js";

const ASK_MS = 500;
const MOST_ROWS = 1000;
const VERDICTS = ["passed", "failed", "error", "blocked"];
const STAGES = { running: "Running", stopping: "Stopping \u2026", stopped: "Stopped", finished: "Finished" };

function duration(seconds) {
  if (seconds === null || seconds === undefined) return "\u2013";
  const whole = Math.round(seconds);
  const pad = (value) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return hours ? `${hours}:${pad(Math.floor(whole / 60) % 60)}:${pad(whole % 60)}` : `${Math.floor(whole / 60)}:${pad(whole % 60)}`;
}

async function post(path) {
  const answer = await fetch(path, { method: "POST" });
  if (!answer.ok) toast(await answer.text(), "error");
}

function reading(name) {
  const value = h("span.reading", {}, "\u2013");
  return { element: h("div.number", {}, h("span.name", {}, name), value), value };
}

const title = h("span.bench-name", {}, "");
const stage = h("span.stage", { role: "status" }, "\u2026");
const stop = h("button", { type: "button", onclick: () => post("/stop") }, "Stop");
const resume = h("button.primary", { type: "button", hidden: true, onclick: () => post("/resume") }, "Resume");
const end = h("button", { type: "button", title: "Write the report and end the command", onclick: () => post("/end") }, "End");
const lost = h("div.banner.lost", { role: "alert", hidden: true }, "The run is not there any more: hil run has ended. Its report is in the report folder.");
const bar = s("svg", { viewBox: "0 0 100 1", preserveAspectRatio: "none", "aria-hidden": "true" });
const parts = new Map(VERDICTS.map((name) => [name, s("rect", { class: `part-${name}`, y: 0, height: 1, width: 0 })]));
bar.append(...parts.values());
const progress = h("div.progress", { role: "progressbar", ariaLabel: "Cases that have ended", ariaValueMin: "0" }, bar);
const readings = { done: reading("Cases"), passed: reading("Passed"), failed: reading("Failed"), error: reading("Errors"), blocked: reading("Blocked"), elapsed: reading("Took"), left: reading("Left, about"), pace: reading("Cases per minute"), workers: reading("Workers") };
const running = h("ul.running", { ariaLabel: "Cases that run now" });
const rows = h("tbody", {});
const none = h("p.note", {}, "No case has ended yet.");
const left = h("p.note", { hidden: true });
const chosen = { only: "bad" };
const filters = h(
  "div.filter-buttons",
  {},
  ...[["bad", "Not passed"], ["all", "All"]].map(([name, label]) => h("button", { type: "button", ariaPressed: String(name === chosen.only), onclick: (event) => choose(name, event.currentTarget) }, label)),
);
const results = h("div.scroll.results", { tabIndex: 0, role: "region", ariaLabel: "Results" }, h("table", {}, h("thead", {}, h("tr", {}, h("th.right", {}, "No."), h("th", {}, "Verdict"), h("th", {}, "Case"), h("th", {}, "What came of it"), h("th.right", {}, "Took"), h("th", {}, "Report"))), rows));
const past = h("tbody", {});
const noPast = h("p.note", {}, "No earlier run is in the history.");
const pastTable = h("div.scroll", { tabIndex: 0, role: "region", ariaLabel: "Earlier runs" }, h("table", {}, h("thead", {}, h("tr", {}, ...["Run", "Started", "Title", "Passed", "Failed", "Errors", "Blocked", "Took", ""].map((one) => h("th", {}, one)))), past));
const change = h("div.change", { role: "status" });

function choose(name, button) {
  chosen.only = name;
  for (const one of filters.children) one.setAttribute("aria-pressed", String(one === button));
  filter();
}

function filter() {
  for (const row of rows.children) show(row, chosen.only === "all" || row.dataset.verdict !== "passed");
  const visible = [...rows.children].some((row) => !row.hidden);
  text(none, rows.children.length ? "Every case has passed so far." : "No case has ended yet.");
  show(none, !visible);
  show(results, visible);
}

document.body.append(
  h("a.skip", { href: "#main" }, "Skip to the results"),
  h("header", {}, h("div.brand", {}, h("img", { src: "/page/icon.svg", alt: "", width: 24, height: 24 }), h("h1", {}, "Campaign"), title), h("div.watch-head", {}, stage, h("span.spacer"), stop, resume, end)),
  lost,
  h(
    "main",
    { id: "main", tabIndex: -1 },
    h("section.card", {}, h("h2", {}, "Progress"), progress, h("div.numbers", {}, ...Object.values(readings).map((one) => one.element)), running),
    h("section.card", {}, h("div.head", {}, h("h2", {}, "Results"), h("span.spacer"), filters), none, left, results),
    h("section.card", {}, h("h2", {}, "Earlier runs"), noPast, pastTable, change),
  ),
);

let since = 0;
let lastStage = "";

function showState(state) {
  text(title, state.title);
  text(stage, STAGES[state.stage]);
  document.title = `${state.done} of ${state.total} \u2013 Campaign`;
  show(stop, state.stage === "running" || state.stage === "stopping");
  stop.disabled = state.stage !== "running";
  show(resume, state.stage === "stopped");
  let from = 0;
  for (const name of VERDICTS) {
    const width = state.total ? (100 * state.counts[name]) / state.total : 0;
    parts.get(name).setAttribute("x", from);
    parts.get(name).setAttribute("width", width);
    from += width;
  }
  progress.ariaValueMax = String(state.total);
  progress.ariaValueNow = String(state.done);
  text(readings.done.value, `${state.done} of ${state.total}`);
  for (const name of VERDICTS) {
    text(readings[name].value, String(state.counts[name]));
    mark(readings[name].value, "bad-text", name !== "passed" && state.counts[name] > 0);
  }
  text(readings.elapsed.value, duration(state.elapsed_s));
  text(readings.left.value, duration(state.left_s));
  text(readings.pace.value, number(state.per_minute, state.per_minute < 10 ? 1 : 0));
  text(readings.workers.value, `${state.running.length} of ${state.workers} busy`);
  running.replaceChildren(...state.running.map((one) => h("li", {}, `${one.case}, ${number(one.for_s, 1)} s`)));
  for (const one of state.results) rows.prepend(row(one));
  while (rows.children.length > MOST_ROWS) rows.lastChild.remove();
  if (state.results.length || !since) filter();
  since = state.done;
  if (state.stage !== lastStage) {
    lastStage = state.stage;
    showPast();
  }
}

function row(one) {
  const badge = h("span.badge", {}, one.verdict);
  mark(badge, "good", one.verdict === "passed");
  mark(badge, "bad", one.verdict === "failed" || one.verdict === "error");
  mark(badge, "warn", one.verdict === "blocked");
  const line = h("tr", {}, h("td.right", {}, String(one.number + 1)), h("td", {}, badge), h("td", {}, one.case, h("div.headline", {}, one.title)), h("td", {}, one.headline), h("td.right", {}, `${number(one.wall_s, 2)} s`), h("td", {}, h("a", { href: `/case/${one.number}#/case/${encodeURIComponent(one.case).replaceAll("%2F", "/")}`, target: "_blank", rel: "noopener", ariaLabel: `Report of ${one.case}` }, "Open")));
  line.dataset.verdict = one.verdict;
  return line;
}

async function showPast() {
  const answer = await fetch("/history");
  if (!answer.ok) return;
  const runs = await answer.json();
  show(noPast, runs.length === 0);
  show(pastTable, runs.length > 0);
  past.replaceChildren(
    ...runs.map((one, place) => {
      const before = runs[place + 1];
      const button = before ? h("button", { type: "button", onclick: () => compare(before.number, one.number) }, `Compare with run ${before.number}`) : "";
      return h("tr", {}, h("td", {}, String(one.number)), h("td", {}, one.started.replace("T", " ")), h("td", {}, one.title), ...[one.passed, one.failed, one.errors, one.blocked].map((value) => h("td", {}, String(value))), h("td", {}, duration(one.wall_s)), h("td", {}, button));
    }),
  );
}

async function compare(base, now) {
  const answer = await fetch(`/compare?base=${base}&now=${now}`);
  if (!answer.ok) {
    toast(await answer.text(), "error");
    return;
  }
  const found = await answer.json();
  const lists = [["New failures", "new_failure"], ["Fixed", "fixed"], ["Edited, and passed now", "edited"], ["Still failing", "still_failing"], ["Newly blocked", "newly_blocked"], ["Flaky", "flaky"], ["Appeared", "appeared"], ["Vanished", "vanished"]];
  const shown = lists.filter(([, name]) => found[name]?.length).map(([label, name]) => h("div", {}, h("strong", {}, `${label}: ${found[name].length}`), h("ul", {}, ...found[name].slice(0, 50).map((one) => h("li", {}, typeof one === "string" ? one : one.identifier)))));
  change.replaceChildren(h("h3", {}, `Run ${now} against run ${base}`), ...(shown.length ? shown : [h("p.note", {}, "No verdict has changed.")]));
}

async function ask() {
  try {
    const answer = await fetch(`/state?since=${since}`);
    if (answer.status === 401) return;
    showState(await answer.json());
    show(lost, false);
  } catch {
    text(stage, "Ended");
    show(lost, true);
    stop.disabled = true;
    end.disabled = true;
    show(resume, false);
  } finally {
    setTimeout(ask, ASK_MS);
  }
}

if (await enter()) ask();
else {
  text(lost, "Open the address with the token that hil run has printed.");
  show(lost, true);
}
