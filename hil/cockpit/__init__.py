"""The cockpit: a bench in the browser (`hil cockpit`). It needs the extra `cockpit`.

Threads: the loop of the server takes messages from the pages and sends what is for them; the bench has a
thread of its own (`machine.Machine`), and nothing else touches it. A message is read and checked by the
server, carried out in the thread of the bench between two slices of bench time, and answered.

    browser page  <-- one WebSocket -->  server.Pages  -->  machine.Machine (thread)  -->  panes  -->  bench
    page/*.js         JSON, binary       client.Client <--  state, events, samples

What goes over the WebSocket:

* page to server, JSON: `{"kind": "axis.jog", "id": 7, ...}`. Every request gets a reply `{"kind":
  "reply", "id": 7, "ok": true, "value": ...}` or `{"ok": false, "error": "..."}`. `{"kind":"life","at":123}`,
  ten times a second from the page in control, is the sign of life, with `at` of the newest state.
* server to page, JSON: `bench` (the description of every pane; at the beginning and whenever another
  bench is up or has failed), `state` (the state of every pane, ten times a second, the newest only), and
  what a pane broadcasts, such as `events`.
* server to page, binary: samples; the first byte is the kind of the frame (`panes/scope.py`).

How to add a pane:

1. On the server: a module in `panes/` with a subclass of `pane.Pane`. `name` is its key in `bench` and
   `state`. Each message is a subclass of `messages.Message` with `kind: Literal["subject.verb"]` and
   fields with ranges; `operates = False` where those who watch may send it, too; `aside = True` where it
   takes long and does not touch the bench. `handlers` names what
   carries each out: it gets message and client, in the thread of the bench, must not wait, raises a
   `HilError` with a sentence where it cannot, and returns the value of the reply. `begin` and `end`
   bracket the life of a bench, `pulse` comes after every slice of time, `description` and `state` are
   JSON. It gets what it needs in its constructor; `assembly.cockpit` makes it and puts it into the list.
2. On the page: a module in `page/views/` that exports `view = {name, title, create(context)}`, and a line
   in `page/views/index.js`. `create` returns an object with `element` and, where wanted,
   `bench(description)`, `state(state)`, `events(list)` and `shown(visible)`. `context.request(kind,
   fields)` returns a promise of the value; `context.samples` subscribes signals; `page/dom.js` makes
   elements. No inline style or script: the content security policy refuses them.
3. To follow what operators do: append a function to `Machine.carried_out`; it gets client, message and
   bench time.
"""
