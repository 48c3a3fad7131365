// The buses: decoded frames with a filter, one of them bit by bit, and the objects of the nodes.

import { field, h, mark, number, show, text, toast } from "../dom.js";

const ASK_MS = 250;
const MOST_ROWS = 200;
const SHOWN_OBJECTS = 80;

class BusView {
  constructor(context) {
    this.context = context;
    this.visible = false;
    this.since = -1;
    this.asking = false;
    this.segment = h("select", { ariaLabel: "Segment", onchange: () => this.#again() });
    this.words = h("input", { type: "search", placeholder: "185, SDO, drive1 \u2026", ariaLabel: "Filter of frames", oninput: () => this.#again() });
    this.cyclic = h("input", { type: "checkbox", checked: true, onchange: () => this.#again() });
    this.hold = h("button", { type: "button", ariaPressed: "false", onclick: () => this.#hold() }, "Hold");
    this.said = h("span.note", { role: "status" }, "");
    this.rows = h("tbody", {});
    this.frames = h("div.scroll.frames", { tabIndex: 0, role: "region", ariaLabel: "Frames" }, h("table", {}, h("thead", {}, h("tr", {}, h("th.right", {}, "Time"), h("th", {}, "ID"), h("th", {}, "From"), h("th", {}, "Data"), h("th", {}, "Meaning"))), this.rows));
    this.detail = h("section.card.detail", { tabIndex: 0, ariaLabel: "Frame in detail" }, h("h2", {}, "Frame"), h("p.note", {}, "Choose a frame: its fields and bits are shown here."));
    this.node = h("select", { ariaLabel: "Node", onchange: () => this.#objects() });
    this.find = h("input", { type: "search", placeholder: "6040h, ramp, 1018h \u2026", ariaLabel: "Search objects", oninput: () => this.#list() });
    this.foundObjects = h("span.note", { role: "status" }, "");
    this.objectRows = h("tbody", {});
    this.objectTable = h("div.scroll.objects", { tabIndex: 0, role: "region", ariaLabel: "Objects" }, h("table", {}, h("thead", {}, h("tr", {}, ...["Object", "Name", "Type", "Access", "Default", "Value", ""].map((one) => h("th", {}, one)))), this.objectRows));
    this.noNode = h("p.note", { hidden: true }, "");
    this.confirm = h("dialog", { ariaLabel: "Write an object" });
    this.element = h(
      "div.bus-view",
      {},
      h(
        "div.columns.wide-left",
        {},
        h("section.card", {}, h("div.head", {}, h("h2", {}, "Frames"), this.segment, this.words, h("label.check", {}, this.cyclic, "SYNC and PDO"), h("span.spacer"), this.said, this.hold), this.frames),
        this.detail,
      ),
      h("section.card", {}, h("div.head", {}, h("h2", {}, "Objects"), this.node, this.find, this.foundObjects), this.noNode, this.objectTable),
      this.confirm,
    );
    context.connection.on("object", (document) => this.#object(document));
    setInterval(() => this.#ask(), ASK_MS);
  }

  bench(bench) {
    const found = bench.panes.bus;
    this.values = new Map();
    this.lines = new Map();
    this.entries = [];
    this.held = false;
    this.hold.setAttribute("aria-pressed", "false");
    this.segment.replaceChildren(...(found?.segments || []).map((one) => h("option", { value: one }, one)));
    const nodes = found?.nodes || [];
    const usable = nodes.filter((one) => !one.reason);
    this.channels = new Map(nodes.map((one) => [one.name, one.by]));
    this.node.replaceChildren(...nodes.map((one) => h("option", { value: one.name, disabled: Boolean(one.reason), title: one.reason }, one.reason ? `${one.name} (${one.reason})` : one.name)));
    if (usable.length) this.node.value = usable[0].name;
    text(this.noNode, nodes.length ? `No object can be read here. ${nodes.map((one) => `${one.name}: ${one.reason}`).join("; ")}.` : "No node of this bench has objects that the controller can reach.");
    show(this.noNode, !usable.length);
    show(this.objectTable, usable.length > 0);
    this.objectRows.replaceChildren();
    this.#again();
    if (this.visible) this.#objects();
  }

  shown(visible) {
    this.visible = visible;
    if (visible && !this.entries?.length) this.#objects();
  }

  state() {
    const operates = this.context.operates();
    for (const button of this.objectRows.querySelectorAll("button")) button.disabled = !operates;
  }

  #hold() {
    this.held = !this.held;
    this.hold.setAttribute("aria-pressed", String(this.held));
  }

  #again() {
    this.since = -1;
    this.rows.replaceChildren();
    this.held = false;
    this.hold.setAttribute("aria-pressed", "false");
    this.#ask();
  }

  async #ask() {
    if (!this.visible || this.held || this.asking || !this.segment.value || !this.context.connection.connected) return;
    this.asking = true;
    const key = `${this.segment.value} ${this.words.value} ${this.cyclic.checked}`;
    try {
      const answer = await this.context.request("bus.frames", { segment: this.segment.value, since: this.since, words: this.words.value, cyclic: this.cyclic.checked, most: MOST_ROWS });
      if (key === `${this.segment.value} ${this.words.value} ${this.cyclic.checked}`) this.#show(answer);
    } catch (error) {
      text(this.said, error.message);
    } finally {
      this.asking = false;
    }
  }

  #show(answer) {
    this.since = answer.next;
    text(this.said, `${answer.next.toLocaleString("en")} frames${answer.left_out ? `, ${answer.left_out} not shown` : ""}`);
    if (!answer.rows.length) return;
    const atEnd = this.frames.scrollTop + this.frames.clientHeight >= this.frames.scrollHeight - 30;
    const before = this.rows.lastChild ? Number(this.rows.lastChild.dataset.number) : -1;
    for (const row of answer.rows) {
      if (row.number <= before) continue;
      const button = h("button.plain.time-of", { type: "button", onclick: () => this.#open(row.number) }, number(row.time_s, 6));
      const line = h("tr", {}, h("td.right", {}, button), h("td", {}, row.id), h("td", {}, row.sender), h("td.data", {}, row.data), h("td", {}, row.text, row.error ? h("span.badge.bad", {}, row.error) : null));
      line.dataset.number = row.number;
      this.rows.append(line);
    }
    while (this.rows.children.length > MOST_ROWS) this.rows.firstChild.remove();
    if (atEnd) this.frames.scrollTop = this.frames.scrollHeight;
  }

  async #open(frameNumber) {
    const found = await this.context.act("bus.frame", { segment: this.segment.value, number: frameNumber });
    if (!found) return;
    for (const line of this.rows.children) mark(line, "chosen", line.dataset.number === String(frameNumber));
    this.detail.replaceChildren(
      h("h2", {}, `Frame ${found.id}${found.sender ? ` from ${found.sender}` : ""}`),
      h("p", {}, found.text),
      h("p.note", {}, `${number(found.time_s, 6)} s, ${found.length} bytes: ${found.data || "none"}`),
      ...found.fields.map((one) => this.#field(one)),
    );
  }

  #field(one) {
    const cells = [];
    for (let bit = one.bits - 1; bit >= 0; bit -= 1) {
      const set = one.set.includes(bit);
      const name = one.names[bit] || "";
      cells.push(h(`span.bit${set ? ".set" : ""}`, { title: `bit ${bit}${name ? `: ${name}` : ""} = ${set ? 1 : 0}` }, set ? "1" : "0"));
      if (bit % 4 === 0 && bit) cells.push(h("span.gap"));
    }
    const named = Object.entries(one.names).map(([bit, name]) => {
      const set = one.set.includes(Number(bit));
      return h(`li${set ? ".set" : ""}`, {}, `${bit} ${name}`, h("span.sr", {}, set ? ": 1" : ": 0"));
    });
    return h(
      "div.field-of",
      {},
      h("div.head", {}, h("strong", {}, one.name), h("span.note", {}, `${one.object ? `${one.object}, ` : ""}bits ${one.first} to ${one.first + one.bits - 1}`), h("span.spacer"), h("code", {}, one.hex)),
      h("p", {}, one.text),
      h("div.bits", { ariaHidden: "true" }, ...cells),
      named.length ? h("ul.bit-names", {}, ...named) : null,
    );
  }

  async #objects() {
    if (!this.node.value) {
      this.entries = [];
      return;
    }
    const node = this.node.value;
    try {
      this.entries = await this.context.request("bus.objects", { node });
    } catch (error) {
      toast(error.message, "error");
      return;
    }
    if (node === this.node.value) this.#list();
  }

  #list() {
    const words = this.find.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = this.entries.filter((one) => {
      const all = `${one.object} ${one.name} ${one.type}`.toLowerCase();
      return words.every((word) => all.includes(word));
    });
    text(this.foundObjects, fits.length > SHOWN_OBJECTS ? `${SHOWN_OBJECTS} of ${fits.length} shown: search for the others` : `${fits.length} of ${this.entries.length}`);
    this.lines = new Map();
    const operates = this.context.operates();
    this.objectRows.replaceChildren(
      ...fits.slice(0, SHOWN_OBJECTS).map((one) => {
        const key = `${this.node.value} ${one.index} ${one.sub}`;
        const value = h("td.value-of", {}, this.values.get(key) || "");
        this.lines.set(key, value);
        const read = one.access.includes("r") ? h("button", { type: "button", disabled: !operates, onclick: () => this.#read(one) }, "Read") : null;
        const write = one.access.includes("w") ? h("button", { type: "button", disabled: !operates, onclick: () => this.#write(one) }, "Write \u2026") : null;
        const bounds = one.low !== null && one.high !== null ? `${one.low} to ${one.high}` : "";
        return h("tr", {}, h("td", {}, h("code", {}, one.object)), h("td", {}, one.name, one.note ? h("span.note", {}, ` ${one.note}`) : null), h("td", { title: bounds }, one.type), h("td", {}, one.access), h("td.default-of", {}, String(one.default ?? "")), value, h("td.actions", {}, read, write));
      }),
    );
  }

  #read(one) {
    this.context.act("bus.read", { node: this.node.value, index: one.index, sub: one.sub });
  }

  #write(one) {
    const node = this.node.value;
    const input = h("input", { type: "text", required: true, autocomplete: "off", value: typeof one.default === "number" ? String(one.default) : "" });
    const channel = this.channels.get(node);
    const plain = channel === "SDO" ? "text or bytes in hexadecimal" : "a number";
    const bounds = one.low !== null && one.high !== null ? `${one.low} to ${one.high}${channel === "SDO" ? ", also 0x1F or 1Fh" : ""}` : plain;
    const cancel = h("button", { type: "button", onclick: () => this.confirm.close() }, "Cancel");
    const form = h(
      "form",
      {
        onsubmit: async (event) => {
          event.preventDefault();
          const sent = await this.context.request("bus.write", { node, index: one.index, sub: one.sub, value: input.value }).then(() => true, (error) => (toast(error.message, "error"), false));
          if (sent) this.confirm.close();
        },
      },
      h("h2", {}, `Write ${one.object} of ${node}`),
      h("p", {}, one.name),
      field(`New value (${one.type})`, input, ""),
      h("p.note", {}, `Allowed: ${bounds}. The device gets it at once, by ${channel}.`),
      h("div.row", {}, h("button.primary", { type: "submit" }, "Write"), cancel),
    );
    this.confirm.replaceChildren(form);
    this.confirm.showModal();
    input.select();
  }

  #object(document) {
    const key = `${document.node} ${document.index} ${document.sub}`;
    const shown = document.ok ? document.text : `refused: ${document.text}`;
    this.values.set(key, shown);
    const cell = this.lines.get(key);
    if (cell) {
      text(cell, shown);
      mark(cell, "bad-text", !document.ok);
    }
    const found = this.entries.find((one) => one.index === document.index && one.sub === document.sub);
    const name = `${found?.object ?? document.index} of ${document.node}`;
    if (document.wrote) toast(document.ok ? `${name} is written: ${document.text}` : `${name}: ${document.text}`, document.ok ? "info" : "error");
    else if (!document.ok) toast(`${name}: ${document.text}`, "error");
  }
}

export const view = { name: "bus", title: "Bus", create: (context) => new BusView(context) };
