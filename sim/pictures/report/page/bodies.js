"use strict";
// Heads as solids: slices of what is near the nozzle, and bodies such as carriages and beams.
(() => {
  const ABOVE_MM = 14; // how far up the highest slice is drawn; it goes on for ever
  const FAR_MM = 400; // parts that reach further are cut off there

  const less = (a, b) => a.map((v, k) => v - b[k]);
  const cutOff = (v) => Math.min(FAR_MM, Math.max(-FAR_MM, v));

  /** A prism's triangles and edges: [[x, y, z] ...] in threes and in twos. */
  function prism(polygon, low, high, faces, edges) {
    const ring = polygon.map(([x, y]) => [cutOff(x), cutOff(y)]);
    const at = ([x, y], z) => [x, y, z];
    ring.forEach((p, k) => {
      const q = ring[(k + 1) % ring.length];
      faces.push(at(p, low), at(q, low), at(q, high), at(p, low), at(q, high), at(p, high));
      edges.push([at(p, low), at(q, low)], [at(p, high), at(q, high)]);
      if (sharp(ring, k)) edges.push([at(p, low), at(p, high)]);
      if (k > 0 && k + 1 < ring.length) {
        for (const z of [low, high]) faces.push(at(ring[0], z), at(p, z), at(q, z));
      }
    });
  }

  /** Whether a corner of a polygon is one, and not a bit of a rounding. */
  function sharp(ring, k) {
    const n = ring.length;
    const a = less(ring[k], ring[(k + n - 1) % n]);
    const b = less(ring[(k + 1) % n], ring[k]);
    return Math.abs(Math.atan2(a[0] * b[1] - a[1] * b[0], dot2(a, b))) > 0.6;
  }

  const dot2 = (a, b) => a[0] * b[0] + a[1] * b[1];

  /** A head's solid relative to its nozzle: {faces: Float32Array, edges: [[a, b] ...]}. */
  function solidOf(head) {
    const faces = [];
    const edges = [];
    head.slices.forEach(({ height, polygons }, k) => {
      const above = head.slices[k + 1]?.height ?? height + ABOVE_MM;
      polygons.forEach((polygon) => prism(polygon, height, above, faces, edges));
    });
    head.bodies.forEach(({ min: [x0, y0, low], max: [x1, y1, high] }) => (
      prism([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], cutOff(low), cutOff(high), faces, edges)));
    return { faces: Float32Array.from(faces.flat()), edges };
  }

  /** The last action of a head that has begun by a time; -1: none. */
  const actionAt = (head, time) => D.lastUpTo(head.begin, time);

  /** Where a head's nozzle is at a time, and in which action (null: it stands). */
  function placeAt(page, head, time) {
    const action = actionAt(head, time);
    if (head.n === 0) return { at: null, action: null };
    const path = D.path(page, head, Math.max(0, action));
    const count = path.x.length;
    const point = (k) => [path.x[k], path.y[k], path.z[k]];
    if (action < 0) return { at: count ? point(0) : null, action: null };
    if (count === 0) return { at: null, action: null };
    const [begin, end] = [head.begin[action], head.end[action]];
    if (time >= end || count === 1) return { at: point(count - 1), action: time < end ? action : null };
    return { at: along(path, (time - begin) / (end - begin)), action };
  }

  /** The rectangle a head's slices pass over in an action, at the action's lowest height: [[x, y, z] ...]. */
  function reservedBy(page, head, action) {
    const path = D.path(page, head, action);
    const shape = page.machine.heads.find(({ name }) => name === head.name) ?? { slices: [] };
    const corners = shape.slices.flatMap(({ polygons }) => polygons.flat());
    const range = (values) => values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    const [x, y] = [path.x, path.y].map((along, k) => {
      const [a, b] = range(along), [c, d] = corners.length ? range(corners.map((p) => p[k])) : [0, 0];
      return [a + c, b + d];
    });
    const z = range(path.z)[0];
    return [[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z], [x[0], y[0], z]];
  }

  /** The point at a share of a path's length. */
  function along({ x, y, z }, share) {
    const steps = [];
    let length = 0;
    for (let k = 1; k < x.length; k++) {
      steps.push(Math.hypot(x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]));
      length += steps[k - 1];
    }
    let left = share * length;
    for (let k = 0; k < steps.length; k++) {
      if (left <= steps[k] || k === steps.length - 1) {
        const part = steps[k] > 0 ? Math.min(1, left / steps[k]) : 1;
        return [x, y, z].map((of) => of[k] + (of[k + 1] - of[k]) * part);
      }
      left -= steps[k];
    }
    return [x[0], y[0], z[0]];
  }

  D.bodies = { solidOf, placeAt, actionAt, reservedBy };
})();
