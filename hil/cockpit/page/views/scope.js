// The scope.

import { h } from "../dom.js";

class ScopeView {
  constructor(context) {
    this.context = context;
    this.element = h("div.scope", {}, h("p.note", {}, "The scope."));
  }
}

export const view = { name: "scope", title: "Scope", create: (context) => new ScopeView(context) };
