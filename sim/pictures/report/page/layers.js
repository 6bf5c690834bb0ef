"use strict";
// Layers: how high each one ends, and travel of both plans in each.
(() => {
  /** A function: highest z of the layers up to one, mm. */
  function tops(scene) {
    const { layer, offsets, z, n } = scene.page.contours;
    const [low, high] = scene.layers;
    const top = new Float32Array(high - low + 1);
    for (let c = 0; c < n; c++) {
      const at = layer[c] - low;
      for (let k = offsets[c]; k < offsets[c + 1]; k++) if (z[k] > top[at]) top[at] = z[k];
    }
    for (let k = 1; k < top.length; k++) top[k] = Math.max(top[k], top[k - 1]);
    return (upTo) => top[Math.min(top.length - 1, Math.max(0, upTo - low))] ?? 0;
  }

  /** Travel in mm in each layer: [before, after], from the first layer on. */
  function travelled({ page, layers: [low, high] }) {
    const { before, after } = page.saving.by_layer;
    return [before, after].map((mm) => mm.slice(low, high + 1));
  }

  D.layers = { tops, travelled };
})();
