// The faults: catalogue with search, a form with units and ranges, what is armed, and taking it back.

import { field, h, mark, number, show, text } from "../dom.js";

const WHEN = {
  now: { title: "Now", fields: [] },
  after: { title: "After a time", fields: [["time_s", "Time", "s", 0.5]] },
  at: { title: "At a bench time", fields: [["time_s", "Bench time", "s", 1]] },
  position: { title: "When an axis passes a position", fields: [["axis", "Axis", "axis"], ["value", "Position", "axis unit", 100], ["direction", "Direction", ["any", "rising", "falling"]]] },
  velocity: { title: "When an axis passes a velocity", fields: [["axis", "Axis", "axis"], ["value", "Velocity", "axis unit per s", 50], ["direction", "Direction", ["any", "rising", "falling"]]] },
  signal: { title: "When a signal passes a value", fields: [["signal", "Signal", "signal"], ["value", "Value", "", 0], ["direction", "Direction", ["any", "rising", "falling"]]] },
  state: { title: "When a part is in a state", fields: [["component", "Part", "text", "axis1"], ["state", "State", "text", "MOTION"]] },
  event: { title: "At an event", fields: [["kind", "Event", "text", "alarm.raised"], ["source", "Of", "text", ""]] },
};

class FaultView {
  constructor(context) {
    this.context = context;
    this.search = h("input.find", { type: "search", placeholder: "limit switch, heartbeat, encoder \u2026", ariaLabel: "Search faults", oninput: () => this.#filter() });
    this.possible = h("input", { type: "checkbox", checked: false, onchange: () => this.#filter() });
    this.found = h("span.note", { role: "status" }, "");
    this.list = h("div.catalogue", { role: "listbox", ariaLabel: "Kinds of faults", tabIndex: 0, onkeydown: (event) => this.#walk(event) });
    this.form = h("form.fault-form", { onsubmit: (event) => this.#arm(event) }, h("p.note", {}, "Choose a fault from the list."));
    this.lines = h("tbody", {});
    this.none = h("p.note", {}, "No fault has been armed.");
    this.table = h("table.armed", {}, h("thead", {}, h("tr", {}, ...["No.", "Fault", "On", "When", "Stands", "Applied", ""].map((one) => h("th", {}, one)))), this.lines);
    this.all = h("button.operate", { type: "button", onclick: () => context.act("faults.take_back_all") }, "Take back all");
    this.element = h(
      "div.faults",
      {},
      h("section.card", {}, h("div.head", {}, h("h2", {}, "Armed and active"), h("span.spacer"), this.all), this.none, h("div.scroll", { tabIndex: 0, role: "region", ariaLabel: "Armed faults" }, this.table)),
      h(
        "div.columns.even",
        {},
        h("section.card", {}, h("div.head", {}, h("h2", {}, "Catalogue"), this.found, h("span.spacer"), this.search), h("label.check", {}, this.possible, "Only what this bench can do"), this.list),
        h("section.card", {}, this.form),
      ),
    );
    this.known = "";
  }

  bench(bench) {
    this.catalogue = bench.panes.faults?.catalogue || [];
    this.axes = Object.keys(bench.panes.axis?.axes || {});
    this.signals = (bench.panes.scope || []).map((one) => one.name);
    this.options = new Map();
    this.chosen = null;
    this.known = "";
    this.list.replaceChildren();
    this.form.replaceChildren(h("p.note", {}, "Choose a fault from the list."));
    let family = "";
    for (const fault of this.catalogue) {
      if (fault.family !== family) {
        family = fault.family;
        this.list.append(h("h3", { role: "presentation" }, family));
      }
      const option = h(
        "div.fault",
        { role: "option", id: `fault-${fault.name.replaceAll(".", "-")}`, onclick: () => this.#choose(fault) },
        h("span.fault-name", {}, fault.name),
        h("span.fault-summary", {}, fault.summary),
        fault.reason ? h("span.fault-reason", {}, `Not on this bench: ${fault.reason}`) : null,
      );
      option.setAttribute("aria-selected", "false");
      if (fault.reason) option.setAttribute("aria-disabled", "true");
      this.options.set(fault.name, option);
      this.list.append(option);
    }
    this.#filter();
  }

  #filter() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    let heading = null;
    let below = 0;
    for (const element of this.list.children) {
      if (element.tagName === "H3") {
        if (heading) show(heading, below > 0);
        heading = element;
        below = 0;
        continue;
      }
      const fault = this.catalogue.find((one) => this.options.get(one.name) === element);
      const all = `${fault.name} ${fault.family} ${fault.summary} ${fault.remark}`.toLowerCase();
      const fits = words.every((word) => all.includes(word)) && !(this.possible.checked && fault.reason);
      show(element, fits);
      if (fits) {
        shown += 1;
        below += 1;
      }
    }
    if (heading) show(heading, below > 0);
    text(this.found, `${shown} of ${this.catalogue.length}`);
  }

  #walk(event) {
    if (event.key !== "ArrowDown" && event.key !== "ArrowUp") return;
    event.preventDefault();
    const visible = this.catalogue.filter((one) => !this.options.get(one.name).hidden);
    const place = visible.indexOf(this.chosen);
    const next = visible[event.key === "ArrowDown" ? Math.min(place + 1, visible.length - 1) : Math.max(place - 1, 0)];
    if (next) {
      this.#choose(next);
      this.options.get(next.name).scrollIntoView({ block: "nearest" });
    }
  }

  #choose(fault) {
    if (this.chosen) this.options.get(this.chosen.name).setAttribute("aria-selected", "false");
    this.chosen = fault;
    const option = this.options.get(fault.name);
    option.setAttribute("aria-selected", "true");
    this.list.setAttribute("aria-activedescendant", option.id);
    this.#fill(fault);
  }

  #fill(fault) {
    this.inputs = new Map();
    this.target = h("select", {}, ...fault.targets.map((one) => h("option", { value: one }, one || "controller")));
    const rows = fault.parameters.map((one) => {
      const input = this.#input(one);
      this.inputs.set(one.name, { input, parameter: one });
      return h("div.parameter", {}, field(`${one.name}${one.required ? " *" : ""}`, input, one.unit), h("span.note", {}, `${one.summary}; ${one.allowed}${one.default === null || one.default === "" ? "" : `, default ${one.default}`}`.replaceAll("`", "")));
    });
    this.when = h("select", { onchange: () => this.#when() }, ...Object.entries(WHEN).map(([name, one]) => h("option", { value: name }, one.title)));
    this.whenFields = h("div.row", {});
    this.duration = h("input.wide-number", { type: "number", min: 0.001, step: "any", placeholder: "until taken back" });
    this.count = h("input", { type: "number", min: 1, step: 1, placeholder: "no limit" });
    const arm = h("button.primary.operate", { type: "submit", disabled: Boolean(fault.reason) }, "Inject");
    this.button = arm;
    this.form.replaceChildren(
      h("div.head", {}, h("h2", {}, fault.name)),
      h("p", {}, `${fault.summary}.`),
      fault.remark ? h("p.note", {}, fault.remark) : "",
      fault.reason ? h("p.reason", { role: "note" }, `This bench cannot do it: ${fault.reason}.`) : "",
      fault.targets.length ? field(`On (${fault.target})`, this.target) : "",
      ...rows,
      field("When", this.when),
      this.whenFields,
      h("div.row", {}, fault.lasting ? field("For", this.duration, "s") : "", fault.counted ? field("Frames that are hit", this.count) : ""),
      h("div.row", {}, arm),
    );
    this.#when();
  }

  #input(parameter) {
    if (parameter.type === "bool") return h("select", {}, parameter.required ? null : h("option", { value: "" }, "default"), h("option", { value: "true" }, "true"), h("option", { value: "false" }, "false"));
    if (parameter.range && parameter.type === "text") return h("select", { required: parameter.required }, parameter.required ? null : h("option", { value: "" }, "default"), ...parameter.range.map((one) => h("option", { value: one }, one)));
    if (parameter.type === "text") return h("input", { type: "text", required: parameter.required });
    const input = h("input", { type: "text", inputMode: "decimal", required: parameter.required, autocomplete: "off" });
    if (parameter.default !== null) input.placeholder = String(parameter.default);
    return input;
  }

  #when() {
    const fields = WHEN[this.when.value].fields;
    this.whenInputs = new Map();
    this.whenFields.replaceChildren(
      ...fields.map(([name, title, kind, value]) => {
        let input;
        if (Array.isArray(kind)) input = h("select", {}, ...kind.map((one) => h("option", { value: one }, one)));
        else if (kind === "axis") input = h("select", {}, ...this.axes.map((one) => h("option", { value: one }, one)));
        else if (kind === "signal") input = h("select", {}, ...this.signals.map((one) => h("option", { value: one }, one)));
        else if (kind === "text") input = h("input", { type: "text", value });
        else input = h("input", { type: "number", step: "any", value, required: true });
        this.whenInputs.set(name, input);
        return field(title, input, kind === "s" ? "s" : "");
      }),
    );
  }

  #trigger() {
    const when = this.when.value;
    if (when === "now") return null;
    const trigger = { when };
    for (const [name, input] of this.whenInputs) {
      if (input.type === "number") trigger[name] = Number(input.value);
      else if (input.value && input.value !== "any") trigger[name] = input.value;
    }
    return trigger;
  }

  async #arm(event) {
    event.preventDefault();
    const fault = this.chosen;
    if (!fault || fault.reason) return;
    const parameters = {};
    for (const [name, { input, parameter }] of this.inputs) {
      const value = input.value.trim();
      if (!value) continue;
      if (parameter.type === "bool") parameters[name] = value === "true";
      else if (parameter.type === "text") parameters[name] = value;
      else parameters[name] = Number(value.replace(/^([0-9A-Fa-f]+)h$/, "0x$1"));
      if (Number.isNaN(parameters[name])) parameters[name] = value;
    }
    const fields = { fault: fault.name, target: this.target.value || "", parameters };
    const trigger = this.#trigger();
    if (trigger) fields.trigger = trigger;
    if (fault.lasting && this.duration.value) fields.duration_s = Number(this.duration.value);
    if (fault.counted && this.count.value) fields.count = Number(this.count.value);
    await this.context.act("faults.arm", fields);
  }

  state(state) {
    const armed = state.faults || [];
    const said = JSON.stringify(armed);
    const operates = this.context.operates();
    this.all.disabled = !operates || !armed.some((one) => one.stands !== "over");
    if (this.button) this.button.disabled = !operates || Boolean(this.chosen?.reason);
    for (const button of this.lines.querySelectorAll("button")) button.disabled = !operates;
    if (said === this.known) return;
    this.known = said;
    show(this.none, armed.length === 0);
    show(this.table, armed.length > 0);
    this.lines.replaceChildren(...armed.map((one) => this.#line(one, operates)));
  }

  #line(one, operates) {
    const given = Object.entries(one.parameters).map(([name, value]) => `${name} ${value}`).join(", ");
    const badge = h("span.badge", {}, one.stands);
    mark(badge, "bad", one.stands === "active");
    mark(badge, "busy", one.stands === "armed");
    const times = one.applied_s === null ? "" : `${number(one.applied_s, 3)} s${one.removed_s !== null && one.stands === "over" && one.removed_s > one.applied_s ? ` to ${number(one.removed_s, 3)} s` : ""}`;
    return h(
      "tr",
      {},
      h("td.right", {}, String(one.number)),
      h("td", {}, one.kind, given ? h("span.note", {}, ` ${given}`) : null),
      h("td", {}, one.target || "controller"),
      h("td", {}, [one.trigger, one.ends].filter(Boolean).join(", "), one.waiting ? h("div.note", {}, one.waiting) : null),
      h("td", {}, badge),
      h("td", {}, times),
      h("td", {}, one.stands === "over" ? "" : h("button", { type: "button", disabled: !operates, onclick: () => this.context.act("faults.take_back", { number: one.number }) }, "Take back")),
    );
  }
}

export const view = { name: "faults", title: "Faults", create: (context) => new FaultView(context) };
