"use strict";
// Contours as straight segments in flat arrays, as the graphics card draws them.
// Both plans share the places; each has times of its own.
(() => {
  const SLICE_MS = 12; // of work at a time while arrays are made
  const ROUGH_MM = 0.2; // by which lines may move while the view moves

  const breathe = () => new Promise((resume) => setTimeout(resume));

  /** The box around all contours: low and high corner, mm. */
  function boxOf(contours) {
    const sides = ["x", "y", "z"].map((name) => endsOf(contours[name]));
    if (!contours.x.length) return { low: [0, 0, 0], high: [1, 1, 1] };
    return { low: [sides[0][0], sides[1][0], Math.min(0, sides[2][0])], high: sides.map(([, high]) => high) };
  }

  function endsOf(values) {
    let [low, high] = [Infinity, -Infinity];
    for (let k = 0; k < values.length; k++) {
      const v = values[k];
      if (v < low) low = v;
      if (v > high) high = v;
    }
    return [low, high];
  }

  const OUTER = new Set([1, 3]); // roles: external and overhang perimeter

  /** Whether a contour can be seen from outside: all can, where roles are not known. */
  function outerOf({ role, n }) {
    const known = role.some((r) => OUTER.has(r));
    return Uint8Array.from({ length: n }, (_, c) => (!known || OUTER.has(role[c]) ? 1 : 0));
  }

  /** Numbers of the contours, highest layer first, and outer walls first in each. */
  function topDown(layer, outer) {
    const [least, most] = endsOf(layer);
    const count = layer.length ? most - least + 1 : 0;
    const first = new Uint32Array(count + 1);
    for (let c = 0; c < layer.length; c++) first[most - layer[c] + 1]++;
    for (let k = 0; k < count; k++) first[k + 1] += first[k];
    const order = new Uint32Array(layer.length);
    const next = first.slice();
    for (const wanted of [1, 0]) {
      for (let c = 0; c < layer.length; c++) {
        if (outer[c] === wanted) order[next[most - layer[c]]++] = c;
      }
    }
    return order;
  }

  /** For each contour which head prints it in which action; -1: none. */
  function printedBy(plan, n) {
    const head = new Int32Array(n).fill(-1);
    const action = new Int32Array(n).fill(-1);
    plan.heads.forEach((of, h) => {
      for (let k = 0; k < of.n; k++) {
        if (of.kind[k] !== 0) continue;
        head[of.contour[k]] = h;
        action[of.contour[k]] = k;
      }
    });
    return { head, action };
  }

  /** Flat arrays with room for so many segments; `plans` sets of times. */
  function room(segments, contours, plans, box) {
    return {
      n: 0,
      box,
      place: new Uint16Array(8 * segments), // two ends (x, y, z each), width and height, unused
      when: Array.from({ length: plans }, () => new Float32Array(2 * segments)),
      tint: Array.from({ length: plans }, () => new Uint32Array(segments)),
      first: new Uint32Array(contours + 1), // segments before each contour, in drawing order
    };
  }

  function writer(set, largest) {
    const { low, high } = set.box;
    const bytes = new Uint8Array(set.place.buffer);
    const step = low.map((v, k) => 65535 / Math.max(high[k] - v, 1e-6));
    return (ax, ay, az, bx, by, bz, width, height) => {
      const at = 8 * set.n;
      const { place } = set;
      place[at] = (ax - low[0]) * step[0] + 0.5;
      place[at + 1] = (ay - low[1]) * step[1] + 0.5;
      place[at + 2] = (az - low[2]) * step[2] + 0.5;
      place[at + 3] = (bx - low[0]) * step[0] + 0.5;
      place[at + 4] = (by - low[1]) * step[1] + 0.5;
      place[at + 5] = (bz - low[2]) * step[2] + 0.5;
      bytes[2 * at + 12] = Math.min(255, Math.max(1, (width / largest) * 255));
      bytes[2 * at + 13] = Math.min(255, Math.max(1, (height / largest) * 255));
      set.n++;
    };
  }

  /** Lengths along a contour's points, into `out`. */
  function alongOf({ x, y, z }, first, last, out) {
    out[0] = 0;
    for (let k = first + 1; k < last; k++) {
      out[k - first] = out[k - first - 1]
        + Math.hypot(x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]);
    }
    return out[last - first - 1];
  }

  /** Seconds at which a head is at both ends of a segment: `from` and `to` mm along as sliced. */
  function timesOf(run, from, to, out, at) {
    let [a, b] = [from, to];
    if (run.enters > 0) { // goes round from there on
      const moved = from >= run.enters - 1e-6 ? -run.enters : run.length - run.enters;
      a += moved;
      b += moved;
    }
    const [p, q] = run.reversed ? [1 - a / run.length, 1 - b / run.length]
      : [a / run.length, b / run.length];
    out[at] = run.begin + p * run.lasts;
    out[at + 1] = run.begin + q * run.lasts;
  }

  /** Which points a rough drawing keeps, as places within the contour. */
  function roughly({ x, y, z }, first, last, closedAt, keep) {
    let count = 1;
    let from = first;
    keep[0] = 0;
    for (let k = first + 1; k < last - 1; k++) {
      const [cx, cy, cz] = [x[k + 1] - x[from], y[k + 1] - y[from], z[k + 1] - z[from]];
      const [bx, by, bz] = [x[k] - x[from], y[k] - y[from], z[k] - z[from]];
      const size = Math.hypot(cx, cy, cz) || 1e-9;
      const away = Math.hypot(by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx) / size;
      if (away > ROUGH_MM || bx * cx + by * cy + bz * cz < 0 || closedAt.includes(k - first)) {
        keep[count++] = k - first;
        from = k;
      }
    }
    keep[count++] = last - 1 - first;
    return count;
  }

  function runOf(head, action, along, length) {
    return {
      begin: head.begin[action],
      lasts: head.end[action] - head.begin[action],
      reversed: head.reversed[action] === 1,
      enters: along[head.entry[action]] || 0,
      length: length || 1e-9,
    };
  }

  /**
   * Make the arrays of all contours, whole and roughly, without holding up the page.
   * @returns {Promise<{fine, rough, order, by, largest, box}>}
   */
  async function build(page) {
    const { contours, plans } = page;
    const { x, y, z, offsets } = contours;
    const box = boxOf(contours);
    const outer = outerOf(contours);
    const order = topDown(contours.layer, outer);
    const by = plans.map((plan) => printedBy(plan, contours.n));
    let [largest, longest] = [0.1, 2];
    for (let c = 0; c < contours.n; c++) {
      largest = Math.max(largest, Math.min(4, contours.width[c]), Math.min(4, contours.height[c]));
      longest = Math.max(longest, offsets[c + 1] - offsets[c]);
    }
    const segments = Math.max(0, x.length - contours.n);
    const fine = room(segments, contours.n, plans.length, box);
    const rough = room(segments, contours.n, plans.length, box);
    const [toFine, toRough] = [writer(fine, largest), writer(rough, largest)];
    const along = new Float64Array(longest);
    const keep = new Uint32Array(longest + 1);
    let until = performance.now() + SLICE_MS;
    for (let i = 0; i < order.length; i++) {
      const c = order[i];
      const [first, last] = [offsets[c], offsets[c + 1]];
      const length = alongOf(contours, first, last, along);
      const runs = plans.map((plan, p) => {
        const h = by[p].head[c];
        return h < 0 ? null : runOf(plan.heads[h], by[p].action[c], along, length);
      });
      const [width, height] = [contours.width[c], contours.height[c]];
      const add = (set, write, k, m) => {
        runs.forEach((run, p) => {
          if (run) timesOf(run, along[k], along[m], set.when[p], 2 * set.n);
          else set.when[p].fill(Infinity, 2 * set.n, 2 * set.n + 2);
        });
        write(x[first + k], y[first + k], z[first + k],
          x[first + m], y[first + m], z[first + m], width, height);
      };
      for (let k = 0; k < last - first - 1; k++) add(fine, toFine, k, k + 1);
      const cuts = runs.map((run, p) => (
        run ? plans[p].heads[by[p].head[c]].entry[by[p].action[c]] : 0));
      const kept = roughly(contours, first, last, cuts, keep);
      for (let k = 0; k + 1 < kept; k++) add(rough, toRough, keep[k], keep[k + 1]);
      fine.first[i + 1] = fine.n;
      rough.first[i + 1] = rough.n;
      if ((i & 63) === 0 && performance.now() > until) {
        await breathe();
        until = performance.now() + SLICE_MS;
      }
    }
    return { fine, rough: cut(rough), order, outer, by, largest, box };
  }

  /** Give back the room a set does not use. */
  function cut(set) {
    return {
      ...set,
      place: set.place.slice(0, 8 * set.n),
      when: set.when.map((of) => of.slice(0, 2 * set.n)),
      tint: set.tint.map((of) => of.slice(0, set.n)),
    };
  }

  D.segments = { build, room, writer, printedBy, breathe, boxOf };
})();
