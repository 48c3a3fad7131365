// The picture of a homing: velocity over position, switches and zero marks, and its steps.

import { drawn, h, show } from "./dom.js";

const EVERY_MS = 500;

export class Homing {
  constructor(context) {
    this.context = context;
    this.body = h("div.homing-body", {});
    this.title = h("h2", {}, "Homing");
    this.sub = h("p.note", {});
    this.element = h("section.card.homing", { hidden: true }, this.title, this.sub, this.body);
  }

  /** Show another axis: its last homing, if there is one. */
  begin(axis) {
    this.axis = axis;
    this.running = false;
    show(this.element, false);
    if (axis) this.#fetch();
  }

  /** Follow a homing as it goes on, and once more when it has ended. */
  state(homing) {
    if (!this.axis || (!homing && !this.running)) return;
    const now = performance.now();
    if (homing && this.running && now - this.asked < EVERY_MS) return;
    this.running = homing;
    this.asked = now;
    this.#fetch();
  }

  async #fetch() {
    const axis = this.axis;
    const found = await this.context.request("axis.homing", { axis }).catch(() => null);
    if (axis !== this.axis) return;
    show(this.element, Boolean(found));
    if (!found) return;
    this.title.textContent = `Homing: ${found.title}`;
    this.sub.textContent = found.sub;
    const picture = drawn(found.svg);
    picture.setAttribute("aria-label", found.alt);
    const heads = ["No.", "Step", "Position", "Velocity", "Time"].map((one, place) => h(place > 1 ? "th.right" : "th", { scope: "col" }, one));
    const rows = found.rows.map(([place, name, meaning, position, velocity, time]) =>
      h("tr", {}, h("td", {}, String(place)), h("td", {}, h("strong", {}, name), " ", h("span.note", {}, meaning)), h("td.right", {}, position), h("td.right", {}, velocity), h("td.right", {}, time)),
    );
    this.body.replaceChildren(picture, h("table", {}, h("thead", {}, h("tr", {}, ...heads)), h("tbody", {}, ...rows)));
  }
}
