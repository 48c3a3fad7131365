// The trigger of the scope: a level that a signal crosses, or an event; with what was before it.

/** Finds the moment from which a window is kept. */
export class Trigger {
  constructor() {
    this.kind = "level";
    this.signal = "";
    this.level = 0;
    this.edge = "rising";
    this.event = "alarm.raised";
    this.before = 0.2;
    this.since = null;
    this.at = null;
  }

  /** Look from a time on for the next moment. */
  arm(time) {
    this.since = time;
    this.at = null;
  }

  /** Look for a crossing in new samples; returns whether the moment is known. */
  look(series) {
    if (this.at !== null || this.kind !== "level" || this.since === null || !series.length) return this.at !== null;
    let place = Math.max(1, series.index(this.since));
    for (; place < series.length; place++) {
      const before = series.values[place - 1];
      const now = series.values[place];
      const rises = before < this.level && now >= this.level;
      const falls = before > this.level && now <= this.level;
      if ((rises && this.edge !== "falling") || (falls && this.edge !== "rising")) {
        this.at = series.times[place];
        return true;
      }
    }
    this.since = series.times[series.length - 1];
    return false;
  }

  /** Look at an event; returns whether the moment is known. */
  hear(time, kind) {
    if (this.at === null && this.kind === "event" && this.since !== null && time >= this.since && kind === this.event) this.at = time;
    return this.at !== null;
  }

  /** The window around the moment: [from, to]. */
  window(length) {
    const from = this.at - this.before * length;
    return [from, from + length];
  }
}
