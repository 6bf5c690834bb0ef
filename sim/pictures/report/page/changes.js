"use strict";
// What differs between the plan and the source's own order.
(() => {
  const OTHER = 1; // flags of actions
  const OVER_WALL = 2;
  const MOVED = 4;
  const CROSSED = 8;

  /** Place of each contour in the order of all, 0 to 1. */
  function places(scene, p) {
    const { head, action } = scene.by[p];
    const { heads } = scene.page.plans[p];
    const { n } = scene.page.contours;
    const begin = Float64Array.from({ length: n }, (_, c) => (
      head[c] < 0 ? Infinity : heads[head[c]].begin[action[c]]));
    const order = Uint32Array.from({ length: n }, (_, c) => c).sort((a, b) => begin[a] - begin[b] || a - b);
    const place = new Float32Array(n);
    order.forEach((c, k) => { place[c] = k / Math.max(n - 1, 1); });
    return place;
  }

  /** How much later each contour is printed (share of the print), and whether by another head. */
  function ofContours(scene) {
    if (scene.moved) return scene.moved;
    const [was, now] = [places(scene, 0), places(scene, 1)];
    const name = (p, c) => scene.page.plans[p].heads[scene.by[p].head[c]]?.name;
    const shift = now.map((v, c) => v - was[c]);
    const other = Uint8Array.from(shift, (_, c) => (name(0, c) !== name(1, c) ? 1 : 0));
    scene.moved = { shift, other };
    return scene.moved;
  }

  // What is lit up, in the order of the legend; `travel` entries are of one plan's picture.
  const KINDS = [
    { key: "gone", name: "travels gone", plan: 0, colour: "--gone", on: true },
    { key: "walls", name: "gone, over outer walls", plan: 0, colour: "--gone", on: true, dash: true },
    { key: "new", name: "travels new", plan: 1, colour: "--new", on: true },
    { key: "crossed", name: "new, over outer walls", plan: 1, colour: "--new", on: true, dash: true },
    { key: "freed", name: "walls no longer crossed", colour: "--good", on: true },
    { key: "cut", name: "walls crossed only now", colour: "--bad", on: true },
    { key: "other", name: "printed by another head", colour: "--other", on: true },
    { key: "order", name: "printed earlier or later", colour: "--accent", on: false },
  ];

  /** Which kind of change a travel is: a key, or "same". */
  function travelKind(plan, flags) {
    if (!(flags & OTHER)) return "same";
    if (flags & OVER_WALL) return plan === 0 ? "walls" : "crossed";
    return plan === 0 ? "gone" : "new";
  }

  /** All that changed of a contour, what tells most first. */
  function contourKinds(scene, c) {
    const [was, now] = [0, 1].map((p) => {
      const { head, action } = scene.by[p];
      return head[c] < 0 ? 0 : scene.page.plans[p].heads[head[c]].flags[action[c]];
    });
    const found = [];
    if ((was ^ now) & CROSSED) found.push(was & CROSSED ? "freed" : "cut");
    if (ofContours(scene).other[c]) found.push("other");
    else if (now & MOVED) found.push("order");
    return found;
  }

  /** Count and mm of every kind of change within layers, and travel per layer of both plans. */
  function sums(scene, [low, high]) {
    const found = Object.fromEntries(KINDS.map(({ key }) => [key, { count: 0, mm: 0 }]));
    scene.travels.forEach(({ runs }, p) => runs.forEach((run) => {
      if (run.layer < low || run.layer > high || run.kind === "same") return;
      found[run.kind].count++;
      found[run.kind].mm += run.mm;
    }));
    const { layer, n } = scene.page.contours;
    for (let c = 0; c < n; c++) {
      if (layer[c] < low || layer[c] > high) continue;
      for (const kind of contourKinds(scene, c)) found[kind].count++;
    }
    return found;
  }

  D.changes = { KINDS, OTHER, OVER_WALL, ofContours, travelKind, contourKinds, sums };
})();
