// The views, in the order of their tabs.

import { view as axis } from "./axis.js";
import { view as bench } from "./bench.js";
import { view as bus } from "./bus.js";
import { view as faults } from "./faults.js";
import { view as scope } from "./scope.js";
import { view as session } from "./session.js";

export const views = [bench, axis, scope, faults, bus, session];
