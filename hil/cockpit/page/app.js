// The page as a whole: header with time and control, tabs with views, and stopping from anywhere.

import { Connection, enter } from "./connection.js";
import { field, h, mark, show, text, toast } from "./dom.js";
import { Samples } from "./samples.js";
import { TimeControl } from "./time.js";
import { views } from "./views/index.js";

const connection = new Connection();
const samples = new Samples(connection);
const local = { you: "", bench: null, operator: null };

/** Send a message; what is refused is shown. Returns the value, or undefined. */
async function act(kind, fields = {}) {
  try {
    const value = await connection.request(kind, fields);
    if (typeof value === "string" && value && kind.startsWith("axis.")) toast(value);
    return value;
  } catch (error) {
    toast(error.message, "error");
    return undefined;
  }
}

const context = {
  connection,
  samples,
  act,
  request: (kind, fields) => connection.request(kind, fields),
  operates: () => local.operator !== null && local.operator === local.you,
  open: (name) => select(name, true),
  scope: (signal) => {
    select("scope", true);
    made.get("scope").add?.(signal);
  },
};

function stop() {
  for (const view of made.values()) view.stopped?.();
  act("axis.stop_all");
}

// -- header

const benchName = h("span.bench-name", {}, "\u2026");
const time = new TimeControl(context);
const controlState = h("span.control-state", {}, "");
const controlButton = h("button", { type: "button", onclick: toggleControl }, "Take control");
const stopButton = h("button.stop", { type: "button", onclick: stop, title: "Stop every axis of the panel (Esc)", "aria-keyshortcuts": "Escape" }, "STOP", h("kbd", {}, "Esc"));
const banner = h("div.banner", { role: "alert", hidden: true });
const heldBanner = h("div.banner", { role: "alert", hidden: true });
const connectionBanner = h("div.banner.lost", { role: "alert", hidden: true });

function toggleControl() {
  act(context.operates() ? "control.release" : "control.take");
}

const header = h(
  "header",
  {},
  h("div.brand", {}, h("img", { src: "/page/icon.svg", alt: "", width: 24, height: 24 }), h("h1", {}, "Cockpit"), benchName),
  time.element,
  h("div.control", {}, controlState, controlButton),
  stopButton,
);

// -- tabs

const made = new Map();
const tabs = new Map();
const panels = new Map();
const tabList = h("div.tabs", { role: "tablist", "aria-label": "Views", onkeydown: turn });
let selected = "";

for (const view of views) {
  const created = view.create(context);
  made.set(view.name, created);
  const tab = h("button.tab", { type: "button", role: "tab", id: `tab-${view.name}`, tabIndex: -1, "aria-controls": `view-${view.name}`, onclick: () => select(view.name) }, view.title);
  const panel = h("section.view", { role: "tabpanel", id: `view-${view.name}`, "aria-labelledby": `tab-${view.name}`, hidden: true, tabIndex: -1 }, created.element);
  tabs.set(view.name, tab);
  panels.set(view.name, panel);
  tabList.append(tab);
}

function select(name, focus = false) {
  if (!tabs.has(name)) return;
  for (const [one, tab] of tabs) {
    const chosen = one === name;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    show(panels.get(one), chosen);
    if (chosen !== (one === selected)) made.get(one).shown?.(chosen);
  }
  selected = name;
  if (focus) tabs.get(name).focus();
  sessionStorage.setItem("view", name);
}

function turn(event) {
  const names = [...tabs.keys()];
  const place = names.indexOf(selected);
  const to = { ArrowRight: place + 1, ArrowLeft: place - 1 + names.length, Home: 0, End: names.length - 1 }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  select(names[to % names.length], true);
}

document.body.append(
  h("a.skip", { href: "#main" }, "Skip to the view"),
  h("div.top", {}, header, banner, heldBanner, connectionBanner, h("nav", { "aria-label": "Views" }, tabList)),
  h("main", { id: "main", tabIndex: -1 }, ...panels.values()),
);

// -- Esc stops, wherever the focus is; a hidden page stops what it operates

window.addEventListener(
  "keydown",
  (event) => {
    if (event.key === "Escape") stop();
  },
  true,
);

document.addEventListener("visibilitychange", () => {
  if (document.hidden && context.operates()) connection.request("axis.away").catch(() => {});
});

// -- the right key on a value shows it in the scope

document.addEventListener("contextmenu", (event) => {
  const signal = event.target.closest?.("[data-signal]")?.dataset.signal;
  if (!signal) return;
  event.preventDefault();
  context.scope(signal);
});

// -- what the server tells

connection.on("open", () => {
  show(connectionBanner, false);
  document.documentElement.dataset.connected = "true";
});

connection.on("closed", (event) => {
  document.documentElement.dataset.connected = "false";
  local.operator = null;
  mark(document.body, "operates", false);
  text(connectionBanner, event.code === 4401 ? "Open the address with the token that `hil cockpit` has printed." : `The connection to the cockpit is lost${event.reason ? `: ${event.reason}` : ""}. What this page operated is stopped. Trying again \u2026`);
  show(connectionBanner, true);
});

connection.on("bench", (bench) => {
  local.you = bench.you;
  local.bench = bench;
  text(benchName, bench.name);
  document.title = `${bench.name} \u2013 Cockpit`;
  samples.begin((bench.panes.scope || []).map((one) => one.name));
  time.bench(bench);
  for (const view of made.values()) view.bench?.(bench);
  const physical = bench.panes.axis?.physical || [];
  const parts = [];
  if (!bench.up) parts.push(bench.failure || "The bench is coming up \u2026");
  if (physical.length) {
    parts.push(
      bench.panes.axis.allow_motion
        ? `Physical drive: ${physical.join(", ")} may move a real machine. Keep its emergency stop within reach.`
        : `Physical drive: ${physical.join(", ")} is not moved, because the cockpit was started without --allow-motion.`,
    );
  }
  text(banner, parts.join(" "));
  show(banner, parts.length > 0);
  mark(banner, "danger", physical.length > 0 && bench.panes.axis?.allow_motion);
  document.documentElement.dataset.bench = bench.up ? "up" : "down";
});

connection.on("state", (state) => {
  local.operator = state.operator;
  const operates = context.operates();
  connection.operating = operates;
  mark(document.body, "operates", operates);
  const others = state.pages - 1;
  const who = operates ? "You have control" : state.operator ? `${state.operator} has control` : "Nobody has control";
  text(controlState, others > 0 && operates ? `${who}, ${others} watching` : who);
  text(controlButton, operates ? "Release control" : "Take control");
  controlButton.disabled = !operates && state.operator !== null;
  time.state(state);
  const late = operates && state.away ? "The connection is slow: signs of life of this page come late, or what it shows is older than 2 s. Every axis is stopped." : "";
  const held = late || state.time?.held || "";
  text(heldBanner, held);
  show(heldBanner, Boolean(held));
  for (const view of made.values()) view.state?.(state);
});

connection.on("events", (document) => {
  for (const view of made.values()) view.events?.(document.events, document.left_out);
});

window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const view of made.values()) view.restyle?.();
});

select(sessionStorage.getItem("view") || views[0].name);
if (!tabs.has(selected)) select(views[0].name);

/** Ask for the token where the address had none. */
function askToken() {
  const input = h("input", { type: "password", autocomplete: "off", required: true });
  const form = h("form.enter", { onsubmit: begin }, h("h2", {}, "Token"), h("p", {}, "Open the address that hil cockpit has printed, or enter its token."), field("Token", input), h("button.primary", { type: "submit" }, "Enter"));
  async function begin(event) {
    event.preventDefault();
    const answer = await fetch("/enter", { method: "POST", body: input.value });
    if (!answer.ok) return toast("The token is wrong.", "error");
    form.remove();
    mark(document.body, "locked", false);
    return connection.open();
  }
  document.getElementById("main").prepend(form);
  mark(document.body, "locked", true);
  input.focus();
}

if (await enter()) connection.open();
else askToken();

