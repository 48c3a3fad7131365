// The card of an axis that follows others: gears and cams, what it follows, and how it leaves.

import { field, h, number, show, text, unit } from "./dom.js";

/** A field whose unit changes. */
function united(label, input, unitOf) {
  const element = field(label, input, "");
  element.querySelector(".input").append(unitOf);
  return element;
}

/** Names of the commands that this card gives. */
export const COMMANDS = ["gear", "gear-out", "cam", "cam-out", "phase", "offset"];

export class Following {
  /** `command` carries out a command of the axis: (name, values) => promise. */
  constructor(command) {
    this.command = command;
    this.said = h("output.note", { ariaLabel: "What the axis follows" }, "");
    this.leader = h("select", {});
    this.numerator = this.#number(1);
    this.denominator = this.#number(1);
    this.cam = h("select", {});
    this.place = this.#number(0);
    this.way = this.#number("", false);
    this.shift = this.#number("");
    this.offset = this.#number("");
    this.over = this.#number("");
    this.units = [0, 1, 2, 3, 4].map(() => h("span.unit", {}, ""));
    const [place, way, shift, offset, over] = this.units;
    const value = (input) => Number(input.value);
    this.camForm = this.#form("Engage cam", () => ["cam", [this.leader.value, this.cam.value]], field("Cam", this.cam));
    this.leave = h("button.operate", { type: "submit" }, "Leave");
    this.element = h(
      "section.card.following",
      { hidden: true },
      h("h2", {}, "Gear and cam"),
      this.said,
      h("div.row", {}, field("Leading object", this.leader)),
      this.#form("Engage gear", () => ["gear", [this.leader.value, value(this.numerator), value(this.denominator)]], field("Ratio, numerator", this.numerator), field("denominator", this.denominator)),
      this.camForm,
      h(
        "form",
        { onsubmit: (event) => this.#send(event, () => [`${this.kind}-out`, this.way.value === "" ? [value(this.place)] : [value(this.place), value(this.way)]]) },
        h("div.row", {}, united("Stop at", this.place, place), united("within the leading way", this.way, way), this.leave),
      ),
      this.#form("Shift", () => ["phase", [value(this.shift)]], united("Shift the leading value by", this.shift, shift)),
      this.#form("Shift", () => ["offset", [value(this.offset), value(this.over)]], united("Shift this axis by", this.offset, offset), united("within the leading way", this.over, over)),
    );
    this.kind = "gear";
  }

  #number(value, required = true) {
    return h("input", { type: "number", step: "any", value: String(value), required });
  }

  #form(words, wanted, ...parts) {
    return h("form", { onsubmit: (event) => this.#send(event, wanted) }, h("div.row", {}, ...parts, h("button.operate", { type: "submit" }, words)));
  }

  #send(event, wanted) {
    event.preventDefault();
    this.command(...wanted());
  }

  /** Take up an axis, as it is described; `others` are the descriptions of all axes. */
  begin(found, others) {
    show(this.element, found.leaders.length > 0);
    if (!found.leaders.length) return;
    this.leader.replaceChildren(...found.leaders.map((name) => h("option", { value: name }, name)));
    this.cam.replaceChildren(...(found.cams || []).map((name) => h("option", { value: name }, name)));
    show(this.camForm, (found.cams || []).length > 0);
    this.own = unit(found.units.length);
    this.leading = unit(others[found.leaders[0]]?.units.length ?? "");
    [this.own, this.leading, this.leading, this.own, this.leading].forEach((name, one) => text(this.units[one], name));
  }

  /** Show what the axis `now` follows; `all` are the states of all axes. */
  state(now, all, may) {
    if (this.element.hidden) return;
    const { leader, synchronous } = now;
    if (synchronous) this.kind = synchronous.includes("Cam") ? "cam" : "gear";
    const place = all[leader]?.position;
    const at = place === undefined ? "" : ` at ${number(place, 3)} ${this.leading}`;
    text(this.said, synchronous ? `Follows ${leader ?? "its leading object"}${at}: ${synchronous}.` : "Follows nothing.");
    this.leave.disabled = !may || !synchronous;
  }
}
