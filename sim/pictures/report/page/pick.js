"use strict";
// Which bead or travel is under the pointer: counted on the processor, so it is the same everywhere.
(() => {
  const NEAR_PX = 5;

  /**
   * The nearest segment to a place of the picture, of those in front.
   * @param {object} layer  {set, plan, begin, end} segments to look at, {now}, {wide} px of lines
   * @param {number} x,y  px from the middle of the picture, to the right and down
   */
  function nearest(camera, { set, plan, begin, end, now, wide, largest, skip }, x, y) {
    const { right, up, back } = D.camera.basis(camera);
    const { low, high } = set.box;
    const step = low.map((v, k) => (high[k] - v) / 65535);
    // Affine: px = offset + sum of quantised coordinates by these factors.
    const factor = (axis, by) => axis.map((v, k) => v * step[k] * by);
    const base = (axis, by) => D.camera.dot(axis, low.map((v, k) => v - camera.target[k])) * by;
    const [fx, fy, fz] = [factor(right, camera.zoom), factor(up, -camera.zoom), factor(back, 1)];
    const [ox, oy, oz] = [base(right, camera.zoom) - x, base(up, -camera.zoom) - y, base(back, 1)];
    const bytes = new Uint8Array(set.place.buffer, set.place.byteOffset);
    const shown = new Uint8Array(set.tint[plan].buffer, set.tint[plan].byteOffset);
    const [place, when] = [set.place, set.when[plan]];
    let best = null;
    for (let s = begin; s < end; s++) {
      const state = shown[4 * s + 3];
      if (state === 0 || (skip && state === D.beads.SHOWN.ghost)) continue;
      if (Math.min(when[2 * s], when[2 * s + 1]) >= now) continue;
      const k = 8 * s;
      const ax = ox + fx[0] * place[k] + fx[1] * place[k + 1] + fx[2] * place[k + 2];
      const bx = ox + fx[0] * place[k + 3] + fx[1] * place[k + 4] + fx[2] * place[k + 5];
      const half = wide ? wide : (bytes[2 * k + 12] / 255) * largest * camera.zoom * 0.5;
      const near = Math.max(half, NEAR_PX);
      if ((ax > near && bx > near) || (ax < -near && bx < -near)) continue;
      const ay = oy + fy[0] * place[k] + fy[1] * place[k + 1] + fy[2] * place[k + 2];
      const by = oy + fy[0] * place[k + 3] + fy[1] * place[k + 4] + fy[2] * place[k + 5];
      if ((ay > near && by > near) || (ay < -near && by < -near)) continue;
      const [dx, dy] = [bx - ax, by - ay];
      const share = Math.min(1, Math.max(0, -(ax * dx + ay * dy) / (dx * dx + dy * dy || 1)));
      const away = Math.hypot(ax + dx * share, ay + dy * share);
      if (away > near) continue;
      const depth = oz + fz[0] * place[k] + fz[1] * place[k + 1] + fz[2] * place[k + 2];
      const lit = state === D.beads.SHOWN.lit ? 1e6 : 0; // drawn before all others
      const found = { segment: s, depth: depth + lit - (away > half ? 2 * (away - half) : 0), away };
      if (!best || found.depth > best.depth) best = found;
    }
    return best;
  }

  /** The contour or travel a segment belongs to, as its place in drawing order. */
  const ownerOf = (first, segment) => D.lastUpTo(first, segment);

  D.pick = { nearest, ownerOf };
})();
