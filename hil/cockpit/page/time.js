// Time control in the header: run, pause, step, speed, run until a condition.

import { field, h, mark, number, show, text } from "./dom.js";

const SPEEDS = [["0.01", "1/100"], ["0.1", "1/10"], ["0.5", "1/2"], ["1", "real time"], ["2", "2 \u00d7"], ["10", "10 \u00d7"], ["max", "fastest"]];
const COMPARED = [">", ">=", "<", "<=", "==", "!="];

export class TimeControl {
  constructor(context) {
    this.context = context;
    this.clock = h("output.clock", { ariaLabel: "Bench time" }, "\u2013");
    this.rate = h("span.rate", {}, "");
    this.run = h("button", { type: "button", onclick: () => context.act(this.running ? "time.pause" : "time.run") }, "Pause");
    this.step = h("button", { type: "button", title: "Let one bus cycle pass", onclick: () => context.act("time.step", { cycles: 1 }) }, "Step");
    this.speed = h("select", { ariaLabel: "Speed of bench time", onchange: () => this.#speed() }, SPEEDS.map(([value, label]) => h("option", { value }, label)));
    this.speed.value = "1";
    this.until = h("details.until", {}, h("summary", {}, "Run until\u2009\u2026"), this.#form());
    this.live = h("span.badge", { hidden: true, title: "A live bench takes its time from the clock" }, "live");
    this.element = h("div.time", {}, this.clock, this.rate, this.live, h("div.buttons", {}, this.run, this.step), this.speed, this.until);
    document.addEventListener("pointerdown", (event) => {
      if (!this.until.contains(event.target)) this.until.open = false;
    });
  }

  #form() {
    const time = h("input", { type: "number", step: "any", min: 0, required: true });
    const signal = h("input", { type: "text", required: true, list: "signals", autocomplete: "off", spellcheck: false });
    signal.setAttribute("list", "signals");
    this.signals = h("datalist", { id: "signals" });
    const compare = h("select", { ariaLabel: "Comparison" }, COMPARED.map((one) => h("option", { value: one }, one)));
    const value = h("input", { type: "number", step: "any", required: true, ariaLabel: "Value" });
    const event = h("input", { type: "text", required: true, autocomplete: "off", spellcheck: false, placeholder: "alarm.raised" });
    const go = (kind, fields) => async (submitted) => {
      submitted.preventDefault();
      if ((await this.context.act(kind, fields())) !== undefined) this.until.open = false;
    };
    const button = () => h("button", { type: "submit" }, "Run");
    return h(
      "div.pop",
      {},
      h("form.row", { onsubmit: go("time.until_time", () => ({ time_s: Number(time.value) })) }, field("Bench time", time, "s"), button()),
      h("form.row", { onsubmit: go("time.until_signal", () => ({ signal: signal.value, compare: compare.value, value: Number(value.value) })) }, field("Signal", signal), compare, value, button()),
      h("form.row", { onsubmit: go("time.until_event", () => ({ event: event.value })) }, field("Event", event), button()),
      this.signals,
    );
  }

  #speed() {
    this.context.act("time.run", { speed: this.speed.value === "max" ? "max" : Number(this.speed.value) });
  }

  bench(bench) {
    show(this.live, bench.live);
    this.isLive = bench.live;
    this.cycle = bench.cycle_ms;
    this.signals.replaceChildren(...(bench.panes.scope || []).map((one) => h("option", { value: one.name })));
  }

  state(state) {
    text(this.clock, state.time_s === null ? "\u2013" : `${number(state.time_s, 3)} s`);
    const time = state.time;
    const may = this.context.operates() && Boolean(time) && !this.isLive;
    this.running = Boolean(time?.running);
    text(this.run, this.running ? "Pause" : "Run");
    for (const one of [this.run, this.step, this.speed]) one.disabled = !may;
    mark(this.until, "disabled", !may);
    if (!may) this.until.open = false;
    this.until.firstChild.tabIndex = may ? 0 : -1;
    this.until.firstChild.ariaDisabled = String(!may);
    if (!time) return;
    const set = String(time.factor);
    if (document.activeElement !== this.speed && this.speed.value !== set) this.speed.value = set;
    let said = this.running ? `${number(time.speed, time.speed < 10 ? 2 : 0)} \u00d7` : "paused";
    if (time.until) said = `until ${time.until}`;
    else if (time.met) said = `met: ${time.met}`;
    text(this.rate, said);
  }
}
