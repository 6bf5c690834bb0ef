"use strict";
// Travels of both plans as segments, each with what became of it.
(() => {
  const MOVES = new Set([1, 2]); // kinds of actions: travel, park

  /** Layer of the contour printed next after each action; the last one's for those after it. */
  function layersOf(head, layer) {
    const out = new Int32Array(head.n);
    let [next, behind] = [null, -1];
    for (let k = head.n - 1; k >= 0; k--) {
      if (head.kind[k] === 0) {
        next = layer[head.contour[k]];
        if (behind < 0) behind = k;
      }
      out[k] = next ?? 0;
    }
    if (behind >= 0) out.fill(layer[head.contour[behind]], behind + 1);
    return out;
  }

  /** Travels of a plan, highest layer first, with their paths. */
  async function runsOf(scene, p) {
    const plan = scene.page.plans[p];
    const runs = [];
    let count = 0;
    for (const [h, head] of plan.heads.entries()) {
      const layers = layersOf(head, scene.page.contours.layer);
      const last = head.kind.lastIndexOf(0);
      for (let k = 0; k < head.n; k++) {
        if (!MOVES.has(head.kind[k])) continue;
        const path = D.path(scene.page, head, k);
        const home = k > last; // to the park: of no layer
        const kind = home ? "same" : D.changes.travelKind(p, head.flags[k]);
        runs.push({ head: h, action: k, layer: layers[k], kind, home, path, mm: 0,
          over: (head.flags[k] & D.changes.OVER_WALL) > 0 });
        count += Math.max(0, path.x.length - 1);
        if ((runs.length & 1023) === 0) await D.segments.breathe();
      }
    }
    runs.sort((a, b) => b.layer - a.layer);
    return { runs, count };
  }

  function boxOf(runs) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const { path } of runs) {
      [path.x, path.y, path.z].forEach((values, k) => values.forEach((v) => {
        low[k] = Math.min(low[k], v);
        high[k] = Math.max(high[k], v);
      }));
    }
    return runs.length && low[0] <= high[0] ? { low, high } : { low: [0, 0, 0], high: [1, 1, 1] };
  }

  /** Write one run's segments with their times; returns its length in mm. */
  function add(set, write, run, begin, end) {
    const { x, y, z } = run.path;
    const along = [0];
    for (let k = 1; k < x.length; k++) {
      along.push(along[k - 1] + Math.hypot(x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]));
    }
    const length = along[along.length - 1] || 1e-9;
    for (let k = 1; k < x.length; k++) {
      set.when[0][2 * set.n] = begin + ((end - begin) * along[k - 1]) / length;
      set.when[0][2 * set.n + 1] = begin + ((end - begin) * along[k]) / length;
      write(x[k - 1], y[k - 1], z[k - 1], x[k], y[k], z[k], 1, run.over ? 0 : 1); // no height: dashed
    }
    return along[along.length - 1];
  }

  /** @returns {Promise<{set, runs, layers}>}  `layers[i]`: layer of run i, descending */
  async function build(scene, p) {
    const { runs, count } = await runsOf(scene, p);
    const set = D.segments.room(count, runs.length, 1, boxOf(runs));
    const write = D.segments.writer(set, 1);
    for (const [i, run] of runs.entries()) {
      const head = scene.page.plans[p].heads[run.head];
      run.mm = add(set, write, run, head.begin[run.action], head.end[run.action]);
      delete run.path;
      set.first[i + 1] = set.n;
      if ((i & 1023) === 0) await D.segments.breathe();
    }
    return { set, runs };
  }

  D.travels = { build };
})();
