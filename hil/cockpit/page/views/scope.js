// The scope: recorded signals live, with trigger, cursors, math channels, one signal over another, and files.

import { field, h, mark, number, short, show, text, toast, unit } from "../dom.js";
import { Lanes, Xy } from "../lanes.js";
import { OPERATIONS, calculated, derivedUnit } from "../math.js";
import { COLOURS, Panel, colour, dot } from "../plot.js";
import { Trigger } from "../trigger.js";

const WINDOWS = [0.1, 0.5, 1, 2, 5, 10, 30, 60, 300];
const MOST_CHANNELS = 24;
const MOST_ROWS = 400000;
const HEAVY = 60000;

class ScopeView {
  constructor(context) {
    this.context = context;
    this.channels = [];
    this.panels = [];
    this.bands = [];
    this.known = new Map();
    this.mode = "roll";
    this.length = 10;
    this.range = [0, 10];
    this.history = [];
    this.trigger = new Trigger();
    this.cursors = { A: null, B: null };
    this.#parts();
    window.addEventListener("keydown", (event) => this.#key(event));
  }

  // -- elements

  #parts() {
    this.search = h("input", { type: "search", placeholder: "axis1 position, torque \u2026", ariaLabel: "Search signals", oninput: () => this.#list(), onkeydown: (event) => this.#first(event) });
    this.list = h("div.signal-list", { role: "group", ariaLabel: "Signals" });
    this.runButton = h("button.primary", { type: "button", title: "Show what comes; hold what is shown (space bar)", onclick: () => this.#toggle() }, "Hold");
    this.window = h("select", { ariaLabel: "Length of the window", onchange: () => this.#setLength(Number(this.window.value)) }, WINDOWS.map((value) => h("option", { value }, value < 1 ? `${value * 1000} ms` : `${value} s`)));
    this.window.value = "10";
    this.status = h("output.note", { ariaLabel: "State of the scope" }, "");
    this.back = h("button", { type: "button", disabled: true, onclick: () => this.#back() }, "Zoom back");
    this.fit = h("button", { type: "button", onclick: () => this.#all() }, "All");
    this.charts = h("div.scope-charts", { tabIndex: 0, role: "group", ariaLabel: "Curves: arrow keys move cursor A, with Shift cursor B; space holds" });
    this.lanesHost = h("div.chart", {});
    this.lanes = new Lanes(this.lanesHost);
    this.xyHost = h("div.chart", {});
    this.xy = new Xy(this.xyHost);
    this.readings = h("tbody", {});
    this.deltaHead = h("th.right", {}, "B \u2212 A");
    this.table = h("div.scroll", { tabIndex: 0, role: "region", ariaLabel: "Readings of the signals" }, h("table.readings", {}, h("thead", {}, h("tr", {}, h("th", {}, "Signal"), (this.nowHead = h("th.right", {}, "Newest")), (this.aHead = h("th.right", {}, "A")), (this.bHead = h("th.right", {}, "B")), this.deltaHead, h("th.right", {}, "Lowest"), h("th.right", {}, "Highest"), h("th.right", {}, "Mean"), h("th", {}, h("span.hidden-text", {}, "Remove")))), this.readings));
    this.empty = h("p.note", {}, "Choose signals on the left, or click a value of an axis with the right key.");
    this.element = h(
      "div.scope",
      {},
      h(
        "div.column",
        {},
        h("section.card", {}, h("h2", {}, "Signals"), this.search, this.list),
        h("details.card", {}, h("summary", {}, "Trigger"), this.#triggerForm()),
        h("details.card", {}, h("summary", {}, "Calculated channel"), this.#mathForm()),
        h("details.card", {}, h("summary", {}, "One signal over another"), this.#xyForm()),
      ),
      h(
        "div.column",
        {},
        h("section.card", {}, h("div.head", {}, this.runButton, h("label.inline", {}, "Window ", this.window), this.back, this.fit, h("span.spacer"), this.status, h("button", { type: "button", onclick: () => this.#csv() }, "Save CSV"), h("button.operate", { type: "button", title: "Save what is shown as MDF4 into the folder of the cockpit", onclick: () => this.#mdf() }, "Save MDF4"), h("button", { type: "button", onclick: () => this.#picture() }, "Save picture")), this.empty, this.charts, this.lanesHost, this.xyHost),
        h("section.card", {}, h("div.head", {}, h("h2", {}, "Readings"), h("span.spacer"), h("span.note", {}, "Click: cursor A. Shift and click: cursor B."), h("button", { type: "button", onclick: () => this.#noCursors() }, "Clear cursors")), this.table),
      ),
    );
    this.charts.addEventListener("keydown", (event) => this.#move(event));
    this.charts.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    show(this.xyHost, false);
    show(this.lanesHost, false);
  }

  #signalInput(label) {
    const input = h("input", { type: "text", autocomplete: "off", spellcheck: false, required: true, ariaLabel: label });
    input.setAttribute("list", "signals");
    return input;
  }

  #triggerForm() {
    const trigger = this.trigger;
    const kind = h("select", {}, h("option", { value: "level" }, "signal crosses a level"), h("option", { value: "event" }, "event"));
    const signal = this.#signalInput("Signal of the trigger");
    const level = h("input", { type: "number", step: "any", value: 0, required: true });
    const edge = h("select", {}, ...[["rising", "rising"], ["falling", "falling"], ["either", "either way"]].map(([value, words]) => h("option", { value }, words)));
    const event = h("input", { type: "text", value: "alarm.raised", autocomplete: "off", spellcheck: false });
    const before = h("input", { type: "number", min: 0, max: 100, value: 20, required: true });
    const ofLevel = h("div.stack", {}, field("Signal", signal), h("div.row", {}, field("Level", level), field("Edge", edge)));
    const ofEvent = h("div.stack", {}, field("Event", event));
    const turn = () => {
      show(ofLevel, kind.value === "level");
      show(ofEvent, kind.value === "event");
      signal.required = kind.value === "level";
      level.required = kind.value === "level";
    };
    kind.addEventListener("change", turn);
    turn();
    const arm = (mode) => {
      if (!form.reportValidity()) return;
      if (kind.value === "level" && !this.known.has(signal.value)) {
        toast(`${signal.value} is not recorded.`, "error");
        return;
      }
      Object.assign(trigger, { kind: kind.value, signal: signal.value, level: Number(level.value), edge: edge.value, event: event.value.trim(), before: Number(before.value) / 100 });
      if (kind.value === "level") this.add(signal.value);
      this.#setMode(mode);
      trigger.arm(this.#end() ?? 0);
    };
    const form = h(
      "form.stack",
      { onsubmit: (submitted) => (submitted.preventDefault(), arm("single")) },
      field("Trigger when", kind),
      ofLevel,
      ofEvent,
      field("Shown before it", before, "% of the window"),
      h("div.row", {}, h("button", { type: "submit", title: "Keep the next one" }, "Single"), h("button", { type: "button", title: "Keep each until the next", onclick: () => arm("normal") }, "Normal"), h("button", { type: "button", onclick: () => this.#setMode("roll") }, "Roll")),
    );
    return form;
  }

  #mathForm() {
    const operation = h("select", {}, ...Object.entries(OPERATIONS).map(([value, one]) => h("option", { value }, one.words)));
    const a = this.#signalInput("Signal a");
    const b = this.#signalInput("Signal b");
    const window = h("input", { type: "number", step: "any", min: 0.001, value: 0.1, required: true });
    const second = field("b", b);
    const long = field("Window", window, "s");
    const turn = () => {
      const { inputs, window: has } = OPERATIONS[operation.value];
      show(second, inputs === 2);
      b.required = inputs === 2;
      show(long, has);
      window.required = has;
    };
    operation.addEventListener("change", turn);
    turn();
    const add = (event) => {
      event.preventDefault();
      for (const one of [a, ...(OPERATIONS[operation.value].inputs === 2 ? [b] : [])]) {
        if (!this.known.has(one.value)) {
          toast(`${one.value} is not recorded.`, "error");
          return;
        }
      }
      this.#addMath({ operation: operation.value, a: a.value, b: b.value, window: Number(window.value) });
    };
    return h("form.stack", { onsubmit: add }, field("Channel", operation), field("a", a), second, long, h("button", { type: "submit" }, "Add"));
  }

  #xyForm() {
    const across = this.#signalInput("Signal across");
    const up = this.#signalInput("Signal up");
    const draw = (event) => {
      event.preventDefault();
      for (const one of [across, up]) {
        if (!this.known.has(one.value)) {
          toast(`${one.value} is not recorded.`, "error");
          return;
        }
      }
      this.over = [across.value, up.value];
      show(this.xyHost, true);
      this.#want();
    };
    const off = () => {
      this.over = null;
      show(this.xyHost, false);
      this.#want();
    };
    return h("form.stack", { onsubmit: draw }, field("Across, such as a leading position", across), field("Up, such as a following position", up), h("div.row", {}, h("button", { type: "submit" }, "Show"), h("button", { type: "button", onclick: off }, "Hide")));
  }

  // -- signals

  bench(bench) {
    this.source = bench.source;
    // The axes come first: they are what is looked at most.
    const axes = Object.keys(bench.panes.axis?.axes || {});
    const rank = (one) => (axes.includes(one.name.slice(0, one.name.indexOf("."))) ? 0 : 1);
    this.known = new Map([...(bench.panes.scope || [])].sort((a, b) => rank(a) - rank(b)).map((one) => [one.name, one]));
    this.bands = [];
    this.history = [];
    this.cursors = { A: null, B: null };
    this.mode = "roll";
    const kept = JSON.parse(localStorage.getItem(`scope ${this.source}`) || "null");
    const first = Object.keys(bench.panes.axis?.axes || {})[0];
    const usual = ["position_setpoint", "set_position", "actual_position", "actual_velocity", "state"].map((one) => `${first}.${one}`);
    const wanted = (kept || usual.map((name) => ({ name }))).filter((one) => this.#possible(one));
    this.channels = [];
    for (const one of wanted) {
      if (one.operation) this.#addMath(one, false);
      else this.add(one.name, false);
    }
    if (this.over && !this.over.every((one) => this.known.has(one))) {
      this.over = null;
      show(this.xyHost, false);
    }
    this.#list();
    this.#build();
  }

  #possible(one) {
    if (!one.operation) return this.known.has(one.name);
    return this.known.has(one.a) && (OPERATIONS[one.operation]?.inputs !== 2 || this.known.has(one.b));
  }

  /** Show a signal, if it is not shown already. */
  add(name, build = true) {
    if (!this.known.has(name) || this.channels.some((one) => one.name === name)) return;
    if (this.channels.length >= MOST_CHANNELS) {
      toast(`${MOST_CHANNELS} channels are shown already.`, "error");
      return;
    }
    const found = this.known.get(name);
    this.channels.push({ name, unit: found.unit, texts: found.texts, colour: this.#freeColour() });
    if (build) this.#changed();
  }

  #addMath({ operation, a, b, window }, build = true) {
    const short = (name) => name.replaceAll("_", " ");
    const names = { difference: `${short(a)} \u2212 ${short(b)}`, derivative: `d/dt ${short(a)}`, mean: `mean of ${short(a)}, ${window} s` };
    const name = names[operation];
    if (this.channels.some((one) => one.name === name)) return;
    this.channels.push({ name, operation, a, b, window, unit: derivedUnit(operation, this.known.get(a).unit), colour: this.#freeColour() });
    if (build) this.#changed();
  }

  #freeColour() {
    const used = this.channels.map((one) => one.colour);
    for (let place = 0; ; place++) if (used.filter((one) => one === place % COLOURS.length).length <= Math.floor(place / COLOURS.length)) return place % COLOURS.length;
  }

  #remove(name) {
    this.channels = this.channels.filter((one) => one.name !== name);
    this.#changed();
  }

  #changed() {
    localStorage.setItem(`scope ${this.source}`, JSON.stringify(this.channels.map(({ name, operation, a, b, window }) => ({ name, operation, a, b, window }))));
    this.#list();
    this.#build();
  }

  #matches() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    return [...this.known.values()].filter((one) => words.every((word) => one.name.toLowerCase().replaceAll("_", " ").includes(word) || one.name.toLowerCase().includes(word)));
  }

  #list() {
    const shown = new Set(this.channels.map((one) => one.name));
    let group = "";
    const lines = [];
    for (const signal of this.#matches().slice(0, 400)) {
      const [component, column] = [signal.name.slice(0, signal.name.indexOf(".")), signal.name.slice(signal.name.indexOf(".") + 1)];
      if (component !== group) {
        group = component;
        lines.push(h("h3", {}, component));
      }
      const box = h("input", { type: "checkbox", checked: shown.has(signal.name), onchange: () => (box.checked ? this.add(signal.name) : this.#remove(signal.name)) });
      lines.push(h("label.signal", {}, box, h("span", {}, column.replaceAll("_", " ")), h("span.unit", {}, unit(signal.unit))));
    }
    this.list.replaceChildren(...lines);
  }

  #first(event) {
    if (event.key !== "Enter") return;
    event.preventDefault();
    const found = this.#matches()[0];
    if (found) this.add(found.name);
  }

  // -- panels

  #build() {
    for (const panel of this.panels) panel.destroy();
    this.panels = [];
    this.charts.replaceChildren();
    const units = [...new Set(this.channels.filter((one) => !one.texts).map((one) => one.unit))];
    units.forEach((name, place) => {
      const channels = this.channels.filter((one) => !one.texts && one.unit === name);
      const host = h("div.chart", {});
      this.charts.append(h("div.legend", {}, ...channels.map((one) => h("span.key", {}, dot(one.colour), one.name.replaceAll("_", " ")))), host);
      const panel = new Panel(host, {
        names: channels.map((one) => one.name),
        labels: channels.map((one) => one.name),
        unit: name,
        colours: channels.map((one) => one.colour),
        height: units.length > 3 ? 130 : 180,
        axis: place === units.length - 1,
        key: "scope",
        select: (from, to) => this.#zoom(from, to),
        behind: (plot) => this.#behind(plot),
        draw: (plot) => this.#front(plot),
      });
      panel.channels = channels;
      panel.plot.over.addEventListener("click", (event) => this.#click(panel, event));
      panel.plot.over.addEventListener("dblclick", () => this.#back());
      panel.plot.over.addEventListener("mousemove", () => this.#hover(panel));
      panel.plot.over.addEventListener("mouseleave", () => {
        this.pointed = null;
        this.dirty = true;
      });
      this.panels.push(panel);
    });
    const states = this.channels.filter((one) => one.texts);
    show(this.lanesHost, states.length > 0);
    show(this.empty, this.channels.length === 0);
    this.readings.replaceChildren(...this.channels.map((one) => this.#row(one)));
    this.dirty = true;
    this.#want();
  }

  #row(channel) {
    const cells = Array.from({ length: 7 }, () => h("td.right", {}, ""));
    channel.cells = cells;
    return h("tr", {}, h("td", {}, h("span.key", {}, dot(channel.colour), `${channel.name.replaceAll("_", " ")}${channel.unit ? `, ${unit(channel.unit)}` : ""}`)), ...cells, h("td", {}, h("button.plain", { type: "button", ariaLabel: `Remove ${channel.name}`, onclick: () => this.#remove(channel.name) }, "\u00d7")));
  }

  #want() {
    const names = this.channels.flatMap((one) => (one.operation ? [one.a, ...(OPERATIONS[one.operation].inputs === 2 ? [one.b] : [])] : [one.name]));
    if (this.over) names.push(...this.over);
    this.context.samples.want("scope", this.visible || this.mode !== "roll" ? [...new Set(names)] : []);
  }

  /** Time of the newest sample of what is shown; null: nothing has come. */
  #end() {
    let end = null;
    for (const one of this.channels) {
      const last = this.context.samples.of(one.operation ? one.a : one.name).last;
      if (last !== null) end = Math.max(end ?? last, last);
    }
    return end;
  }

  #series(channel) {
    const samples = this.context.samples;
    if (!channel.operation) return samples.of(channel.name);
    return calculated(channel.operation, samples.of(channel.a), samples.of(channel.b), channel.window, ...this.range);
  }

  // -- what is shown of it

  #setMode(mode) {
    this.mode = mode;
    text(this.runButton, mode === "hold" ? "Run" : "Hold");
    mark(this.runButton, "primary", mode === "hold");
    this.dirty = true;
    this.#want();
  }

  #toggle() {
    if (this.mode === "hold") {
      this.history = [];
      this.back.disabled = true;
      this.#setMode("roll");
    } else this.#setMode("hold");
  }

  #setLength(seconds) {
    this.length = seconds;
    if (this.mode === "hold") this.#zoom(this.range[1] - seconds, this.range[1]);
    this.dirty = true;
  }

  #zoom(from, to) {
    if (!(to - from > 1e-6)) return;
    this.history.push([this.mode, ...this.range]);
    if (this.history.length > 50) this.history.shift();
    this.back.disabled = false;
    this.range = [from, to];
    this.#setMode("hold");
  }

  #back() {
    const before = this.history.pop();
    this.back.disabled = this.history.length === 0;
    if (!before) return;
    this.range = before.slice(1);
    this.#setMode(before[0]);
  }

  #all() {
    let from = Infinity;
    let to = -Infinity;
    for (const one of this.channels) {
      const series = this.context.samples.of(one.operation ? one.a : one.name);
      if (!series.length) continue;
      from = Math.min(from, series.times[0]);
      to = Math.max(to, series.last);
    }
    if (to > from) this.#zoom(from, to);
  }

  #wheel(event) {
    const panel = this.panels.find((one) => one.host.contains(event.target));
    if (!panel || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    const at = panel.plot.posToVal(event.clientX - panel.plot.over.getBoundingClientRect().left, "x");
    const factor = event.deltaY > 0 ? 1.25 : 0.8;
    this.#zoom(at - (at - this.range[0]) * factor, at + (this.range[1] - at) * factor);
  }

  // -- cursors

  #click(panel, event) {
    if (panel.plot.select.width > 4) return;
    const time = panel.plot.posToVal(event.clientX - panel.plot.over.getBoundingClientRect().left, "x");
    this.cursors[event.shiftKey ? "B" : "A"] = time;
    this.dirty = true;
  }

  #hover(panel) {
    const left = panel.plot.cursor.left;
    this.pointed = left >= 0 ? panel.plot.posToVal(left, "x") : null;
    this.dirty = true;
  }

  #noCursors() {
    this.cursors = { A: null, B: null };
    this.dirty = true;
  }

  #move(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step || event.target !== this.charts) return;
    event.preventDefault();
    const name = event.shiftKey ? "B" : "A";
    const [from, to] = this.range;
    this.cursors[name] = Math.min(to, Math.max(from, (this.cursors[name] ?? (from + to) / 2) + (step * (to - from)) / 100));
    this.dirty = true;
  }

  #key(event) {
    if (!this.visible || event.key !== " " || !(event.target === document.body || event.target === this.charts)) return;
    event.preventDefault();
    this.#toggle();
  }

  // -- drawing

  shown(visible) {
    this.visible = visible;
    this.#want();
    if (visible) requestAnimationFrame((now) => this.#draw(now));
  }

  restyle() {
    this.#build();
  }

  #draw(now) {
    if (!this.visible) return;
    requestAnimationFrame((next) => this.#draw(next));
    const end = this.#end();
    if (this.trigger.kind === "level" && (this.mode === "single" || this.mode === "normal")) this.trigger.look(this.context.samples.of(this.trigger.signal));
    const heavy = this.points > HEAVY;
    if (!this.dirty && (end === this.drawn || this.mode === "hold")) return;
    if (!this.dirty && now - (this.drawnAt || 0) < (heavy ? 200 : 30)) return;
    const begun = performance.now();
    this.dirty = false;
    this.drawn = end;
    this.drawnAt = now;
    this.#place(end);
    const [from, to] = this.range;
    this.points = 0;
    for (const panel of this.panels) {
      const series = panel.channels.map((one) => this.#series(one));
      for (const one of series) this.points += one.index(to) - one.index(from);
      panel.channels.forEach((one, place) => (one.drawn = series[place]));
      panel.show(series, from, to);
    }
    const states = this.channels.filter((one) => one.texts);
    if (states.length) {
      for (const one of states) one.drawn = this.#series(one);
      const box = this.panels[0]?.plot.bbox;
      const ratio = window.devicePixelRatio || 1;
      const left = box ? box.left / ratio : 90;
      const right = box ? this.panels[0].plot.width - (box.left + box.width) / ratio : 16;
      this.lanes.show(states.map((one) => ({ series: one.drawn, label: one.name.replaceAll("_", " "), texts: one.texts })), from, to, left, right);
    }
    if (this.over) {
      const [across, up] = this.over.map((name) => this.context.samples.of(name));
      this.xy.show(across, up, this.over.map((name) => this.known.get(name)), from, to);
    }
    this.#read(from, to);
    window.dispatchEvent(new CustomEvent("drawn", { detail: { end, begun } })); // for measurements
  }

  /** Decide which time is shown. */
  #place(end) {
    if (this.mode === "hold" || end === null) {
      text(this.status, this.mode === "hold" ? `held, ${short(this.range[1] - this.range[0])} s` : "no samples yet");
      return;
    }
    if (this.mode === "roll") {
      this.range = [end - this.length, end];
      text(this.status, this.gaps(...this.range) ? "rolls; samples are missing where it is hatched" : "rolls");
      return;
    }
    const trigger = this.trigger;
    if (trigger.at === null) {
      if (this.mode === "single" || !this.kept) this.range = [end - this.length, end];
      text(this.status, "waits for the trigger");
      return;
    }
    this.range = trigger.window(this.length);
    this.cursors.A = trigger.at;
    text(this.status, `triggered at ${number(trigger.at, 3)} s`);
    if (end < this.range[1]) return;
    this.kept = true;
    if (this.mode === "single") {
      this.#setMode("hold");
      this.dirty = false;
      text(this.status, `triggered at ${number(trigger.at, 3)} s, held`);
    } else trigger.arm(this.range[1]);
  }

  /** Whether samples are missing between two times. */
  gaps(from, to) {
    return this.panels.some((panel) => panel.channels.some((one) => (one.drawn?.gaps || []).some((gap) => gap[1] > from && gap[0] < to)));
  }

  #behind(plot) {
    const pen = plot.ctx;
    const { left, top, width, height } = plot.bbox;
    const x = (time) => Math.min(left + width, Math.max(left, plot.valToPos(time, "x", true)));
    const [from, to] = this.range;
    pen.save();
    for (const band of this.bands) {
      const until = band.to ?? to;
      if (until < from || band.from > to) continue;
      pen.fillStyle = colour(band.kind === "alarm" ? "--bad" : "--warn");
      pen.globalAlpha = 0.12;
      pen.fillRect(x(band.from), top, Math.max(2, x(until) - x(band.from)), height);
      pen.globalAlpha = 1;
      if (band.from >= from && plot === this.panels[0]?.plot) {
        pen.font = `${11 * (window.devicePixelRatio || 1)}px system-ui, sans-serif`;
        pen.textAlign = "left";
        pen.fillText(band.label, x(band.from) + 4, top + 12 * (window.devicePixelRatio || 1));
      }
    }
    const panel = this.panels.find((one) => one.plot === plot);
    for (const gap of (panel?.channels || []).flatMap((one) => one.drawn?.gaps || [])) {
      if (gap[1] < from || gap[0] > to) continue;
      pen.strokeStyle = colour("--warn");
      pen.lineWidth = 1;
      const begin = x(gap[0]);
      const end = Math.max(begin + 3, x(gap[1]));
      pen.save();
      pen.beginPath();
      pen.rect(begin, top, end - begin, height);
      pen.clip();
      for (let place = begin - height; place < end; place += 8) {
        pen.beginPath();
        pen.moveTo(place, top + height);
        pen.lineTo(place + height, top);
        pen.stroke();
      }
      pen.restore();
    }
    pen.restore();
  }

  #front(plot) {
    const pen = plot.ctx;
    const { left, top, width, height } = plot.bbox;
    const ratio = window.devicePixelRatio || 1;
    pen.save();
    for (const [name, time] of Object.entries(this.cursors)) {
      if (time === null || time < this.range[0] || time > this.range[1]) continue;
      const at = Math.min(left + width, plot.valToPos(time, "x", true));
      pen.strokeStyle = pen.fillStyle = colour("--ink");
      pen.lineWidth = ratio;
      pen.setLineDash(name === "B" ? [6 * ratio, 4 * ratio] : []);
      pen.beginPath();
      pen.moveTo(at, top);
      pen.lineTo(at, top + height);
      pen.stroke();
      pen.font = `600 ${12 * ratio}px system-ui, sans-serif`;
      pen.textAlign = at > left + width - 20 * ratio ? "right" : "left";
      pen.fillText(name, at + (pen.textAlign === "left" ? 4 : -4) * ratio, top + height - 6 * ratio);
    }
    if (this.trigger.kind === "level" && ["single", "normal"].includes(this.mode)) {
      const panel = this.panels.find((one) => one.plot === plot);
      if (panel?.channels.some((one) => one.name === this.trigger.signal)) {
        const at = plot.valToPos(this.trigger.level, "y", true);
        if (at >= top && at <= top + height) {
          pen.strokeStyle = colour("--warn");
          pen.setLineDash([4 * ratio, 4 * ratio]);
          pen.beginPath();
          pen.moveTo(left, at);
          pen.lineTo(left + width, at);
          pen.stroke();
        }
      }
    }
    pen.restore();
  }

  // -- readings

  #read(from, to) {
    const { A, B } = this.cursors;
    const at = this.pointed ?? null;
    text(this.nowHead, at === null ? "Newest" : `at ${number(at, 4)} s`);
    text(this.aHead, A === null ? "A" : `A ${number(A, 4)} s`);
    text(this.bHead, B === null ? "B" : `B ${number(B, 4)} s`);
    text(this.deltaHead, A !== null && B !== null ? `B \u2212 A ${number(B - A, 4)} s` : "B \u2212 A");
    const begin = A !== null && B !== null ? Math.min(A, B) : from;
    const end = A !== null && B !== null ? Math.max(A, B) : to;
    for (const channel of this.channels) {
      const series = channel.drawn;
      if (!series || !channel.cells) continue;
      const value = (time) => (time === null ? null : series.at(time));
      const worded = (one) => (one === null ? "" : channel.texts ? (channel.texts[String(Math.round(one))] ?? short(one)).toLowerCase().replaceAll("_", " ") : short(one));
      const [a, b] = [value(A), value(B)];
      const cells = [worded(at === null ? (series.length ? series.values[series.length - 1] : null) : value(at)), worded(a), worded(b), channel.texts || a === null || b === null ? "" : short(b - a)];
      if (channel.texts) cells.push("", "", "");
      else {
        const first = series.index(begin);
        const stop = Math.max(first, series.index(end));
        let low = Infinity;
        let high = -Infinity;
        let sum = 0;
        for (let place = first; place < stop; place++) {
          const one = series.values[place];
          if (one < low) low = one;
          if (one > high) high = one;
          sum += one;
        }
        cells.push(...(stop > first ? [low, high, sum / (stop - first)] : [null, null, null]).map((one) => (one === null ? "" : short(one))));
      }
      cells.forEach((said, place) => text(channel.cells[place], said));
    }
  }

  state() {
    for (const button of this.element.querySelectorAll("button.operate")) button.disabled = !this.context.operates();
  }

  // -- events as bands

  events(events) {
    for (const [time, source, kind, data] of events) {
      this.trigger.hear(time, kind);
      if (kind === "alarm.raised") this.bands.push({ kind: "alarm", key: `${source} ${data.number}`, from: time, label: `${source} alarm ${data.number}` });
      else if (kind === "fault.applied") this.bands.push({ kind: "fault", key: `${data.fault ?? data.id ?? source}`, from: time, label: `${data.kind ?? data.fault ?? "fault"}` });
      else if (kind === "alarm.cleared" || kind === "alarm.acknowledged") this.#endBands((band) => band.kind === "alarm" && band.key === `${source} ${data.number}`, time);
      else if (kind === "fault.removed") this.#endBands((band) => band.kind === "fault" && band.key === `${data.fault ?? data.id ?? source}`, time);
    }
    if (this.bands.length > 500) this.bands.splice(0, this.bands.length - 500);
  }

  #endBands(which, time) {
    for (const band of this.bands) if (band.to === undefined && which(band)) band.to = time;
  }

  // -- files

  #csv() {
    const channels = this.channels.map((one) => [one, this.#series(one)]);
    const [from, to] = this.range;
    const curves = channels.map(([, series]) => {
      const first = series.index(from);
      const end = series.index(to + 1e-9);
      return [series.times.slice(first, end), series.values.slice(first, end)];
    });
    const filled = curves.filter((one) => one[0].length);
    if (!filled.length) {
      toast("There are no samples in the window.", "error");
      return;
    }
    const table = uPlot.join(curves);
    if (table[0].length > MOST_ROWS) {
      toast(`The window has ${table[0].length} samples; zoom in to ${MOST_ROWS} or fewer.`, "error");
      return;
    }
    const heads = ["time [s]", ...channels.map(([one]) => `${one.name}${one.unit ? ` [${one.unit}]` : ""}`)];
    const lines = [heads.map((one) => (/[",]/.test(one) ? `"${one.replaceAll('"', '""')}"` : one)).join(",")];
    for (let row = 0; row < table[0].length; row++) lines.push(table.map((column) => (column[row] === null || column[row] === undefined ? "" : Number(column[row].toPrecision(12)))).join(","));
    save(new Blob([`${lines.join("\r\n")}\r\n`], { type: "text/csv" }), "scope.csv");
  }

  async #mdf() {
    const signals = this.channels.filter((one) => !one.operation).map((one) => one.name);
    const [from, to] = this.range;
    const rows = await this.context.act("scope.hold", { signals, from_s: Math.max(0, from), to_s: Math.max(0, to) });
    if (rows === undefined) return;
    const written = await this.context.act("scope.save", { name: `scope_${Math.round(to * 1000)}.mf4` });
    if (written) toast(`${written}: ${rows} samples of each signal`);
  }

  #picture() {
    const parts = [...this.charts.querySelectorAll("canvas"), ...(this.lanesHost.hidden ? [] : [this.lanes.canvas]), ...(this.xyHost.hidden ? [] : [this.xy.canvas])];
    if (!parts.length) return;
    const canvas = document.createElement("canvas");
    canvas.width = Math.max(...parts.map((one) => one.width));
    const head = 28 * (window.devicePixelRatio || 1);
    canvas.height = parts.reduce((sum, one) => sum + one.height + head, 0);
    const pen = canvas.getContext("2d");
    pen.fillStyle = colour("--card");
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.font = `${13 * (window.devicePixelRatio || 1)}px system-ui, sans-serif`;
    let top = 0;
    parts.forEach((part, place) => {
      let left = 12;
      for (const one of this.panels[place]?.channels || []) {
        pen.fillStyle = colour(COLOURS[one.colour]);
        const label = `\u25a0 ${one.name}   `;
        pen.fillText(label, left, top + head * 0.7);
        left += pen.measureText(label).width;
      }
      top += head;
      pen.drawImage(part, 0, top);
      top += part.height;
    });
    canvas.toBlob((blob) => save(blob, "scope.png"));
  }
}

function save(blob, name) {
  const address = URL.createObjectURL(blob);
  const link = h("a", { href: address, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

export const view = { name: "scope", title: "Scope", create: (context) => new ScopeView(context) };
