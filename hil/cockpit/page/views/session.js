// The session: what was done, and the test that it becomes.

import { field, h, number, show, text, toast } from "../dom.js";

class SessionView {
  constructor(context) {
    this.context = context;
    this.count = h("span.note", { role: "status" }, "");
    this.lines = h("tbody", {});
    this.none = h("p.note", {}, "Nothing has been done yet. Commands to axes, faults and written objects are recorded from the start of the bench on.");
    this.table = h("div.scroll", { tabIndex: 0, role: "region", ariaLabel: "Steps" }, h("table.steps", {}, h("thead", {}, h("tr", {}, h("th.right", {}, "No."), h("th.right", {}, "Bench time"), h("th", {}, "Step"))), this.lines));
    this.name = h("input", { type: "text", value: "session", required: true, maxLength: 80, spellcheck: false });
    this.title = h("input.wide", { type: "text", maxLength: 200, placeholder: "made from the faults and alarms" });
    this.notes = h("ul.notes", {});
    this.text = h("pre.code", { tabIndex: 0, role: "region", ariaLabel: "Written test" });
    this.busy = h("p.note", { role: "status" }, "");
    this.save = h("button.operate", { type: "button", onclick: () => this.#save() }, "Save in the working folder");
    this.copy = h("button", { type: "button", onclick: () => this.#copy() }, "Copy");
    this.result = h("div.result", { hidden: true }, this.notes, h("div.row", {}, this.save, this.copy), this.text);
    this.element = h(
      "div.session",
      {},
      h("section.card", {}, h("div.head", {}, h("h2", {}, "What was done"), this.count), this.none, this.table),
      h(
        "section.card",
        {},
        h("h2", {}, "Save as a test"),
        h("p.note.above", {}, "The steps are done again on fresh benches; what holds there is expected: alarms with their time, stops, states, positions."),
        h(
          "form.row",
          { onsubmit: (event) => this.#write(event, "pytest") },
          field("Name", this.name),
          field("Rule that it states", this.title),
          h("button.primary", { type: "submit" }, "Write pytest"),
          h("button", { type: "button", onclick: (event) => this.#write(event, "matrix") }, "Write matrix file"),
        ),
        this.busy,
        this.result,
      ),
    );
    this.known = 0;
    this.asking = false;
  }

  bench() {
    this.known = 0;
    this.lines.replaceChildren();
    text(this.count, "0 steps");
    show(this.none, true);
    show(this.table, false);
    show(this.result, false);
    text(this.busy, "");
  }

  state(state) {
    const session = state.session;
    this.save.disabled = !this.context.operates();
    if (session && session.count > this.known && !this.asking) this.#ask();
  }

  async #ask() {
    this.asking = true;
    try {
      const steps = await this.context.request("session.steps", { since: this.known });
      for (const one of steps) {
        if (one.number <= this.known) continue;
        this.known = one.number;
        this.lines.append(h("tr", {}, h("td.right", {}, String(one.number)), h("td.right", {}, `${number(one.time_s, 3)} s`), h("td", {}, one.text)));
      }
      text(this.count, this.known === 1 ? "1 step" : `${this.known} steps`);
      show(this.none, this.known === 0);
      show(this.table, this.known > 0);
      this.table.scrollTop = this.table.scrollHeight;
    } catch {
      // the bench has gone meanwhile; the next state asks again
    } finally {
      this.asking = false;
    }
  }

  async #write(event, form) {
    event.preventDefault();
    if (!this.name.reportValidity()) return;
    text(this.busy, "Doing the steps again on fresh benches \u2026");
    try {
      await this.context.request("session.hold");
      const fields = { form, name: this.name.value };
      if (this.title.value) fields.title = this.title.value;
      const written = await this.context.request("session.write", fields);
      text(this.text, written.text);
      this.notes.replaceChildren(...written.notes.map((one) => h("li", {}, one)));
      show(this.notes, written.notes.length > 0);
      show(this.result, true);
      text(this.busy, "");
    } catch (error) {
      text(this.busy, "");
      toast(error.message, "error");
    }
  }

  async #save() {
    const path = await this.context.act("session.save", { name: this.name.value });
    if (path) toast(`Saved as ${path}`);
  }

  async #copy() {
    try {
      await navigator.clipboard.writeText(this.text.textContent);
      toast("Copied");
    } catch {
      getSelection().selectAllChildren(this.text);
      toast("Selected: copy it with the keyboard");
    }
  }
}

export const view = { name: "session", title: "Session", create: (context) => new SessionView(context) };
