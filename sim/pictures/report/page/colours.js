"use strict";
// Colours of beads and travels, and the legend that names them.
(() => {
  const STEPS = 48;
  const OF_ROLES = [
    "#9aa0a6", "#e8803a", "#dfb83c", "#4a63c9", "#b4453c", "#8f63c4", "#d9534f", "#4f8fc2",
    "#c3b9a4", "#e592a8", "#2f8f80", "#63b160", "#3b7d46", "#a9c4a4", "#5fc296",
  ];
  const OF_TOOLS = ["#4f8fc2", "#d98f2b", "#5aa469", "#b562a7", "#c9584c", "#6a6fc7", "#8c8c3e", "#3d9a9c"];
  // Dark blue over green to yellow: grows steadily lighter, so it reads without colour too.
  const RAMP = [[59, 67, 135], [43, 104, 142], [33, 141, 141], [46, 175, 122], [127, 202, 80], [226, 208, 66]];
  // Earlier is blue, later is orange, by the same lightness; between them grey.
  const TURN = [[44, 104, 190], [126, 166, 214], [176, 178, 182], [226, 164, 102], [206, 102, 20]];

  let context = null;
  /** [r, g, b] of any colour CSS knows. */
  function parsed(css) {
    context ??= document.createElement("canvas").getContext("2d");
    context.fillStyle = css;
    const text = context.fillStyle;
    if (text[0] === "#") return [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16));
    return text.match(/[\d.]+/g).slice(0, 3).map(Number);
  }

  const named = (name) => parsed(D.colour(name));
  const mixed = (a, b, share) => a.map((v, k) => v + (b[k] - v) * share);
  const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;
  const packed = (rgb, shown) =>
    ((shown << 24) | (Math.round(rgb[2]) << 16) | (Math.round(rgb[1]) << 8) | Math.round(rgb[0])) >>> 0;

  function onRamp(ramp, share) {
    const at = Math.min(0.9999, Math.max(0, share)) * (ramp.length - 1);
    return mixed(ramp[Math.floor(at)], ramp[Math.floor(at) + 1], at % 1);
  }

  const used = (values, most) => {
    const found = new Uint8Array(most);
    for (const v of values) if (v >= 0) found[v] = 1;
    return [...found.keys()].filter((v) => found[v]);
  };

  /** A legend of kinds: {entries: [{name, rgb, count}], of: (contour, plan) => entry or -1}. */
  function kinds(names, rgbs, present, of) {
    const place = new Map(present.map((v, k) => [v, k]));
    return {
      entries: present.map((v) => ({ name: names(v), rgb: rgbs(v) })),
      of: (c, p) => place.get(of(c, p)) ?? -1,
    };
  }

  /** A legend of a measure: a ramp from `low` to `high`. */
  function measure(low, high, words, of, ramp = RAMP) {
    const span = Math.max(high - low, 1e-9);
    return {
      ramp: words.map((text) => text),
      entries: Array.from({ length: STEPS }, (_, k) => ({ rgb: onRamp(ramp, k / (STEPS - 1)) })),
      of: (c, p) => Math.round(Math.min(1, Math.max(0, (of(c, p) - low) / span)) * (STEPS - 1)),
      gradient: `linear-gradient(90deg, ${ramp.map(css).join(", ")})`,
    };
  }

  const actionOf = (scene, c, p) => {
    const { head, action } = scene.by[p];
    return head[c] < 0 ? null : { of: scene.page.plans[p].heads[head[c]], k: action[c] };
  };

  const beginOf = (scene) => (c, p) => {
    const at = actionOf(scene, c, p);
    return at ? at.of.begin[at.k] : 0;
  };

  /** mm/s of each contour in a plan: its length by its time, (n,). */
  function speeds(scene, p) {
    const { offsets, x, y, z } = scene.page.contours;
    return Float32Array.from({ length: scene.page.contours.n }, (_, c) => {
      const at = actionOf(scene, c, p);
      if (!at) return 0;
      let length = 0;
      for (let k = offsets[c] + 1; k < offsets[c + 1]; k++) {
        length += Math.hypot(x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]);
      }
      return length / Math.max(at.of.end[at.k] - at.of.begin[at.k], 1e-3);
    });
  }

  const MODES = {
    role: (scene) => {
      const { role, n } = scene.page.contours;
      return kinds((r) => scene.page.roles[r] || `role ${r}`, (r) => parsed(OF_ROLES[r] || OF_ROLES[0]),
        n ? used(role, 256) : [], (c) => role[c]);
    },
    head: (scene) => {
      const names = [...new Set(scene.page.plans.flatMap((plan) => plan.heads.map((h) => h.name)))];
      const of = scene.page.plans.map((plan) => plan.heads.map((h) => names.indexOf(h.name)));
      const colour = names.map((name) => scene.page.plans.flatMap((plan) => plan.heads)
        .filter((h) => h.name === name).pop().colour);
      return kinds((k) => `printed by ${names[k]}`, (k) => named(`--head${colour[k] % 8}`),
        [...names.keys()], (c, p) => of[p][scene.by[p].head[c]] ?? -1);
    },
    tool: (scene) => {
      const { tool } = scene.page.contours;
      const present = used(tool, 256);
      return kinds((t) => `tool ${t}`, (t) => parsed(OF_TOOLS[t % OF_TOOLS.length]), present, (c) => tool[c]);
    },
    cluster: (scene) => {
      const { cluster } = scene.page.contours, many = OF_TOOLS.length;
      const present = [...new Set(cluster.map((k) => k % many))].sort((a, b) => a - b);
      return kinds((k) => `clusters ${k + 1}, ${k + 1 + many}, …`, (k) => parsed(OF_TOOLS[k]), present, (c) => cluster[c] % many);
    },
    layer: (scene) => {
      const [low, high] = scene.layers;
      return measure(low, high, [`layer ${low + 1}`, `layer ${high + 1}`],
        (c) => scene.page.contours.layer[c]);
    },
    time: (scene) => {
      const end = Math.max(...scene.page.plans.map((plan) => plan.end_s));
      return measure(0, end, ["printed at 0:00:00", `at ${D.format.clock(end)}`], beginOf(scene));
    },
    speed: (scene) => {
      const of = scene.page.plans.map((_, p) => speeds(scene, p));
      const sorted = Float32Array.from(of.flatMap((v) => [...v])).sort();
      const at = (share) => sorted[Math.floor(share * (sorted.length - 1))] || 0;
      const [low, high] = [at(0.01), at(0.99)];
      return measure(low, high, [`${D.format.number(Math.round(low))} mm/s`,
        `${D.format.number(Math.round(high))} mm/s`], (c, p) => of[p][c]);
    },
    change: (scene) => {
      const { shift, other } = D.changes.ofContours(scene);
      const was = scene.page.run ? "planned" : "before";
      const found = measure(-0.5, 0.5, [`printed earlier than ${was}`, "later"],
        (c) => Math.sign(shift[c]) * Math.sqrt(Math.abs(shift[c])) * 0.75, TURN);
      if (!other.some(Boolean)) return found;
      found.entries.push({ name: `printed by another head than ${was}`, rgb: named("--other") });
      return { ...found, of: (c, p) => (other[c] ? STEPS : found.of(c, p)) };
    },
  };

  D.colours = { MODES, parsed, named, mixed, packed, css };
})();
