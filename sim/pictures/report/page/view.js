"use strict";
// The 3-D view: the print before and after, drawn when something changes.
(() => {
  const STILL_MS = 160; // after which a view that moved is drawn whole
  const SHARP = 2; // a still picture is drawn so much finer than the screen, each way: smooth edges

  const MOST = 40; // beads shown that the selected one waited for, and that wait for it
  const BESIDE_PX = 620; // two pictures stand side by side in so wide a view, else one above the other

  const view = {
    camera: D.camera.make(), reach: 1000, fitted: true, heads: [], marks: [], bed: null, ground: [0, 0, 0],
  };
  let [scene, painter, regl, canvas, labels, parts] = [];
  let [asked, moving, stillTimer, lastTick] = [false, false, 0, 0];
  let whole = null; // a still picture in the making
  const settled = []; // who waits for it
  let picking = false; // what is selected was clicked in the view

  /** Which plans are drawn where: [{plan, left, top, width, height}] in CSS px, and `box` in pixels. */
  function panes(ratio = window.devicePixelRatio || 1) {
    const { plans } = D.state.get();
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const shown = plans === "both" ? [0, 1] : [plans === "before" ? 0 : 1];
    const beside = width >= BESIDE_PX;
    return shown.map((plan, k) => {
      const split = shown.length === 2;
      const w = split && beside ? width / 2 : width;
      const h = split && !beside ? height / 2 : height;
      const [left, top] = [split && beside ? k * w : 0, split && !beside ? k * h : 0];
      const px = (v) => Math.round(v * ratio);
      const box = { x: px(left), y: px(height - top - h), width: px(w), height: px(h) };
      return { plan, left, top, width: w, height: h, box, ratio };
    });
  }

  /** Draw with the next picture; a view that `moves` may be drawn roughly at first. */
  function redraw(moves = false) {
    if (!painter) return;
    whole = null;
    if (moves) {
      moving = true;
      clearTimeout(stillTimer);
      stillTimer = setTimeout(() => { moving = false; redraw(); }, STILL_MS);
    }
    ask();
  }

  function ask() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(draw);
  }

  function draw(at) {
    asked = false;
    const playing = D.state.get().playing;
    if (playing) advance(at);
    const roughly = moving || D.state.get().playing;
    if (roughly && lastTick) painter.learn(at - lastTick);
    lastTick = roughly ? at : 0;
    if (roughly) picture();
    else if (step()) ask();
    if (D.state.get().playing) redraw();
    else if (playing) redraw(true);
  }

  function sized() {
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [canvas.clientWidth, canvas.clientHeight].map((v) => Math.max(1, Math.round(v * ratio)));
    if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    const most = regl.limits.maxTextureSize / Math.max(w, h);
    return { ratio, w, h, finer: Math.min(most, ratio < 1.5 ? SHARP : 1.5) };
  }

  /** Draw what a moving view shows. */
  function picture() {
    sized();
    const state = D.state.get();
    view.heads = headsAt(state);
    painter.quick(view, panes(), state);
    write(panes(), state);
  }

  /** Draw some more of a still picture; false: it is done. */
  function step() {
    const state = D.state.get();
    if (!whole) {
      const { ratio, w, h, finer } = sized();
      view.heads = headsAt(state);
      whole = painter.whole(view, panes(ratio * finer), state, Math.round(w * finer), Math.round(h * finer));
    }
    if (!whole.next().done) return true;
    whole = null;
    write(panes(), state);
    settled.splice(0).forEach((tell) => tell());
    return false;
  }

  /** Where each head of each plan stands; none when the print is done and they need not be seen. */
  function headsAt(state) {
    const { page } = scene;
    const end = Math.max(...page.plans.map((plan) => plan.end_s));
    if (state.time >= end && !state.playing) return [];
    return page.plans.map((plan, p) => plan.heads.map((head, h) => ({
      ...D.bodies.placeAt(page, head, state.time), name: head.name, rgb: D.tints.headRgb(scene, p, h),
    })));
  }

  /** Words over the picture: which plan, how far, names of heads, and how much is drawn. */
  function write(now, state) {
    const { page } = scene;
    const made = [];
    for (const pane of now) {
      const plan = page.plans[pane.plan];
      const at = Math.min(state.time, plan.end_s);
      const text = state.time >= plan.end_s ? `done at ${D.format.clock(plan.end_s)}` : D.format.clock(at);
      made.push(label("pane", `${plan.label}: ${text}`, pane.left + 10, pane.top + 8));
      const heads = (view.heads[pane.plan] ?? []).filter(({ at: place }) => place);
      const words = [...heads.map(({ name, at: place }) => ["head", name, place]), ["bed", "front", view.front]];
      if (state.selected?.plan === pane.plan && view.chosen) words.push(["chosen", "selected", view.chosen]);
      for (const [kind, word, place] of words) {
        const [x, y] = D.camera.project(view.camera, D.camera.basis(view.camera), place);
        const inside = Math.abs(x) < pane.width / 2 - 30 && Math.abs(y) < pane.height / 2 - 20;
        if (inside) made.push(label(kind, word, pane.left + pane.width / 2 + x, pane.top + pane.height / 2 + y));
      }
    }
    if (now.length === 2) made.push(D.element("i", { class: now[1].left ? "view-split" : "view-split level" }));
    labels.replaceChildren(...made);
    parts.drawn.textContent = painter.coarse
      ? `Drawn roughly while it moves: ${D.format.number(painter.drawn)} of ${D.format.number(painter.of)} lines.`
      : `All ${D.format.number(painter.drawn)} lines of these layers are drawn.`;
  }

  const label = (kind, text, left, top) => (
    D.element("span", { class: `view-${kind}`, style: `left:${left}px;top:${top}px` }, text));

  function advance(at) {
    const state = D.state.get();
    const end = Math.max(...scene.page.plans.map((plan) => plan.end_s));
    const passed = lastTick ? Math.min(0.5, (at - lastTick) / 1000) : 0;
    const time = Math.min(end, state.time + passed * state.speed);
    D.state.set({ time, playing: time < end });
  }

  let legend = null;

  /** Give everything the colours of the state and of light or dark. */
  function recolour() {
    legend = D.tints.apply(scene, painter, view);
    markCuts();
    select();
  }

  // Selection ---------------------------------------------------------------------------------

  /** Points of an action as [[x, y, z] ...]. */
  function pointsOf({ plan, head, action }) {
    const { x, y, z } = D.path(scene.page, scene.page.plans[plan].heads[head], action);
    return Array.from(x, (v, k) => [v, y[k], z[k]]);
  }

  function select() {
    const { selected } = D.state.get();
    view.chosen = null;
    if (!selected) {
      painter.overlay([], []);
      tell([]);
      return;
    }
    const points = pointsOf(selected);
    view.chosen = points[points.length >> 1] ?? null;
    const [chosen, first, last] = ["--chosen", "--bad", "--good"].map(D.colours.named);
    const near = D.selected.neighbours(scene, selected);
    const lines = [
      ...near.before.slice(0, MOST).map((at) => ({ points: pointsOf(at), rgb: first })),
      ...near.after.slice(0, MOST).map((at) => ({ points: pointsOf(at), rgb: last })),
    ].filter(({ points }) => points.length);
    tell([["selected", chosen], ["had to come first", first, near.before.length],
      ["waits for it", last, near.after.length]].filter(([, , count]) => count !== 0));
    const { kind } = scene.page.plans[selected.plan].heads[selected.head];
    painter.overlay(lines, [{ points, rgb: chosen }], kind[selected.action] === 0 ? null : selected.plan);
  }

  const OUTSIDE = new Set(["external perimeter", "top solid infill"]); // roles that show

  /** Mark the cuts of the layers shown; returns what the legend says of them. */
  function markCuts() {
    const { cuts, layers: [low, high] } = D.state.get();
    const { page } = scene, of = page.cuts;
    const rgb = ["--fg", "--bad"].map(D.colours.named), count = [0, 0];
    const places = [];
    for (let k = 0; cuts && of && k < of.x.length; k++) {
      const c = of.before[k];
      if (page.contours.layer[c] < low || page.contours.layer[c] > high) continue;
      const shows = OUTSIDE.has(page.roles[page.contours.role[c]]) ? 1 : 0;
      count[shows]++;
      places.push({ points: [[of.x[k], of.y[k], of.z[k]]], rgb: rgb[shows] });
    }
    painter.markCuts(places);
    view.cuts = ["cuts inside", "cuts that show"].map((name, k) => ({ name: `${name}: ${D.format.number(count[k])}`, rgb: rgb[k] }))
      .filter((_, k) => count[k]);
  }

  /** Say what the colours are; `selected` are names and colours of what is drawn over the print. */
  const tell = (selected) => parts.legend({ ...legend, selected, cuts: view.cuts, bodies: showsHeads(D.state.get()) });

  /** What is shown at (x, y) px of the canvas: {plan, head, action} or null. */
  function pick(x, y) {
    const pane = panes().find((p) => x >= p.left && x < p.left + p.width && y >= p.top && y < p.top + p.height);
    if (!pane) return null;
    const state = D.state.get();
    const { plan } = pane;
    const now = state.time >= scene.page.plans[plan].end_s ? Infinity : state.time;
    const [dx, dy] = [x - pane.left - pane.width / 2, y - pane.top - pane.height / 2];
    const [a, b] = painter.contoursWithin(state.layers);
    const { fine } = scene;
    const bead = D.pick.nearest(view.camera, { set: fine, plan, begin: fine.first[a], end: fine.first[b],
      now, wide: 0, largest: scene.largest }, dx, dy);
    let travel = null;
    if (state.travels || state.changed) {
      const { set } = scene.travels[plan];
      const [begin, end] = painter.travelsWithin(plan, state.layers);
      travel = D.pick.nearest(view.camera, { set, plan: 0, begin, end, now, wide: 2, largest: 1 }, dx, dy);
    }
    if (travel && (!bead || travel.depth > bead.depth)) {
      const run = scene.travels[plan].runs[D.pick.ownerOf(scene.travels[plan].set.first, travel.segment)];
      return { plan, head: run.head, action: run.action };
    }
    if (!bead) return null;
    const c = scene.order[D.pick.ownerOf(fine.first, bead.segment)];
    return { plan, head: scene.by[plan].head[c], action: scene.by[plan].action[c] };
  }

  /** Select what is shown at (x, y) px of the canvas. */
  function choose(x, y) {
    picking = true;
    D.state.set({ selected: pick(x, y) });
    picking = false;
  }

  // Camera ------------------------------------------------------------------------------------

  /** Whether the heads' bodies are shown. */
  const showsHeads = (state) => state.bodies && (state.playing || state.time < Math.max(...scene.page.plans.map((plan) => plan.end_s)));

  /** Show the whole print; and where several heads park, while they are shown. */
  function fit() {
    const heads = scene.page.plans[1].heads.length > 1 && showsHeads(D.state.get()) ? scene.page.machine.heads : [];
    const [low, high] = [Math.min, Math.max].map((most, end) => scene.box[["low", "high"][end]].map(
      (v, k) => (k < 2 ? most(v, ...heads.map(({ park }) => park[k])) : v)));
    const [pane] = panes();
    D.camera.fit(view.camera, low, high, pane.width, pane.height);
    view.fitted = true; // until someone turns it
    redraw(true);
  }

  /** Zoom with the size of a picture: it halves when two stand side by side. */
  function refit(halves) {
    if (view.fitted) {
      fit();
      return;
    }
    const share = canvas.clientWidth >= BESIDE_PX ? 0.5 : 0.6;
    view.camera.zoom *= halves > 0 ? share : halves < 0 ? 1 / share : 1;
  }

  /** Bring an action into the picture, if it is out of it. */
  function reveal(at) {
    const points = pointsOf(at);
    const pane = panes().find(({ plan }) => plan === at.plan);
    if (!points.length || !pane) return;
    const middle = points[points.length >> 1];
    const [x, y] = D.camera.project(view.camera, D.camera.basis(view.camera), middle);
    const inside = Math.abs(x) < 0.42 * pane.width && Math.abs(y) < 0.42 * pane.height;
    if (!inside) view.camera.target = middle;
  }

  /** Bring the selected action to the middle, near enough to see it. */
  function closer() {
    const { selected } = D.state.get();
    if (!selected) return;
    const points = pointsOf(selected);
    const [low, high] = [Math.min, Math.max].map((most) => [0, 1, 2].map((k) => points.reduce((v, p) => most(v, p[k]), points[0][k])));
    const [pane] = panes();
    D.camera.fit(view.camera, low.map((v) => v - 3), high.map((v) => v + 3), pane.width, pane.height);
    redraw(true);
  }

  function turnTo(name) {
    D.camera.turnTo(view.camera, name);
    fit();
  }

  // Begin -------------------------------------------------------------------------------------

  /** What draws with the graphics card; null, with a line in its place, where there is no WebGL. */
  function drawing() {
    try {
      return createREGL({ canvas, extensions: ["ANGLE_instanced_arrays", "OES_element_index_uint"],
        attributes: { antialias: false, alpha: false, preserveDrawingBuffer: true, powerPreference: "high-performance" } });
    } catch (error) {
      parts.missing(error);
      return null;
    }
  }

  async function begin(page) {
    await D.segments.breathe();
    scene = { page, ...(await D.segments.build(page)), travels: [] };
    const { layer } = page.contours;
    scene.layers = [layer.reduce((a, b) => Math.min(a, b), layer[0] ?? 0), layer.reduce((a, b) => Math.max(a, b), 0)];
    scene.top = D.layers.tops(scene);
    for (const p of page.plans.keys()) scene.travels.push(await D.travels.build(scene, p));
    const { bed_min: [x0, y0], bed_max: [x1, y1] } = page.machine;
    view.front = [(x0 + x1) / 2, y0, 0];
    view.reach = 4 * (Math.hypot(x1 - x0, y1 - y0) + scene.box.high[2]);
    painter = new D.painter.Painter(regl, scene);
    recolour();
    fit();
    D.state.on(changed);
    new ResizeObserver(() => (view.fitted ? fit() : redraw())).observe(canvas);
    canvas.addEventListener("webglcontextrestored", () => redraw());
    parts.begun(scene);
    D.input.listen(canvas, view, { redraw, choose, turnTo, fit, panes, closer });
    D.selected.show(scene);
  }

  function changed(now, was) {
    const differs = (...keys) => keys.some((key) => now[key] !== was[key]);
    if (differs("theme", "colour", "changed", "travels", "cuts")) recolour();
    else if (differs("selected")) select();
    if (differs("plans")) refit((now.plans === "both") - (was.plans === "both"));
    if (differs("selected") && now.selected && !picking) reveal(now.selected);
    const turned = showsHeads(now) !== showsHeads(was);
    if (differs("layers") && now.cuts) markCuts();
    if (turned || (differs("layers") && (now.changed || now.cuts))) select();
    if (turned && view.fitted) fit();
    redraw(differs("time", "layers") && !now.playing);
  }

  async function show(page) {
    parts = D.controls.make(page, { fit, turnTo, redraw: () => redraw(true), recolour: () => { recolour(); redraw(); } });
    canvas = document.getElementById("view-canvas");
    labels = document.getElementById("view-labels");
    regl = drawing();
    D.view.ready = regl ? begin(page) : Promise.resolve();
  }

  D.view = {
    MOST,
    show,
    redraw,
    closer,
    ready: null,
    stats: () => ({ segments: scene.fine.n, drawn: painter.drawn, frames: painter.frames, coarse: painter.coarse,
      instanced: painter.rows === 1, budget: Math.round(painter.budget) }),
    /** Mean ms of n pictures of a moving view, each waited for. */
    async benchmark(n) {
      whole = null;
      regl.read({ x: 0, y: 0, width: 1, height: 1 }); // what was asked before is done
      const begun = performance.now();
      for (let k = 0; k < n; k++) {
        const from = performance.now();
        view.camera.yaw += 0.02;
        picture();
        regl.read({ x: 0, y: 0, width: 1, height: 1 });
        painter.learn(performance.now() - from);
        if (k % 4 === 3) await D.segments.breathe();
      }
      const mean = (performance.now() - begun) / n;
      redraw(true);
      return mean;
    },
    /** Resolves when a whole, still picture is shown. */
    settled: () => new Promise((tell) => {
      settled.push(tell);
      redraw();
    }),
    picture,
    camera: () => view.camera,
    pick,
    where: (point) => D.camera.project(view.camera, D.camera.basis(view.camera), point),
  };
})();
