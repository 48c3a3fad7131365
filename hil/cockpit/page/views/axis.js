// An axis as on a control panel: what it does, and what an operator does with it.

import { Panel, dot } from "../plot.js";
import { COMMANDS as FOLLOWING, Following } from "../following.js";
import { Homing } from "../homing.js";
import { field, h, mark, number, show, short, text, unit } from "../dom.js";

const SHOWN_S = 10;
const BASIC = ["enable", "disable", "take", "release", "ack", "f8", "f5", "f6", "stop", "abs", "rel", "home", "f9", "jog", "slide", "velocity", "acceleration", "deceleration", "jerk", "target", "f1", "f2", "f3", "f4"];
const DYNAMICS = ["velocity", "acceleration", "deceleration", "jerk"];

/** A value with its name, unit, and a bar from `low` to `high` with a mark for the setpoint. */
class Value {
  constructor(name, decimals) {
    this.decimals = decimals;
    this.shown = h("output", { ariaLabel: name }, "\u2013");
    this.unit = h("span.unit", {}, "");
    this.aim = h("span.aim", {}, "");
    this.fill = h("span.fill");
    this.needle = h("span.needle");
    this.low = h("span.low", {}, "");
    this.high = h("span.high", {}, "");
    this.track = h("span.track", { "aria-hidden": "true" }, this.fill, this.needle);
    this.bar = h("div.bar", {}, this.track, this.low, this.high);
    this.element = h("div.value", { title: "Right key: show it in the scope" }, h("span.name", {}, name), h("span.reading", {}, this.shown, this.unit), this.aim, this.bar);
  }

  begin(name, range) {
    text(this.unit, unit(name));
    this.range = range;
    show(this.bar, Boolean(range));
    if (range) {
      text(this.low, short(range[0]));
      text(this.high, short(range[1]));
    }
  }

  set(value, setpoint) {
    text(this.shown, number(value, this.decimals));
    text(this.aim, setpoint === undefined || setpoint === null ? "" : `setpoint ${number(setpoint, this.decimals)}`);
    if (!this.range || value === null || value === undefined) return;
    const [low, high] = this.range;
    const place = (one) => Math.min(1, Math.max(0, (one - low) / (high - low)));
    const zero = place(0);
    const at = place(value);
    this.fill.style.left = `${100 * Math.min(zero, at)}%`;
    this.fill.style.width = `${100 * Math.abs(at - zero)}%`;
    mark(this.fill, "over", value < low || value > high);
    show(this.needle, setpoint !== undefined && setpoint !== null);
    if (setpoint !== undefined && setpoint !== null) this.needle.style.left = `${100 * place(setpoint)}%`;
  }
}

class AxisView {
  constructor(context) {
    this.context = context;
    this.names = [];
    this.axis = "";
    this.held = false;
    this.choose = h("div.choices", { role: "group", ariaLabel: "Axes" });
    this.badges = h("div.badges", {});
    this.alarms = h("div.alarms", { "aria-live": "polite" });
    this.notes = h("ul.notes", { "aria-live": "polite" });
    this.position = new Value("Position", 3);
    this.velocity = new Value("Velocity", 2);
    this.following = new Value("Following error", 4);
    this.torque = new Value("Torque", 3);
    this.output = new Value("Output", 2);
    this.enable = h("button.primary.operate", { type: "button", onclick: () => this.#enable() }, "Enable");
    this.give = h("button.operate", { type: "button", title: "Disable the axis and give it back to the user program", onclick: () => this.#do("release") }, "Give back");
    this.acknowledge = h("button.operate", { type: "button", title: "Acknowledge alarms; what they disabled stays off until Enable", onclick: () => this.#do(this.kind === "nc" ? "f8" : "ack") }, "Acknowledge");
    this.back = this.#jogButton("\u2212", "Jog backward", -1);
    this.forward = this.#jogButton("+", "Jog forward", 1);
    this.slider = h("input", { type: "range", min: 1, max: 100, value: 30, ariaLabel: "Jog velocity in percent of the set velocity", oninput: () => this.#slide() });
    this.sliderShown = h("output", {}, "30 %");
    this.target = h("input", { type: "number", step: "any", required: true, value: 100, ariaLabel: "Target or distance" });
    this.targetUnit = h("span.unit", {}, "");
    this.home = h("input", { type: "number", step: "any", required: true, value: 0, ariaLabel: "Home position" });
    this.homeUnit = h("span.unit", {}, "");
    this.dynamics = new Map(DYNAMICS.map((name) => [name, this.#dynamic(name)]));
    this.more = h("div.commands", {});
    this.charts = h("div.charts", {});
    this.homing = new Homing(context);
    this.element = h(
      "div.axis",
      {},
      this.choose,
      h(
        "div.columns",
        {},
        h(
          "div.column",
          {},
          h("section.card", {}, h("div.head", {}, (this.title = h("h2", {}, "Axis")), h("span.spacer"), this.badges), this.alarms, this.notes, h("div.values", {}, this.position.element, this.velocity.element, this.following.element, this.torque.element, this.output.element)),
          h("section.card.charted", {}, h("div.head", {}, h("h2", {}, `Last ${SHOWN_S} s`), h("span.spacer"), h("button", { type: "button", onclick: () => this.#toScope() }, "Open in the scope")), this.charts),
          this.homing.element,
        ),
        h(
          "div.column.narrow",
          {},
          h("section.card", {}, h("h2", {}, "Enable"), h("div.row", {}, this.enable, this.acknowledge, this.give)),
          h(
            "section.card",
            {},
            h("h2", {}, "Jog"),
            h("div.row.jog", {}, this.back, this.forward),
            h("label.field", {}, h("span", {}, "Velocity, % of the set one"), h("span.input", {}, this.slider, this.sliderShown)),
            h("p.note", {}, "Moves while a key is held. Keyboard: focus a key and hold the space bar."),
          ),
          h(
            "section.card",
            {},
            h("h2", {}, "Move"),
            h("form", { onsubmit: (event) => this.#move(event, "abs") }, h("div.row", {}, field("Target or distance", this.target), this.targetUnit), h("div.row", {}, (this.absolute = h("button.operate", { type: "submit" }, "To target")), (this.relative = h("button.operate", { type: "button", onclick: (event) => this.#move(event, "rel") }, "By distance")), h("button", { type: "button", onclick: () => this.#stop() }, "Stop"))),
            (this.homeForm = h("form", { onsubmit: (event) => this.#home(event) }, h("div.row", {}, field("Home position", this.home), this.homeUnit, (this.homeButton = h("button.operate", { type: "submit" }, "Home"))))),
          ),
          (this.gears = new Following((name, values) => this.#do(name, values))).element,
          h("section.card", {}, h("h2", {}, "Dynamics"), h("div.dynamics", {}, ...[...this.dynamics.values()].map((one) => one.form))),
          h("details.card", {}, h("summary", {}, "Other commands"), this.more),
        ),
      ),
    );
    window.addEventListener("blur", () => this.#letGo());
    document.addEventListener("visibilitychange", () => this.#letGo());
    this.panels = [];
  }

  // -- what an operator does

  #do(command, values = []) {
    return this.context.act("axis.command", { axis: this.axis, command, values });
  }

  async #enable() {
    const state = this.now;
    if (!state) return;
    if (state.enabled) {
      await this.#do("disable");
      return;
    }
    if (state.master !== "panel" && (await this.#do("take")) === undefined) return;
    await this.#do("enable");
  }

  #stop() {
    this.stopped();
    this.context.act("axis.stop_all");
  }

  #move(event, command) {
    event.preventDefault();
    const form = event.target.closest("form");
    if (!form.reportValidity()) return;
    const value = Number(this.target.value);
    if (this.kind === "nc") this.#do("target", [value]).then((said) => said !== undefined && this.#do("f5"));
    else this.#do(command, [value]);
  }

  #home(event) {
    event.preventDefault();
    if (this.kind === "nc") this.#do("f9");
    else this.#do("home", [Number(this.home.value)]);
  }

  #dynamic(name) {
    const input = h("input", { type: "number", step: "any", min: 0, required: true });
    const after = h("span.unit", {}, "");
    const label = name[0].toUpperCase() + name.slice(1);
    const form = h("form.row", { onsubmit: (event) => (event.preventDefault(), this.#do(name, [Number(input.value)])) }, h("label.field", {}, h("span", {}, label), h("span.input", {}, input, after)), h("button.operate", { type: "submit", ariaLabel: `Set ${name}` }, "Set"));
    return { input, after, form };
  }

  // -- jog: as long as a key is held

  #jogButton(sign, label, direction) {
    const button = h("button.operate.hold", { type: "button", ariaLabel: label }, sign);
    const press = () => this.#press(button, direction);
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || button.disabled) return;
      try {
        button.setPointerCapture(event.pointerId);
      } catch {
        // the pointer has gone already
      }
      press();
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => this.#letGo());
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    button.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) press();
    });
    button.addEventListener("keyup", (event) => {
      if (event.key === " " || event.key === "Enter") this.#letGo();
    });
    button.addEventListener("blur", () => this.#letGo());
    return button;
  }

  #press(button, direction) {
    if (this.held) return;
    this.held = true;
    this.direction = direction;
    mark(button, "held", true);
    this.context.act("axis.jog", { axis: this.axis, slider: direction * Number(this.slider.value) });
  }

  /** Everything has been stopped: a key that is still held moves nothing any more. */
  stopped() {
    this.held = false;
    mark(this.back, "held", false);
    mark(this.forward, "held", false);
  }

  #letGo() {
    if (!this.held) return;
    this.stopped();
    this.context.act("axis.jog", { axis: this.axis, slider: 0 });
  }

  #slide() {
    text(this.sliderShown, `${this.slider.value} %`);
    if (this.held) this.context.act("axis.jog", { axis: this.axis, slider: this.direction * Number(this.slider.value) });
  }

  // -- what is shown

  bench(bench) {
    this.described = bench.panes.axis?.axes || {};
    this.signals = new Map((bench.panes.scope || []).map((one) => [one.name, one]));
    this.names = Object.keys(this.described);
    this.now = null;
    this.choose.replaceChildren(...this.names.map((name) => h("button", { type: "button", "aria-pressed": "false", onclick: () => this.#choose(name) }, name)));
    show(this.choose, this.names.length > 1);
    this.#choose(this.names.includes(this.axis) ? this.axis : this.names[0]);
  }

  #choose(name) {
    this.#letGo();
    this.axis = name || "";
    const found = this.described[name];
    text(this.title, name || "No axis");
    for (const button of this.choose.children) button.setAttribute("aria-pressed", String(button.textContent === name));
    for (const panel of this.panels) panel.destroy();
    this.panels = [];
    this.charts.replaceChildren();
    if (!found) return;
    this.kind = found.make;
    const { units, limits, position } = found;
    for (const one of [this.position, this.following]) show(one.element, position);
    for (const [one, column] of [[this.position, "actual_position"], [this.velocity, position ? "actual_velocity" : "actual_speed"], [this.following, "following_error"], [this.torque, "actual_torque"]]) {
      if (this.signals.has(`${name}.${column}`)) one.element.dataset.signal = `${name}.${column}`;
      else delete one.element.dataset.signal;
    }
    this.position.begin(units.length, limits.position);
    this.velocity.begin(units.velocity, [-limits.velocity, limits.velocity]);
    this.following.begin(units.length, limits.following_error ? [-limits.following_error, limits.following_error] : null);
    this.torque.begin("Nm", limits.torque ? [-limits.torque, limits.torque] : null);
    this.output.begin("%", [-100, 100]);
    text(this.targetUnit, unit(position ? units.length : units.velocity));
    text(this.homeUnit, unit(units.length));
    for (const [dynamic, one] of this.dynamics) text(one.after, unit(units[dynamic === "velocity" ? "velocity" : dynamic === "jerk" ? "jerk" : "acceleration"]));
    show(this.give, this.kind === "s7");
    show(this.relative, this.kind === "s7");
    show(this.homeForm, position);
    this.more.replaceChildren(...Object.entries(found.commands).filter(([one]) => !BASIC.includes(one) && !FOLLOWING.includes(one)).map(([one, [usage, meaning]]) => this.#command(one, usage, meaning)));
    this.gears.begin(found, this.described);
    this.filled = false;
    this.homing.begin(name);
    this.#chart();
  }

  #command(name, usage, meaning) {
    const inputs = usage.split(" ").filter(Boolean).map((one) => {
      const plain = one.replace(/[[\]]/g, "");
      const text = ["NAME", "LEADER", "CAM"].includes(plain);
      return h("input", { type: text ? "text" : "number", step: "any", placeholder: plain.toLowerCase(), required: !one.startsWith("["), ariaLabel: `${name}: ${plain.toLowerCase()}` });
    });
    return h(
      "form.row",
      {
        onsubmit: (event) => {
          event.preventDefault();
          const given = inputs.filter((one) => one.value !== "").map((one) => (one.type === "number" ? Number(one.value) : one.value));
          this.#do(name, given);
        },
      },
      h("button.operate", { type: "submit" }, name),
      ...inputs,
      h("span.note", {}, meaning),
    );
  }

  #signalsOf(name) {
    const exists = (one) => this.signals.has(`${name}.${one}`);
    const groups = [
      ["position_setpoint", "set_position", "actual_position"],
      ["velocity_setpoint", "set_velocity", "actual_velocity"],
      ["following_error"],
    ];
    return groups.map((group) => group.filter(exists).map((one) => `${name}.${one}`)).filter((group) => group.length);
  }

  #chart() {
    const groups = this.#signalsOf(this.axis);
    groups.forEach((names, place) => {
      const last = place === groups.length - 1;
      const host = h("div.chart", {});
      const labels = names.map((one) => one.split(".")[1].replaceAll("_", " "));
      const legend = h("div.legend", {}, ...labels.map((label, number) => h("span.key", {}, dot(number), label)));
      this.charts.append(legend, host);
      const panel = new Panel(host, { names, labels, unit: this.signals.get(names[0]).unit, colours: names.map((_, number) => number), height: last ? 160 : 130, axis: last, key: "axis" });
      panel.names = names;
      this.panels.push(panel);
    });
    this.context.samples.want("axis", this.visible ? groups.flat() : []);
  }

  #toScope() {
    for (const name of this.#signalsOf(this.axis).flat()) this.context.scope(name);
  }

  shown(visible) {
    this.visible = visible;
    if (!visible) this.#letGo();
    this.context.samples.want("axis", visible ? this.panels.flatMap((one) => one.names) : []);
    if (visible) requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    if (!this.visible) return;
    let end = null;
    for (const panel of this.panels) for (const name of panel.names) end = Math.max(end ?? -Infinity, this.context.samples.of(name).last ?? -Infinity);
    if (end !== null && Number.isFinite(end) && end !== this.drawn) {
      this.drawn = end;
      for (const panel of this.panels) panel.show(panel.names.map((name) => this.context.samples.of(name)), end - SHOWN_S, end);
    }
    requestAnimationFrame(() => this.#draw());
  }

  restyle() {
    for (const panel of this.panels) panel.restyle();
    this.drawn = null;
  }

  state(state) {
    const now = state.axis?.[this.axis];
    const may = this.context.operates();
    for (const button of this.element.querySelectorAll("button.operate")) button.disabled = !may || !now;
    this.now = now;
    if (!now) return;
    if (!may || !now.enabled) this.#letGo();
    for (const one of [this.back, this.forward, this.relative, this.absolute, this.homeButton]) one.disabled = !may || !now.enabled;
    this.give.disabled = !may || now.master !== "panel";
    this.acknowledge.disabled = !may || !now.alarms.length;
    text(this.enable, now.enabled ? "Disable" : "Enable");
    mark(this.enable, "primary", !now.enabled);
    this.position.set(now.position, now.position_setpoint);
    this.velocity.set(now.velocity, now.velocity_setpoint);
    this.following.set(now.following_error);
    this.torque.set(now.torque);
    show(this.torque.element, now.torque !== null && now.torque !== undefined);
    this.output.set(now.output);
    show(this.output.element, now.output !== null && now.output !== undefined);
    this.gears.state(now, state.axis, may);
    this.homing.state(now.state === "homing" || (now.job || "").startsWith("MC_Home"));
    this.#badges(now);
    this.#alarms(now);
    if (!this.filled && Object.keys(now.dynamics).length) {
      for (const [name, value] of Object.entries(now.dynamics)) this.dynamics.get(name).input.value = String(Number(value.toPrecision(8)));
      this.filled = true;
    }
  }

  #badges(now) {
    const shown = [[now.state, now.alarms.length ? "bad" : now.enabled ? "good" : ""]];
    if (now.homed !== undefined) shown.push([now.homed ? "homed" : "not homed", now.homed ? "" : "warn"]);
    if (this.kind === "s7") shown.push([now.master === "panel" ? "panel" : "user program", ""]);
    if (now.synchronous || now.job) shown.push([now.synchronous || now.job, "busy"]);
    for (const [name, active] of Object.entries(now.switches || {})) if (active) shown.push([`${name} limit`, "bad"]);
    const key = JSON.stringify(shown);
    if (key === this.badgeKey) return;
    this.badgeKey = key;
    this.badges.replaceChildren(...shown.map(([said, kind]) => h(kind ? `span.badge.${kind}` : "span.badge", {}, said)));
  }

  #alarms(now) {
    const key = JSON.stringify([now.alarms, now.notes]);
    if (key === this.alarmKey) return;
    this.alarmKey = key;
    this.alarms.replaceChildren(
      ...now.alarms.map((alarm) =>
        h(`div.alarm.class-${alarm.class.toLowerCase()}`, {}, h("strong", {}, `Alarm ${alarm.number}`), h("span", {}, ` ${alarm.text} `), h("span.note", {}, `(${alarm.reaction})`), alarm.causes.length ? h("details", {}, h("summary", {}, "Possible causes"), h("ul", {}, ...alarm.causes.map((cause) => h("li", {}, cause)))) : null, h("p.remedy", {}, alarm.remedy)),
      ),
    );
    this.notes.replaceChildren(...now.notes.filter((note) => !note.startsWith("alarm ")).map((note) => h("li", {}, note)));
    show(this.notes, this.notes.children.length > 0);
  }
}

export const view = { name: "axis", title: "Axis", create: (context) => new AxisView(context) };
