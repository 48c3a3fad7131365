// The views, in the order of their tabs.

import { view as axis } from "./axis.js";
import { view as bench } from "./bench.js";
import { view as scope } from "./scope.js";

export const views = [bench, axis, scope];
