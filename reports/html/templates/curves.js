// Pictures over the leading value: followers with their phases; cams, the function and its derivatives.

function camView(cam, index) {
  const svg = drawn(cam.svg);
  svg.setAttribute("aria-labelledby", `cam-title-${index}`);
  svg.setAttribute("aria-describedby", `cam-alt-${index}`);
  return h("details.homing", { open: true },
    h("summary", null, h("span", null, h("b", { id: `cam-title-${index}` }, cam.title), h("small", null, cam.sub))),
    h("div.homing-body", null, svg, h("p.sr", { id: `cam-alt-${index}` }, cam.alt)));
}
