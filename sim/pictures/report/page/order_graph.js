"use strict";
/* The paper's graph, on request: which bead must come before which, by what rule, layer by layer. */
(() => {
  const NAMES = ["", "geometry: it would be blocked, or lies on it", "process: the slicer's order of walls and fill",
    "state: tool, or what the machine is set to", "quality: shells and what is anchored in them",
    "layers: not too many layers ahead", "priming of the nozzle", "contact: it touches what is there"];
  const DASHES = [[], [], [6, 3], [2, 3], [10, 3, 2, 3], [1, 4], [4, 2, 1, 2], [8, 6]];
  const COLOURS = ["", "--head0", "--head1", "--head2", "--head3", "--head4", "--head5", "--head6"];
  const HEIGHT = 420, MARGIN = 14, ROWS = 300;
  let page, canvas, number, said, below, placed = [], list, layers;

  const layer = () => Math.min(Math.max(Math.round(Number(number.value)) || 1, 1), layers + 1) - 1;

  /** Beads of a layer. */
  const beadsOf = (shown) => {
    const found = [];
    page.contours.layer.forEach((at, c) => { if (at === shown) found.push(c); });
    return found;
  };

  /** Edges [pred, bead, kind] that end at beads of a layer; from other layers only if asked. */
  function edgesOf(beads, all) {
    const { offsets, preds, kinds } = page.graph, own = new Set(beads), found = [];
    for (const bead of beads) {
      for (let i = offsets[bead]; i < offsets[bead + 1]; i++) {
        if (all || own.has(preds[i])) found.push([preds[i], bead, kinds[i]]);
      }
    }
    return found;
  }

  /** A point in the middle of a bead's path, mm: beads around one another keep theirs apart. */
  function middle(bead) {
    const { offsets, x, y } = page.contours, i = (offsets[bead] + offsets[bead + 1]) >> 1;
    return [x[i], y[i]];
  }

  function fitted(beads, wide) {
    const { offsets, x, y } = page.contours;
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const bead of beads) {
      for (let i = offsets[bead]; i < offsets[bead + 1]; i++) {
        left = Math.min(left, x[i]); right = Math.max(right, x[i]);
        low = Math.min(low, y[i]); high = Math.max(high, y[i]);
      }
    }
    const scale = Math.min((wide - 2 * MARGIN) / Math.max(1, right - left), (HEIGHT - 2 * MARGIN) / Math.max(1, high - low));
    const across = (wide - scale * (right - left)) / 2, up = (HEIGHT - scale * (high - low)) / 2;
    return ([px, py]) => [across + (px - left) * scale, HEIGHT - up - (py - low) * scale];
  }

  function drawBeads(context, beads, at) {
    const { offsets, x, y } = page.contours;
    context.strokeStyle = D.colour("--line");
    context.lineWidth = 1;
    context.beginPath();
    for (const bead of beads) {
      for (let i = offsets[bead]; i < offsets[bead + 1]; i++) {
        const [px, py] = at([x[i], y[i]]);
        if (i === offsets[bead]) context.moveTo(px, py); else context.lineTo(px, py);
      }
    }
    context.stroke();
  }

  function drawArrow(context, [ax, ay], [bx, by]) {
    const long = Math.hypot(bx - ax, by - ay);
    if (long < 3) return;
    const ux = (bx - ax) / long, uy = (by - ay) / long;
    context.beginPath();
    context.moveTo(ax, ay);
    context.lineTo(bx, by);
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    context.moveTo(bx - 4 * ux, by - 4 * uy);
    context.lineTo(bx - 10 * ux - 4 * uy, by - 10 * uy + 4 * ux);
    context.lineTo(bx - 10 * ux + 4 * uy, by - 10 * uy - 4 * ux);
    context.fill();
  }

  function draw() {
    const beads = beadsOf(layer()), edges = edgesOf(beads, below.checked);
    const ratio = window.devicePixelRatio || 1, wide = Math.max(260, canvas.parentElement.clientWidth);
    canvas.width = wide * ratio;
    canvas.height = HEIGHT * ratio;
    canvas.style.width = `${wide}px`;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const at = fitted(beads, wide), centre = new Map();
    const place = (bead) => centre.get(bead) || centre.set(bead, at(middle(bead))).get(bead);
    drawBeads(context, beads, at);
    for (const [pred, bead, kind] of edges) {
      context.strokeStyle = context.fillStyle = D.colour(COLOURS[kind]);
      context.lineWidth = 1.3;
      context.setLineDash(DASHES[kind]);
      drawArrow(context, place(pred), place(bead));
    }
    placed = beads.map((bead) => [bead, ...place(bead)]);
    drawNodes(context);
    tell(beads, edges);
  }

  function drawNodes(context) {
    context.font = "11px system-ui, sans-serif";
    for (const [bead, x, y] of placed) {
      context.fillStyle = D.colour("--fg");
      context.beginPath();
      context.arc(x, y, 3, 0, 2 * Math.PI);
      context.fill();
      if (placed.length <= 60) context.fillText(bead, x + 5, y - 4);
    }
  }

  const many = (n, what) => `${D.format.number(n)} ${what}${n === 1 ? "" : "s"}`;

  function tell(beads, edges) {
    const counts = new Map();
    for (const [, , kind] of edges) counts.set(kind, (counts.get(kind) || 0) + 1);
    const waiting = new Set(edges.map(([, bead]) => bead));
    const free = beads.length - waiting.size;
    said.textContent = `Layer ${layer() + 1}: ${many(beads.length, "bead")}, ${many(edges.length, "rule")}; ${free === 1 ? "1 bead waits" : `${many(free, "bead")} wait`} for none.`;
    list.replaceChildren(...[...counts].sort((a, b) => b[1] - a[1]).map(([kind, n]) =>
      D.element("li", {}, swatch(kind), `${NAMES[kind]} (${D.format.number(n)})`)));
  }

  function swatch(kind) {
    const made = D.element("canvas", { width: 34, height: 14, "aria-hidden": "true" }), context = made.getContext("2d");
    context.strokeStyle = D.colour(COLOURS[kind]);
    context.lineWidth = 2;
    context.setLineDash(DASHES[kind]);
    context.beginPath();
    context.moveTo(0, 7);
    context.lineTo(34, 7);
    context.stroke();
    return made;
  }

  /** The action that prints a bead in the plan. */
  function actionOf(bead) {
    const { heads } = page.plans[1];
    for (let head = 0; head < heads.length; head++) {
      const action = heads[head].contour.indexOf(bead);
      if (action >= 0) return { plan: 1, head, action };
    }
    return null;
  }

  function pick(event) {
    const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    const near = placed.map(([bead, px, py]) => [Math.hypot(px - x, py - y), bead]).sort((a, b) => a[0] - b[0])[0];
    if (near && near[0] < 20) D.state.set({ selected: actionOf(near[1]) });
  }

  function table() {
    const beads = beadsOf(layer());
    const rows = edgesOf(beads, below.checked).slice(0, ROWS).map(([pred, bead, kind]) => [`bead ${pred}`, `bead ${bead}`, NAMES[kind]]);
    return D.table(`Rules of layer ${layer() + 1}${rows.length === ROWS ? `, the first ${ROWS}` : ""}`, ["first", "then", "why"], rows);
  }

  function made() {
    const e = D.element;
    layers = page.contours.layer.reduce((most, at) => Math.max(most, at), 0);
    number = e("input", { type: "number", min: 1, max: layers + 1, value: Math.min(2, layers + 1) });
    below = e("input", { type: "checkbox" });
    canvas = e("canvas", { role: "img", "aria-label": "Beads of the layer from above, with an arrow from each to those that must come later", onclick: pick });
    said = e("p", { "aria-live": "polite" });
    list = e("ul", { class: "legend" });
    const rules = e("div", {});
    const again = () => { draw(); rules.replaceChildren(D.folded("These rules as a table", table)); };
    number.addEventListener("input", again);
    below.addEventListener("change", again);
    D.state.on((now, was) => { if (now.theme !== was.theme) draw(); });
    const box = e("div", {}, e("div", { class: "bar" }, e("label", {}, `layer (1 to ${layers + 1}) `, number), e("label", {}, below, " rules from other layers too")),
      said, list, e("div", {}, canvas), rules);
    requestAnimationFrame(again);
    return box;
  }

  D.orderGraph = {
    folded: (from) => { page = from; return D.folded("The graph of what must come before what", made); },
  };
})();
