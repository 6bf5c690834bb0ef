"use strict";
// What was clicked: a bead or a travel, when and by whom, what it waited for and what waits for it.
(() => {
  const MOST = 12; // buttons of each list at first
  const WHY = ["", "lies on it or beside it", "slicer's order", "machine state", "walls first",
    "not too many layers ahead", "priming", "touches it"];
  const ACTS = ["prints", "travels", "goes aside", "waits"];

  let scene = null;
  let followers = null; // of each contour: {offsets, after, kinds}
  let found = null;

  /** The graph turned round: what each contour is waited for by. */
  function turned({ offsets, preds, kinds }) {
    const n = offsets.length - 1;
    const first = new Uint32Array(n + 1);
    for (const a of preds) first[a + 1]++;
    for (let k = 0; k < n; k++) first[k + 1] += first[k];
    const next = first.slice();
    const [after, why] = [new Uint32Array(preds.length), new Uint8Array(preds.length)];
    for (let c = 0; c < n; c++) {
      for (let k = offsets[c]; k < offsets[c + 1]; k++) {
        after[next[preds[k]]] = c;
        why[next[preds[k]]++] = kinds[k];
      }
    }
    return { offsets: first, preds: after, kinds: why };
  }

  const printing = (of, plan, c) => {
    const { head, action } = of.by[plan];
    return head[c] < 0 ? null : { plan, head: head[c], action: action[c] };
  };

  function rowsOf(of, graph, plan, c) {
    const rows = [];
    for (let k = graph.offsets[c]; k < graph.offsets[c + 1]; k++) {
      const at = printing(of, plan, graph.preds[k]);
      if (at) rows.push({ ...at, contour: graph.preds[k], why: WHY[graph.kinds[k]] || "" });
    }
    return rows;
  }

  /** Contours that had to come first, and those that have to come after: actions of the plan. */
  function neighbours(of, { plan, head, action }) {
    const { graph } = of.page;
    const c = of.page.plans[plan].heads[head].contour[action];
    if (!graph || c < 0) return { before: [], after: [] };
    followers ??= turned(graph);
    const end = (at) => of.page.plans[plan].heads[at.head].end[at.action];
    return {
      before: rowsOf(of, graph, plan, c).sort((a, b) => end(b) - end(a)),
      after: rowsOf(of, followers, plan, c).sort((a, b) => end(a) - end(b)),
    };
  }

  const headOf = ({ plan, head }) => scene.page.plans[plan].heads[head];
  const fact = (name, value) => [D.element("dt", {}, name), D.element("dd", {}, value)];

  /** "head left"; the only head of a machine is often called just that. */
  const named = ({ name }) => (/^head\b/i.test(name) ? name : `head ${name}`);

  const lasting = (s) => (s < 1 ? `${s.toFixed(2)} s` : D.format.duration(s));

  function lengthOf(at) {
    const { x, y, z } = D.path(scene.page, headOf(at), at.action);
    let mm = 0;
    for (let k = 1; k < x.length; k++) mm += Math.hypot(x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]);
    return mm;
  }

  function title(at) {
    const head = headOf(at);
    const c = head.contour[at.action];
    const kind = head.kind[at.action];
    if (kind !== 0) return ["Print", "Travel", "Stepping aside", "Wait"][kind];
    return `Bead ${c}: ${scene.page.roles[scene.page.contours.role[c]]}`;
  }

  function factsOf(at) {
    const head = headOf(at);
    const { contours, plans } = scene.page;
    const c = head.contour[at.action];
    const [begin, end] = [head.begin[at.action], head.end[at.action]];
    const clock = D.format.clock;
    const rows = [
      ...fact("when", `${clock(begin)} to ${clock(end)} (${lasting(end - begin)}), ${plans[at.plan].label}`),
      ...fact("by", `${named(head)}, its action ${at.action + 1} of ${head.n}`),
      ...fact("length", D.format.mm(lengthOf(at))),
    ];
    if (head.kind[at.action] === 0) {
      rows.unshift(...fact("layer", `${contours.layer[c] + 1}`),
        ...fact("line", contours.line[c] > 0 ? `${contours.line[c]} of the source` : "none"));
      rows.push(...fact("tool", `${contours.tool[c]}`), ...pieceOf(c));
      const other = printing(scene, 1 - at.plan, c);
      if (other) rows.push(...fact(plans[1 - at.plan].label, goTo(other, `${clock(headOf(other).begin[other.action])}, ${named(headOf(other))}`)));
    } else if (head.flags[at.action]) rows.push(...fact("change", changeOf(at, head.flags[at.action])));
    return D.element("dl", {}, ...rows);
  }

  /** Which piece of which contour a bead is, where that is cut. */
  function pieceOf(c) {
    const of = scene.page.cuts?.of;
    if (!of) return [];
    let [first, last] = [c, c];
    while (of[first - 1] === of[c]) first--;
    while (of[last + 1] === of[c]) last++;
    if (first === last) return fact("piece", "this contour is whole");
    return fact("piece", `${c - first + 1} of ${last - first + 1} of the source's contour ${of[c]}`);
  }

  /** Cuts at which a bead meets other pieces: [{other, age}], the oldest weld first. */
  function cutsOf(c) {
    const { cuts } = scene.page;
    const found = [];
    for (let k = 0; cuts && k < cuts.age.length; k++) {
      if (cuts.before[k] === c) found.push({ other: cuts.after[k], age: cuts.age[k] });
      else if (cuts.after[k] === c) found.push({ other: cuts.before[k], age: cuts.age[k] });
    }
    return found.sort((a, b) => b.age - a.age);
  }

  /** "bead 12, left: printed on to 12 s later". */
  function cutLine({ other, age }, at) {
    const to = printing(scene, 1, other);
    const { begin } = scene.page.plans[1].heads[at.head];
    if (!to) return null;
    const later = headOf(to).begin[to.action] > begin[at.action];
    const weld = age === 0 ? "in one go" : `${lasting(age)} ${later ? "later" : "earlier"}`;
    return D.element("li", {}, goTo(to, `bead ${other}`), `, ${named(headOf(to))}: ${weld}`);
  }

  function cutList(at, c) {
    const found = at.plan === 1 ? cutsOf(c) : [];
    if (!found.length) return [];
    const lines = found.slice(0, MOST).map((each) => cutLine(each, at)).filter(Boolean);
    const more = found.length > MOST ? ` (the oldest ${MOST} welds)` : "";
    return [D.element("h3", {}, `Cut at ${D.format.count(found.length, "place")}, where the other piece is printed${more}`),
      D.element("ul", { class: "view-list" }, ...lines)];
  }

  function changeOf({ plan }, flags) {
    const words = [];
    if (flags & D.changes.OTHER) words.push(plan === 0 ? "gone in the plan" : "new in the plan");
    if (flags & D.changes.OVER_WALL) words.push("crosses an outer wall");
    return words.join(", ");
  }

  /** A button that selects an action and goes to its time. */
  function goTo(at, text) {
    const button = D.element("button", { type: "button", class: "link" }, text);
    button.addEventListener("click", () => go(at));
    return button;
  }

  /** Select an action, with its layer shown and its time not cut off. */
  function go({ plan, head, action }) {
    const state = D.state.get();
    const change = { selected: { plan, head, action } };
    const of = scene.page.plans[plan].heads[head];
    const c = of.contour[action];
    if (c >= 0) {
      const layer = scene.page.contours.layer[c];
      const [low, high] = state.layers;
      if (layer < low || layer > high) change.layers = [Math.min(low, layer), Math.max(high, layer)];
    }
    if (state.time < of.end[action]) change.time = of.end[action];
    if (state.plans !== "both" && (state.plans === "before") !== (plan === 0)) change.plans = plan ? "after" : "before";
    D.state.set(change);
  }

  const mark = (name) => D.element("i", { style: `--c:var(${name})`, "aria-hidden": "true" });

  function list(heading, none, rows, colour) {
    const made = D.element("div", {}, D.element("h3", {}, mark(colour), `${heading} (${rows.length})`));
    if (!rows.length) made.append(D.element("p", { class: "muted" }, none));
    const all = D.element("ul", { class: "view-list" });
    const show = (from, to) => rows.slice(from, to).forEach((row) => all.append(item(row)));
    show(0, MOST);
    made.append(all);
    if (rows.length > MOST) {
      const more = D.element("button", { type: "button" }, `${rows.length - MOST} more`);
      more.addEventListener("click", () => { show(MOST, rows.length); more.remove(); });
      made.append(more);
    }
    return made;
  }

  function item(row) {
    const head = headOf(row);
    const { roles, contours } = scene.page;
    const text = `bead ${row.contour}, ${roles[contours.role[row.contour]]}, layer ${contours.layer[row.contour] + 1}`;
    const when = `${D.format.clock(head.begin[row.action])} to ${D.format.clock(head.end[row.action])}, ${head.name}`;
    return D.element("li", {}, goTo(row, text), ` ${when}${row.why ? `: ${row.why}` : ""}`);
  }

  /** Waits of the plan in which the action is waited for, or which end with it. */
  function waitsOf({ plan, head, action }) {
    if (plan !== 1) return [];
    return scene.page.waits.filter((w) => (w.head === head && w.action === action)
      || (w.other_head === head && w.other_action === action));
  }

  function waitLine(wait, at) {
    const heads = scene.page.plans[1].heads;
    const long = lasting(wait.end_s - wait.begin_s);
    const why = D.words?.long(wait.cause) ?? wait.cause;
    if (wait.head === at.head && wait.action === at.action) {
      const text = `${heads[wait.head].name} waited ${long} for this: ${why}`;
      const button = wait.other_action === null ? "" : goTo(
        { plan: 1, head: wait.other_head, action: wait.other_action }, `${heads[wait.other_head].name}'s action ${wait.other_action + 1}`);
      return D.element("li", {}, `Before it ${text}. `, button);
    }
    const target = wait.action === null ? "" : goTo({ plan: 1, head: wait.head, action: wait.action },
      `${heads[wait.head].name}'s action ${wait.action + 1}`);
    return D.element("li", {}, `${heads[wait.head].name} waits ${long} until this is done: ${why}. `, target);
  }

  function render() {
    const at = D.state.get().selected;
    if (!at || !headOf(at)) {
      found.replaceChildren(D.element("p", { class: "muted" },
        "Nothing is selected. Click a bead or a travel, or give a bead's number."));
      return;
    }
    const head = headOf(at);
    const children = [D.element("h3", { class: "view-title" }, mark("--chosen"), title(at)), factsOf(at)];
    const waits = waitsOf(at);
    if (waits.length) children.push(D.element("ul", { class: "view-list" }, ...waits.slice(0, 20).map((w) => waitLine(w, at))));
    if (head.kind[at.action] === 0) children.push(...cutList(at, head.contour[at.action]));
    if (head.kind[at.action] === 0 && scene.page.graph) {
      const { before, after } = neighbours(scene, at);
      children.push(D.element("div", { class: "view-columns" },
        list("Had to wait for", "Nothing: it could be printed at once.", before, "--bad"),
        list("Waits for it", "Nothing waits for it.", after, "--good")));
    }
    found.replaceChildren(...children);
  }

  /** Select the action so many steps before or after the selected one of its head. */
  function step(by) {
    const at = D.state.get().selected ?? { plan: D.state.get().plans === "before" ? 0 : 1, head: 0, action: -1 };
    const action = at.action + by;
    if (action >= 0 && action < headOf(at).n) go({ ...at, action });
  }

  function search(text, line) {
    const c = Number(text);
    const plan = D.state.get().plans === "before" ? 0 : 1;
    const known = text.trim() !== "" && Number.isInteger(c) && c >= 0 && c < scene.page.contours.n;
    const at = known ? printing(scene, plan, c) : null;
    line.textContent = at ? "" : `There is no bead ${text}: they are numbered from 0 to ${scene.page.contours.n - 1}.`;
    if (at) go(at);
  }

  function show(of) {
    scene = of;
    const box = document.getElementById("selected");
    const field = D.element("input", { id: "selected-number", type: "text", inputmode: "numeric", size: 8 });
    const line = D.element("span", { class: "warning", role: "status" });
    const button = (text, name, act) => {
      const made = D.element("button", { type: "button", id: name }, text);
      made.addEventListener("click", act);
      return made;
    };
    const form = D.element("form", { class: "view-row" },
      D.element("label", { for: "selected-number" }, "Bead number"), field,
      D.element("button", { type: "submit", id: "selected-go" }, "Go"),
      button("Step back", "selected-back", () => step(-1)), button("Step on", "selected-on", () => step(1)),
      button("Go near", "selected-near", () => D.view.closer()),
      button("Select nothing", "selected-none", () => D.state.set({ selected: null })), line);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      search(field.value, line);
    });
    found = D.element("div", { id: "selected-facts", "aria-live": "polite" });
    box.replaceChildren(D.element("h2", {}, "Selected"), D.element("div", { class: "panel" }, form, found));
    box.removeAttribute("aria-live");
    D.state.on((now, was) => { if (now.selected !== was.selected) render(); });
    render();
  }

  D.selected = { show, neighbours, step, go };
})();
