// Samples of recorded signals: one subscription for all who want some, and the newest of each in rings.

const KEPT = 1 << 18;

/** Newest samples of one signal: times in s and values, both in order; `gaps` are times before which samples are missing. */
export class Series {
  constructor(times = new Float64Array(4096), values = new Float64Array(4096), length = 0, gaps = []) {
    this.times = times;
    this.values = values;
    this.length = length;
    this.gaps = gaps;
  }

  append(times, values) {
    let size = this.times.length;
    if (this.length + times.length > size) {
      if (size >= 2 * KEPT) this.#drop(this.length - KEPT + times.length);
      while (this.length + times.length > size) size *= 2;
      if (size !== this.times.length) {
        this.times = grown(this.times, size);
        this.values = grown(this.values, size);
      }
    }
    this.times.set(times, this.length);
    this.values.set(values, this.length);
    this.length += times.length;
  }

  #drop(count) {
    const dropped = Math.min(count, this.length);
    this.times.copyWithin(0, dropped, this.length);
    this.values.copyWithin(0, dropped, this.length);
    this.length -= dropped;
    const oldest = this.times[0];
    this.gaps = this.gaps.filter((gap) => gap[1] > oldest);
  }

  /** Number of the first sample not before a time. */
  index(time) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Value at a time: that of the last sample not after it; null before the first one. */
  at(time) {
    const found = this.index(time);
    if (found < this.length && this.times[found] === time) return this.values[found];
    return found > 0 ? this.values[found - 1] : null;
  }

  get last() {
    return this.length ? this.times[this.length - 1] : null;
  }
}

function grown(array, size) {
  const larger = new Float64Array(size);
  larger.set(array);
  return larger;
}

export class Samples {
  constructor(connection) {
    this.connection = connection;
    this.wanted = new Map();
    this.series = new Map();
    this.number = 0;
    this.layout = [];
    this.known = new Set();
    this.listeners = [];
    this.pending = false;
    connection.on("samples", (data) => this.#receive(data));
  }

  /** Take the signals of another bench: what was recorded of the one before is gone. */
  begin(names) {
    this.known = new Set(names);
    this.series.clear();
    this.layout = [];
    this.#subscribe();
  }

  /** Want signals in place of those that the same owner wanted before. */
  want(owner, names) {
    const before = JSON.stringify(this.wanted.get(owner) || []);
    if (before === JSON.stringify(names)) return;
    this.wanted.set(owner, names);
    this.#subscribe();
  }

  /** Samples of a signal; nothing yet is an empty series. */
  of(name) {
    return this.series.get(name) || new Series();
  }

  /** Forget what came so far. */
  clear() {
    this.series.clear();
  }

  #subscribe() {
    if (this.pending) return;
    this.pending = true;
    queueMicrotask(async () => {
      this.pending = false;
      const signals = [...new Set([...this.wanted.values()].flat())].filter((one) => this.known.has(one));
      const number = (this.number = (this.number + 1) & 0xffff);
      if (!this.connection.connected) return;
      try {
        const layout = await this.connection.request("scope.subscribe", { signals, number, back_s: 30 });
        if (number !== this.number) return;
        this.layout = layout;
        for (const name of this.series.keys()) if (!signals.includes(name)) this.series.delete(name);
        const early = this.early || [];
        this.early = [];
        for (const data of early) this.#receive(data);
      } catch (error) {
        console.debug(error.message);
      }
    });
  }

  #receive(data) {
    const head = new DataView(data);
    if (head.getUint8(0) !== 1 || head.getUint16(2, true) !== this.number) return;
    const rows = head.getUint32(4, true);
    const names = this.layout[head.getUint32(8, true)];
    if (!names) {
      (this.early = this.early || []).push(data);
      return;
    }
    const times = new Float64Array(data, 16, rows);
    const missing = head.getUint8(1) & 1;
    names.forEach((name, column) => {
      let series = this.series.get(name);
      if (!series) this.series.set(name, (series = new Series()));
      const values = new Float64Array(data, 16 + 8 * rows * (column + 1), rows);
      // After another subscription what is here already comes once more.
      const last = series.last;
      let from = 0;
      if (last !== null) while (from < rows && times[from] <= last) from++;
      if (missing && last !== null && from === 0) series.gaps.push([last, times[0]]);
      series.append(from ? times.subarray(from) : times, from ? values.subarray(from) : values);
    });
  }
}
