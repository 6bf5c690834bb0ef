"use strict";
// One picture of the print: what is drawn, in which order, how finely.
(() => {
  const { SHOWN } = D.beads;
  const ALL = 3e38; // seconds: everything is printed
  const FAST_MS = 60; // a moving picture may take so long
  const LEAST = 6_000; // segments, whatever the speed

  class Painter {
    constructor(regl, scene) {
      const rows = isSlow(regl) ? D.beads.SPELLED_OUT : D.beads.INSTANCED;
      const most = Math.max(2000, scene.fine.n, ...scene.travels.map(({ set }) => set.n));
      const budget = rows === D.beads.INSTANCED ? 2_000_000 : 20_000;
      Object.assign(this, { regl, rows, most, scene, frames: 0, drawn: 0, of: 0, budget });
      this.corners = D.beads.corners(this);
      this.lists = new Map();
      this.commands = new Map(); // each compiled when it is first used
      this.fine = D.beads.upload(this, scene.fine);
      this.simple = D.beads.upload(this, scene.rough);
      this.travels = scene.travels.map(({ set }) => D.beads.upload(this, set));
      this.solids = this.solidsOf();
      this.extras = [];
      this.spaces = new Map(); // of each head, for its action
      this.layerOf = Int32Array.from(scene.order, (c) => scene.page.contours.layer[c]);
      this.layers = layersOf(this.layerOf, scene);
    }

    command(name, make) {
      if (!this.commands.has(name)) this.commands.set(name, make());
      return this.commands.get(name);
    }

    strips(kind, props) {
      this.command(kind, () => D.beads.strips(this, kind))(props);
    }

    /** Solids and edges of the heads of each plan, by the machine's heads of the same name. */
    solidsOf() {
      const solids = this.scene.page.machine.heads.map((head) => [head.name, D.bodies.solidOf(head)]);
      const found = new Map(solids.map(([name, { faces, edges }]) => [name, {
        place: this.regl.buffer(faces), count: faces.length / 3, lines: edges, edges: null,
      }]));
      return this.scene.page.plans.map((plan) => plan.heads.map((head) => found.get(head.name)));
    }

    /** Give the heads' edges their colours: `of(plan, head)` -> [r, g, b]. */
    tintHeads(of) {
      this.solids.forEach((heads, p) => heads.forEach((solid, h) => {
        if (!solid) return;
        if (solid.edges) D.beads.release(solid.edges);
        const rgb = of(p, h);
        const lines = solid.lines.map((points) => ({ points, rgb }));
        solid.edges = linesOf(this, lines, SHOWN.plain);
      }));
    }

    /** The part of a list by descending layer that lies within [low, high]. */
    static within(layerAt, n, low, high) {
      const first = (bound) => {
        let [a, b] = [0, n];
        while (a < b) {
          const middle = (a + b) >> 1;
          if (layerAt(middle) > bound) a = middle + 1;
          else b = middle;
        }
        return a;
      };
      return [first(high), first(low - 1)];
    }

    contoursWithin([low, high]) {
      return Painter.within((k) => this.layerOf[k], this.layerOf.length, low, high);
    }

    travelsWithin(plan, [low, high]) {
      const { runs } = this.scene.travels[plan];
      const [a, b] = Painter.within((k) => runs[k].layer, runs.length, low, high);
      const { first } = this.scene.travels[plan].set;
      return [first[a], first[b]];
    }

    /** Give each contour of a plan its colour: `of(contour)` -> packed colour. */
    tint(plan, of) {
      const { order } = this.scene;
      const colours = new Uint32Array(order.length);
      for (let i = 0; i < order.length; i++) colours[i] = of(order[i]);
      for (const on of [this.fine, this.simple]) {
        const { first, tint } = on.set;
        for (let i = 0; i < order.length; i++) tint[plan].fill(colours[i], first[i], first[i + 1]);
        D.beads.recolour(this, on, plan);
      }
    }

    tintTravels(plan, of) {
      const { runs, set } = this.scene.travels[plan];
      runs.forEach((run, i) => set.tint[0].fill(of(run), set.first[i], set.first[i + 1]));
      D.beads.recolour(this, this.travels[plan], 0);
    }

    /**
     * Lay thick lines over the picture of one plan, or of both: [{points: [[x, y, z] ...], rgb}].
     * `first` are in front of all others.
     */
    overlay(lines, first, plan = null) {
      this.extraOf = plan;
      this.extras.forEach(({ on }) => on && D.beads.release(on));
      this.extras = [[lines, "LINE", 4], [first, "FIRST", 5]].map(([of, kind, wide]) => ({ on: linesOf(this, of), kind, wide }));
    }

    /** Mark places in the plan's picture, in front of all: [{points: [[x, y, z]], rgb}]. */
    markCuts(places) {
      if (this.cuts) D.beads.release(this.cuts);
      this.cuts = linesOf(this, places);
    }

    /**
     * What is drawn of the beads: all, or while the view moves as much as is fast: with lines
     * made simpler, then only outer walls, then only those of every second layer, twice as tall,
     * and so on. Layers that are being printed, and the highest, stay whole.
     */
    choose(state, moving, panes) {
      const [low, high] = state.layers;
      const layers = this.layers.filter(({ layer }) => layer >= low && layer <= high);
      const size = (on, until) => panes * layers.reduce(
        (sum, one) => sum + on.set.first[one[until]] - on.set.first[one.from], 0);
      this.of = size(this.fine, "to");
      if (!moving || this.of <= this.budget) return { on: this.fine, layers, step: 1, whole: true };
      if (size(this.simple, "to") <= this.budget) return { on: this.simple, layers, step: 1, whole: true };
      const step = Math.max(1, Math.ceil(size(this.simple, "walls") / this.budget));
      return { on: this.simple, layers, step, whole: false };
    }

    /** Runs of segments to draw of a plan: [begin, end, how many layers tall]. */
    pieces({ on, layers, step, whole }, plan, now) {
      if (!layers.length) return [];
      const { first } = on.set;
      if (whole && now === ALL) return [[first[layers[0].from], first[layers[layers.length - 1].to], 1]];
      const busy = new Set(now === ALL ? [] : this.busyLayers(plan, now));
      const found = [];
      let shown = true; // the highest that has been begun is whole
      for (const one of layers) {
        if (one.begun[plan] >= now) continue;
        const all = whole || shown || busy.has(one.layer);
        shown = false;
        if (!all && (layers[0].layer - one.layer) % step !== 0) continue;
        const [from, to, tall] = [first[one.from], first[all ? one.to : one.walls], all ? 1 : step];
        const before = found[found.length - 1];
        if (before && before[1] === from && before[2] === tall) before[1] = to;
        else found.push([from, to, tall]);
      }
      return found;
    }

    /** Layers of what the heads print at a time. */
    busyLayers(plan, now) {
      const { page } = this.scene;
      return page.plans[plan].heads.flatMap((head) => {
        const at = D.bodies.actionAt(head, now);
        const c = [at, at - 1].map((k) => head.contour[k]).find((v) => v >= 0);
        return c === undefined ? [] : [page.contours.layer[c]];
      });
    }

    /** What to draw a plan's beads and lines with: of a view, into `into` or the canvas. */
    seen(view, pane, state, into = null) {
      const { page, top, largest } = this.scene;
      const now = state.time >= page.plans[pane.plan].end_s ? ALL : state.time;
      return {
        ...D.beads.seenBy(view.camera, pane.box, pane.ratio, view.reach, into), wide: 0, tall: 1, now, plan: pane.plan, largest, top: top(state.layers[1]),
      };
    }

    /** Draw pieces of beads; returns how many segments. */
    beads(seen, on, pieces) {
      const kept = pieces.filter(([begin, end]) => end > begin);
      const apart = this.rows === D.beads.SPELLED_OUT && kept.length > 3;
      const parts = apart ? this.gathered(seen, on, kept)
        : kept.map(([begin, end, tall]) => ({ ...seen, on, begin, count: end - begin, tall }));
      this.strips(on === this.simple ? "ROUGH" : "BEAD", parts);
      return kept.reduce((sum, [begin, end]) => sum + end - begin, 0);
    }

    /** Pieces of one height as one list of triangles: each call costs milliseconds on a processor. */
    gathered(seen, on, pieces) {
      return [...new Set(pieces.map(([, , tall]) => tall))].map((tall, k) => {
        const runs = pieces.filter((piece) => piece[2] === tall);
        const list = this.listOf(`${seen.plan} ${k}`, runs);
        return { ...seen, on, begin: 0, count: list.count, elements: list.elements, tall };
      });
    }

    /** Triangles of runs of segments, made anew when the runs are others. */
    listOf(name, runs) {
      const told = runs.join();
      let list = this.lists.get(name);
      if (list?.told === told) return list;
      const count = runs.reduce((sum, [begin, end]) => sum + end - begin, 0);
      const data = new Uint32Array(6 * count);
      let to = 0;
      for (const [begin, end] of runs) {
        for (let k = begin; k < end; k++) to = D.beads.quad(data, to, k);
      }
      const given = { data, primitive: "triangles", type: "uint32", usage: "dynamic" };
      list = { told, count, elements: list ? list.elements(given) : this.regl.elements(given) };
      this.lists.set(name, list);
      return list;
    }

    /** Draw all but the beads: bed, travels, heads, what is selected. */
    lines(view, seen, state) {
      const line = { ...seen, plan: 0 };
      this.strips("LINE", { ...line, on: view.bed, begin: 0, count: view.bed.set.n, now: ALL, wide: 1 });
      if (state.travels || state.changed) this.drawTravels(line, seen.plan, state, seen.now);
      this.heads(view, line, seen.plan, state);
      if (this.cuts && seen.plan === 1) this.strips("FIRST", { ...line, on: this.cuts, begin: 0, count: this.cuts.set.n, now: ALL, wide: 5 });
      if (this.extraOf !== null && this.extraOf !== seen.plan) return;
      for (const { on, kind, wide } of this.extras) {
        if (on) this.strips(kind, { ...line, on, begin: 0, count: on.set.n, now: ALL, wide });
      }
    }

    drawTravels(line, plan, state, now) {
      const [begin, end] = this.travelsWithin(plan, state.layers);
      if (end === begin) return;
      this.strips("LINE", { ...line, on: this.travels[plan], begin, count: end - begin, now,
        wide: state.changed ? 1.8 : 1.2 });
    }

    heads(view, line, plan, state) {
      if (!view.heads.length) return;
      view.heads[plan].forEach(({ at, rgb }, h) => {
        if (!at) return;
        const solid = this.solids[plan][h];
        const still = { ...line, begin: 0, now: ALL, shift: at };
        if (state.bodies && solid?.edges) {
          const { place, count, edges } = solid;
          this.strips("LINE", { ...still, on: edges, count: edges.set.n, wide: 1.3 });
          this.command("faces", () => D.beads.faces(this.regl))({ ...line, place, count, shift: at, colour: [...rgb.map((v) => v / 255), 0.09] });
        }
        if (state.bodies) this.reserved(line, plan, h, view.heads[plan][h]);
        const mark = view.marks[plan][h];
        this.strips("LINE", { ...still, on: mark, count: mark.set.n, wide: 9 });
      });
    }

    /** The space a head has to itself while it does what it does: what its slices pass over. */
    reserved(line, plan, h, { action, rgb }) {
      if (action === null) return;
      const told = `${action} ${rgb}`;
      const key = `${plan} ${h}`;
      if (this.spaces.get(key)?.told !== told) {
        if (this.spaces.has(key)) D.beads.release(this.spaces.get(key).on);
        const points = D.bodies.reservedBy(this.scene.page, this.scene.page.plans[plan].heads[h], action);
        this.spaces.set(key, { told, on: linesOf(this, [{ points, rgb }], SHOWN.plain) });
      }
      const { on } = this.spaces.get(key);
      this.strips("LINE", { ...line, on, begin: 0, count: on.set.n, now: ALL, wide: 2 });
    }

    ground(view) {
      return { color: [...view.ground.map((v) => v / 255), 1], depth: 1 };
    }

    /** A picture beside the canvas, of a size. */
    beside(width, height) {
      const { regl } = this;
      const color = () => regl.texture({ width, height, min: "linear", mag: "linear" });
      this.large ??= regl.framebuffer({ width, height, depth: true, color: color() });
      if (this.large.width !== width || this.large.height !== height) this.large.resize(width, height);
      return this.large;
    }

    /** Draw a picture at once, as finely as a moving view can be. */
    quick(view, panes, state) {
      this.regl.poll();
      this.regl.clear({ ...this.ground(view), framebuffer: null });
      const chosen = this.choose(state, true, panes.length);
      this.drawn = 0;
      for (const pane of panes) {
        const seen = this.seen(view, pane, state);
        this.drawn += this.beads(seen, chosen.on, this.pieces(chosen, pane.plan, seen.now));
        this.lines(view, seen, state);
      }
      this.coarse = chosen.on !== this.fine;
      this.frames++;
    }

    /** Draw everything, finer than the screen, in steps; shown when it is done. */
    * whole(view, panes, state, width, height) {
      const into = this.beside(width, height);
      this.regl.poll();
      this.regl.clear({ ...this.ground(view), framebuffer: into });
      const chosen = this.choose(state, false, panes.length);
      let [drawn, since] = [0, 0];
      for (const pane of panes) {
        const seen = this.seen(view, pane, state, into);
        for (const [begin, end] of this.pieces(chosen, pane.plan, seen.now)) {
          for (let from = begin; from < end; from += this.budget) {
            const to = Math.min(end, from + this.budget);
            drawn += this.beads(seen, this.fine, [[from, to, 1]]);
            since += to - from;
            if (since < this.budget) continue;
            yield drawn;
            since = 0;
          }
        }
        this.lines(view, seen, state);
      }
      this.drawn = drawn;
      this.coarse = false;
      this.command("copies", () => D.beads.copies(this.regl))({ picture: into });
      this.frames++;
    }

    /** Draw more or less of a moving picture from now on: whole segments. */
    learn(ms) {
      if (!this.coarse && ms < FAST_MS) return;
      const wanted = this.budget * Math.min(1.5, Math.max(0.5, FAST_MS / ms));
      this.budget = Math.max(LEAST, Math.round(0.6 * this.budget + 0.4 * wanted));
    }
  }

  /** Whether the processor does the graphics: it says so, or 500 instances take longer than 8 ms. */
  function isSlow(regl) {
    const gl = regl._gl;
    const named = gl.getExtension("WEBGL_debug_renderer_info");
    const names = [gl.getParameter(gl.RENDERER), named && gl.getParameter(named.UNMASKED_RENDERER_WEBGL)];
    if (/swiftshader|llvmpipe|software|basic render/i.test(names.join())) return true;
    const probe = regl({
      vert: "precision highp float; attribute vec2 corner; attribute float k;"
        + "void main() { gl_Position = vec4(corner * 0.01 + k, 0.0, 1.0); }",
      frag: "precision mediump float; void main() { gl_FragColor = vec4(0.0); }",
      attributes: {
        corner: [[0, 0], [1, 0], [0, 1], [1, 1]],
        k: { buffer: regl.buffer(new Float32Array(500)), divisor: 1 },
      },
      primitive: "triangle strip", count: 4, instances: 500,
    });
    const timed = () => {
      const begun = performance.now();
      probe();
      regl.read({ x: 0, y: 0, width: 1, height: 1 });
      return performance.now() - begun;
    };
    timed(); // compiles
    return Math.min(timed(), timed()) > 8;
  }

  /** Layers from the highest down: {layer, from, walls, to} as places in drawing order, and `begun` s. */
  function layersOf(layerOf, { page, order, outer, by }) {
    const found = [];
    const begin = (p, c) => (by[p].head[c] < 0 ? Infinity
      : page.plans[p].heads[by[p].head[c]].begin[by[p].action[c]]);
    for (let i = 0; i < order.length; i++) {
      let one = found[found.length - 1];
      if (!one || one.layer !== layerOf[i]) {
        one = { layer: layerOf[i], from: i, walls: i, to: i, begun: page.plans.map(() => Infinity) };
        found.push(one);
      }
      one.to = i + 1;
      if (outer[order[i]]) one.walls = i + 1;
      page.plans.forEach((_, p) => { one.begun[p] = Math.min(one.begun[p], begin(p, order[i])); });
    }
    return found;
  }

  /** A set of plain lines with colours of their own, drawn in front of the rest if `lit`. */
  function linesOf(drawing, lines, shown = SHOWN.lit) {
    const count = lines.reduce((sum, { points }) => sum + Math.max(1, points.length - 1), 0);
    if (!count) return null;
    const low = [0, 1, 2].map((k) => Math.min(...lines.map(({ points }) => least(points, k))));
    const high = [0, 1, 2].map((k) => Math.max(...lines.map(({ points }) => -least(points, k, -1))));
    const set = D.segments.room(count, lines.length, 1, { low, high });
    const write = D.segments.writer(set, 1);
    for (const { points, rgb } of lines) {
      const from = set.n;
      if (points.length === 1) write(...points[0], ...points[0], 1, 1);
      for (let k = 1; k < points.length; k++) write(...points[k - 1], ...points[k], 1, 1);
      set.tint[0].fill(D.colours.packed(rgb, shown), from, set.n);
    }
    return D.beads.upload(drawing, set);
  }

  const least = (points, k, sign = 1) => points.reduce((min, p) => Math.min(min, sign * p[k]), Infinity);

  D.painter = { Painter, linesOf };
})();
