// The bench as a picture, its events, and its file.

import { field, h, mark, number, show, text, toast } from "../dom.js";

const KINDS = { can: "CAN", modbus_tcp: "Modbus TCP", modbus_rtu: "Modbus RTU" };
const MOST_LINES = 500;

/** A box of the picture: name, a line of facts, a line of state. */
function box(kind, name, facts, onclick) {
  const state = h("span.box-state", {}, "");
  const detail = h("span.box-detail", {}, "");
  const inside = [h("span.box-name", {}, name), h("span.box-facts", {}, facts), state, detail];
  const element = onclick ? h(`button.box.${kind}`, { type: "button", onclick }, ...inside) : h(`div.box.${kind}`, {}, ...inside);
  return { element, state, detail };
}

function facts(device) {
  const parts = [{ cia402: "CiA 402", profidrive: "PROFIdrive", cia406: "CiA 406" }[device.profile] || device.profile.replaceAll("_", " "), device.kind];
  if (device.address !== null) parts.push(`no. ${device.address}`);
  if (device.physical) parts.push("physical");
  return parts.filter(Boolean).join(", ");
}

class BenchView {
  constructor(context) {
    this.context = context;
    this.picture = h("div.picture", {});
    this.lines = h("tbody", {});
    this.filter = h("input", { type: "search", placeholder: "alarm, x_drive, \u2026", ariaLabel: "Filter of events", oninput: () => this.#filter() });
    this.left = h("p.note", { hidden: true });
    this.table = h("div.scroll", { tabIndex: 0, role: "region", ariaLabel: "Events" }, h("table.events", {}, h("thead", {}, h("tr", {}, h("th.right", {}, "Time"), h("th", {}, "Source"), h("th", {}, "Event"), h("th", {}, "Details"))), this.lines));
    this.source = h("input", { type: "text", spellcheck: false, autocomplete: "off", required: true });
    this.source.setAttribute("list", "benches");
    this.sources = h("datalist", { id: "benches" });
    this.editor = h("textarea", { spellcheck: false, rows: 24, ariaLabel: "Bench file", onkeyup: () => this.#explain(), onclick: () => this.#explain() });
    this.help = h("p.note.help", { role: "status" }, "Put the cursor on a key: its meaning is shown here.");
    this.mistakes = h("pre.mistakes", { hidden: true, role: "alert" });
    this.file = h(
      "details.card",
      { ontoggle: () => this.#load() },
      h("summary", {}, "Bench file"),
      h("form.row", { onsubmit: (event) => this.#open(event) }, field("Embedded name, or a file of the working folder", this.source), h("button.operate", { type: "submit" }, "Open")),
      this.sources,
      this.editor,
      this.help,
      this.mistakes,
      h("div.row", {}, h("button", { type: "button", onclick: () => this.#check() }, "Check"), h("button.operate", { type: "button", onclick: () => this.#start() }, "Start with this text"), h("button", { type: "button", onclick: () => this.#read() }, "Text of the running bench")),
    );
    this.element = h(
      "div.bench",
      {},
      h("section.card", {}, h("div.head", {}, h("h2", {}, "Bench"), h("span.spacer"), h("button.operate", { type: "button", title: "Close the bench and bring it up anew", onclick: () => context.act("bench.reset") }, "Reset bench")), this.picture),
      h("section.card", {}, h("div.head", {}, h("h2", {}, "Events"), h("span.spacer"), this.filter), this.left, this.table),
      this.file,
    );
  }

  bench(bench) {
    this.devices = new Map();
    this.axes = new Map();
    this.buses = new Map();
    this.picture.replaceChildren();
    this.lines.replaceChildren();
    this.read = false;
    if (this.file.open) this.#read();
    const found = bench.panes.bench;
    if (!found) {
      this.picture.append(h("p.note", {}, bench.failure || "The bench is coming up \u2026"));
      return;
    }
    this.controller = box("controller", "controller", `cycle ${found.cycle_ms} ms`);
    const chips = found.axes.map((axis) => {
      const chip = box("axis", axis.name, axis.leading.length ? `follows ${axis.leading.join(" or ")}` : "axis", () => this.context.open("axis"));
      this.axes.set(axis.name, chip);
      return chip.element;
    });
    this.picture.append(h("div.master", {}, this.controller.element, h("div.chips", {}, ...chips)));
    for (const segment of found.segments) {
      const load = h("meter", { min: 0, max: 100, high: 70, value: 0, ariaLabel: `Load of ${segment.name}` });
      const said = h("span.load", {}, "");
      const errors = h("span.counters", {}, "");
      const rate = segment.bitrate ? `, ${segment.bitrate / 1000} kbit/s` : "";
      const hangs = segment.devices.map((device) => {
        const one = box("device", device.name, facts(device));
        one.device = device;
        this.devices.set(device.name, one);
        return h("div.hang", {}, one.element, device.axis ? h("span.moves", {}, `moves ${device.axis}`) : null);
      });
      this.buses.set(segment.name, { load, said, errors });
      this.picture.append(
        h("div.segment", {}, h("div.bus-head", {}, h("strong", {}, segment.name), h("span.bus-facts", {}, `${KINDS[segment.kind] || segment.kind}${rate}`), load, said, errors), h("div.bus", {}, ...hangs)),
      );
    }
    this.context
      .request("bench.events", { most: 200 })
      .then((events) => {
        this.lines.replaceChildren();
        this.events(events, 0);
      })
      .catch(() => {});
  }

  state(state) {
    const bench = state.bench;
    for (const button of this.element.querySelectorAll("button.operate")) button.disabled = !this.context.operates();
    if (!bench || !this.controller) return;
    text(this.controller.state, bench.controller);
    mark(this.controller.element, "good", bench.controller === "RUN");
    for (const [name, bus] of this.buses) {
      const found = bench.segments[name];
      show(bus.load, found.load !== null && found.load !== undefined);
      if (found.load !== null && found.load !== undefined) {
        bus.load.value = found.load;
        text(bus.said, `load ${number(found.load, 1)} %`);
      }
      const counting = found.ports.filter((port) => port[2] || port[3] || port[1] !== "ERROR_ACTIVE");
      text(bus.errors, found.ports.length ? (counting.length ? "" : "no error counted") : "");
      for (const port of found.ports) {
        const device = this.devices.get(port[0]) || (port[0] === "controller" ? this.controller : null);
        if (device) {
          const quiet = !port[2] && !port[3] && port[1] === "ERROR_ACTIVE";
          text(device.detail, quiet ? "" : `${port[1].toLowerCase().replace("_", " ")}, TEC ${port[2]}, REC ${port[3]}`);
          mark(device.element, "bad", port[1] !== "ERROR_ACTIVE");
        }
      }
    }
    for (const [name, device] of this.devices) {
      const node = bench.nodes[name];
      const own = bench.devices[name];
      text(device.state, own || node || "");
      mark(device.element, "warn", node !== undefined && node !== "in service");
      if (node !== undefined && node !== "in service") text(device.detail, `node ${node}`);
    }
    for (const [name, chip] of this.axes) {
      const axis = state.axis?.[name];
      if (!axis) continue;
      text(chip.state, axis.state);
      const alarm = axis.alarms[0];
      text(chip.detail, alarm ? `alarm ${alarm.number}` : "");
      mark(chip.element, "bad", Boolean(alarm));
      mark(chip.element, "good", axis.enabled && !alarm);
    }
  }

  events(events, leftOut) {
    if (leftOut) {
      text(this.left, `${leftOut} events came too fast to be listed.`);
      show(this.left, true);
    }
    const near = this.table.scrollTop < 40;
    const wanted = this.filter.value.trim().toLowerCase();
    for (const [time, source, kind, data] of events) {
      const details = Object.entries(data)
        .map(([name, value]) => `${name} ${typeof value === "number" && !Number.isInteger(value) ? value.toPrecision(6) : value}`)
        .join(", ");
      const line = h("tr", {}, h("td.right", {}, `${number(time, 3)} s`), h("td", {}, source), h("td", {}, kind), h("td", {}, details));
      if (kind.startsWith("alarm.raised") || kind.startsWith("fault.")) line.className = "loud";
      line.hidden = Boolean(wanted) && !line.textContent.toLowerCase().includes(wanted);
      this.lines.prepend(line);
    }
    while (this.lines.children.length > MOST_LINES) this.lines.lastChild.remove();
    if (near) this.table.scrollTop = 0;
  }

  #filter() {
    const wanted = this.filter.value.trim().toLowerCase();
    for (const line of this.lines.children) line.hidden = Boolean(wanted) && !line.textContent.toLowerCase().includes(wanted);
  }

  // -- file

  async #load() {
    if (!this.file.open) return;
    if (!this.read) await this.#read();
    if (this.schema) return;
    try {
      const known = await this.context.request("bench.list");
      this.sources.replaceChildren(...[...known.embedded, ...known.files].map((value) => h("option", { value })));
      this.schema = await this.context.request("bench.schema");
    } catch (error) {
      toast(error.message, "error");
    }
  }

  async #read() {
    this.editor.value = (await this.context.act("bench.text")) ?? "";
    this.read = true;
    show(this.mistakes, false);
  }

  async #open(event) {
    event.preventDefault();
    this.#said(this.context.request("bench.open", { source: this.source.value }));
  }

  async #check() {
    const said = await this.context.act("bench.check", { text: this.editor.value });
    if (said === undefined) return;
    text(this.mistakes, said);
    show(this.mistakes, said !== "");
    if (!said) toast("The text describes a bench.");
  }

  #start() {
    this.#said(this.context.request("bench.start_text", { text: this.editor.value }));
  }

  async #said(reply) {
    try {
      await reply;
      show(this.mistakes, false);
    } catch (error) {
      text(this.mistakes, error.message);
      show(this.mistakes, true);
    }
  }

  /** Show what the schema says of the key under the cursor. */
  #explain() {
    if (!this.schema) return;
    const before = this.editor.value.slice(0, this.editor.selectionStart);
    const rest = this.editor.value.slice(this.editor.selectionStart).split("\n")[0];
    const line = before.split("\n").at(-1) + rest;
    const key = line.match(/^\s*"?([\w.[\]]+)"?\s*=/)?.[1] || "";
    const table = [...before.matchAll(/^\s*\[([^\]]+)\]/gm)].at(-1)?.[1] || "";
    const found = help(this.schema, table.split("."), key);
    text(this.help, found || "Put the cursor on a key: its meaning is shown here.");
  }
}

/** Return the description of a key of a table in a JSON Schema; empty: there is none. */
function help(schema, table, key) {
  const step = (nodes, name) => {
    const found = [];
    for (const node of nodes.flatMap((one) => opened(schema, one))) {
      if (node.properties?.[name]) found.push(node.properties[name]);
      else if (typeof node.additionalProperties === "object") found.push(node.additionalProperties);
    }
    return found;
  };
  let nodes = [schema];
  for (const name of table.filter(Boolean)) nodes = step(nodes, name);
  if (key) nodes = step(nodes, key);
  else if (!table[0]) return "";
  const said = nodes.flatMap((one) => [one, ...opened(schema, one)]).find((one) => one.description);
  if (!said) return "";
  const parts = [`${key || table.join(".")}: ${said.description}`];
  const first = nodes[0];
  if (first.default !== undefined && typeof first.default !== "object") parts.push(`Default ${first.default}.`);
  if (first.enum) parts.push(`One of ${first.enum.join(", ")}.`);
  return parts.join(" ");
}

function opened(schema, node, depth = 0) {
  if (!node || typeof node !== "object" || depth > 8) return [];
  if (node.$ref) return opened(schema, node.$ref.split("/").slice(1).reduce((at, name) => at?.[name], schema), depth + 1);
  const parts = [...(node.anyOf || []), ...(node.oneOf || []), ...(node.allOf || [])];
  return parts.length ? [node, ...parts.flatMap((one) => opened(schema, one, depth + 1))] : [node];
}

export const view = { name: "bench", title: "Bench", create: (context) => new BenchView(context) };
