// Pictures of homings: velocity over position with switches and marks, and the numbered steps.

/** Make the nodes of reports/html/homing.py: [tag, attributes, children]; words become text nodes. */
const drawn = (node) => (typeof node === "string" ? node : s(node[0], node[1], node[2].map(drawn)));

function homingView(homing, index, jump) {
  const svg = drawn(homing.svg);
  svg.setAttribute("aria-labelledby", `homing-title-${index}`);
  svg.setAttribute("aria-describedby", `homing-alt-${index}`);
  const light = (number) => {
    for (const part of $$("[data-step]", figure)) part.classList.toggle("now", number !== null && part.dataset.step === number);
  };
  const rows = homing.rows.map(([number, name, meaning, place, velocity, time, t]) => h("tr", { "data-step": number === "" ? null : String(number), onclick: () => jump(t) },
    h("td", null, number !== "" && h("span.hno", null, String(number))), h("td", null, h("button", { type: "button", title: "Show in the plot" }, name), meaning && h("small", null, meaning)),
    h("td.num", null, place), h("td.num", null, velocity), h("td.num", null, time)));
  const figure = h("details.homing", { open: true },
    h("summary", null, icon(homing.good ? "passed" : "failed"), h("span", null, h("b", { id: `homing-title-${index}` }, homing.title), h("small", null, homing.sub))),
    h("div.homing-body", null, svg, h("p.sr", { id: `homing-alt-${index}` }, homing.alt),
      h("table", null, h("caption.sr", null, "Steps of the homing"),
        h("thead", null, h("tr", null, ["No.", "Step", "Position", "Velocity", "Time"].map((title) => h("th", { scope: "col" }, title)))),
        h("tbody", null, rows))));
  for (const part of $$("[data-step]", figure)) {
    part.addEventListener("pointerenter", () => light(part.dataset.step));
    part.addEventListener("pointerleave", () => light(null));
  }
  return figure;
}
