// What Python packed, unpacked: D.load() resolves to the page with typed arrays in it.
"use strict";
(() => {
  const WIDTHS = { i8: 1, i16: 2, i32: 4 };

  async function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    if (typeof DecompressionStream === "undefined")
      throw new Error("this browser is too old to unpack the report (Chrome 80, Firefox 113, Safari 16.4 or later)");
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  /** An array of a place {at, n, type, delta, scale}; its bytes lie by their weight. */
  function arrayAt(place, bytes) {
    const { n, type, delta, scale } = place, width = WIDTHS[type];
    const out = scale === 1 ? new Int32Array(n) : new Float32Array(n);
    const shift = 32 - 8 * width;
    let sum = 0;
    for (let i = 0; i < n; i++) {
      let value = 0;
      for (let k = 0; k < width; k++) value |= bytes[place.at + k * n + i] << (8 * k);
      value = (value << shift) >> shift;
      sum = delta ? sum + value : value;
      out[i] = scale === 1 ? sum : sum * scale;
    }
    return out;
  }

  function decoded(value, bytes) {
    if (Array.isArray(value)) return value.map((each) => decoded(each, bytes));
    if (value === null || typeof value !== "object") return value;
    if ("at" in value && "n" in value && "scale" in value) return arrayAt(value, bytes);
    return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, decoded(each, bytes)]));
  }

  const running = (counts) => {
    const out = new Uint32Array(counts.length + 1);
    for (let i = 0; i < counts.length; i++) out[i + 1] = out[i] + counts[i];
    return out;
  };

  /** Seconds at which actions begin and end, from pauses and durations in ms. */
  function timed(head) {
    const begin = new Float32Array(head.n), end = new Float32Array(head.n);
    let now = 0;
    for (let k = 0; k < head.n; k++) {
      now += head.idle[k];
      begin[k] = now / 1000;
      now += head.lasts[k];
      end[k] = now / 1000;
    }
    head.begin = begin;
    head.end = end;
  }

  /** Index of the last of ascending values that is <= value; -1: none. */
  D.lastUpTo = (sorted, value) => {
    let [low, high] = [0, sorted.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] <= value) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  };

  const AXES = ["x", "y", "z"];
  const pointOf = (c, row) => [c.x[row], c.y[row], c.z[row]];

  /** Points [x, y, z] of a contour as printed: a loop from vertex `entry` on, or backwards. */
  function printed(contours, contour, entry, reversed) {
    const first = contours.offsets[contour], last = contours.offsets[contour + 1] - 1;
    const rows = [];
    for (let row = first + entry; row <= last; row++) rows.push(pointOf(contours, row));
    if (entry) {
      const gap = apart(pointOf(contours, first), pointOf(contours, last));
      for (let row = first + (gap > 1e-6 ? 0 : 1); row <= first + entry; row++)
        rows.push(pointOf(contours, row));
      shorten(rows, gap); // the gap moves with the seam
    }
    return reversed ? rows.reverse() : rows;
  }

  const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

  function shorten(rows, mm) {
    while (mm > 1e-6 && rows.length > 2) {
      const end = rows.pop(), before = rows[rows.length - 1], length = apart(before, end);
      if (length > mm) {
        const share = mm / length;
        rows.push(end.map((value, k) => value + share * (before[k] - value)));
        return;
      }
      mm -= length;
    }
  }

  const columns = (rows) =>
    Object.fromEntries(AXES.map((axis, k) => [axis, Float32Array.from(rows, (p) => p[k])]));

  /** Give every action that does not print its whole path: offsets, x, y, z of the head. */
  function withPaths(contours, head) {
    const end = (k, side) => {
      const turned = head.reversed[k] ? !side : side, c = head.contour[k];
      return pointOf(contours, turned ? contours.offsets[c + 1] - 1 : contours.offsets[c]);
    };
    const rows = [], offsets = new Uint32Array(head.n + 1);
    let at = 0;
    for (let k = 0; k < head.n; k++) {
      if (head.kind[k] !== 0) {
        if (head.known[k] & 1) rows.push(end(k - 1, true));
        for (let i = 0; i < head.kept[k]; i++, at++) rows.push([head.x[at], head.y[at], head.z[at]]);
        if (head.known[k] & 2) rows.push(end(k + 1, false));
      }
      offsets[k + 1] = rows.length;
    }
    return { offsets, ...columns(rows) };
  }

  /** Points of any action: {x, y, z}. */
  D.path = (page, head, action) => {
    if (head.kind[action] === 0) {
      const { contour, entry, reversed } = head;
      return columns(printed(page.contours, contour[action], entry[action], reversed[action]));
    }
    const [from, to] = [head.offsets[action], head.offsets[action + 1]];
    return Object.fromEntries(AXES.map((axis) => [axis, head[axis].subarray(from, to)]));
  };

  function completed(page) {
    page.contours.offsets = running(page.contours.sizes);
    for (const plan of page.plans) {
      plan.heads.forEach((head, index) => {
        head.colour = index;
        timed(head);
        Object.assign(head, withPaths(page.contours, head));
      });
    }
    for (const { rows } of page.run ? page.run.anew : []) rows.forEach(timed);
    const { graph, critical } = page;
    if (graph) {
      graph.offsets = running(graph.counts);
      graph.preds = new Int32Array(graph.back.length);
      for (let c = 0; c < page.contours.n; c++)
        for (let i = graph.offsets[c]; i < graph.offsets[c + 1]; i++) graph.preds[i] = c - graph.back[i];
    }
    page.critical = Array.from(critical.head, (head, i) => [head, critical.action[i]]);
    return page;
  }

  /** The page's data, unpacked once. */
  D.load = async () => {
    if (D.page) return D.page;
    const element = document.getElementById("packed");
    const bytes = await unpacked(element.textContent.trim());
    element.remove();
    const size = new DataView(bytes.buffer).getUint32(0, true);
    const page = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
    D.page = completed(decoded(page, bytes.subarray(4 + size)));
    return D.page;
  };
})();
