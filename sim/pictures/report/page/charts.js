"use strict";
/* Lines and bars: how the search came closer, where the saving comes from, how heads agreed. */
(() => {
  const e = D.element;
  const HEIGHT = 260;
  const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3]];
  const EVEN = 2; // times the mean: where the best layers save less than that each, none stands out
  const GROUPS = 120; // points of a chart by layer
  const FLAT = { size: 34 }; // height of the numbers along x
  const kept = []; // charts drawn anew with the theme

  /**
   * Make a chart with what it says in words, and its numbers as a table.
   * @param {{title: string, said: string|null, label: string, table: function, options: function, data: Array}} chart
   *   `options()` is asked again when the theme changes
   */
  function figure({ title, said, label, table, options, data }) {
    const box = e("div", { class: "chart", role: "img", "aria-label": label });
    const made = e("figure", { class: "panel" },
      e("figcaption", {}, e("h3", {}, title), said ? e("p", {}, said) : null),
      box, table ? D.folded("These numbers as a table", table) : null);
    const entry = { plot: null };
    entry.draw = () => {
      if (entry.plot) entry.plot.destroy();
      const wide = Math.max(220, box.clientWidth);
      entry.plot = new uPlot({ width: wide, height: HEIGHT, ...options() }, data, box);
      for (const row of box.querySelectorAll(".u-legend")) row.setAttribute("role", "presentation");
    };
    new ResizeObserver(() => {
      const wide = Math.max(220, box.clientWidth);
      if (!entry.plot) entry.draw();
      else if (entry.plot.width !== wide) entry.plot.setSize({ width: wide, height: HEIGHT });
    }).observe(box);
    kept.push(entry);
    return made;
  }

  const axis = (label, more = {}) => ({
    label, stroke: D.colour("--fg"), font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif",
    labelSize: 18, grid: { stroke: D.colour("--line"), width: 1 }, ticks: { stroke: D.colour("--line"), width: 1 }, ...more,
  });

  const line = (label, colour, more = {}) => ({
    label, stroke: colour, width: 2, points: { show: false }, ...more,
  });

  const number = (u, value) => (value === null || value === undefined ? "–" : D.format.number(value));
  /** Numbers along an axis, as exact as they are apart. */
  const wide = (u, values, k, space, apart) => {
    const digits = Math.max(0, -Math.floor(Math.log10(apart) + 1e-9));
    return values.map((v) => (v === null ? "" : v.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits })));
  };

  /** A dashed line with its name across the chart. */
  const bound = (value, text) => ({
    hooks: {
      draw: [(u) => {
        const { ctx } = u, { left, width } = u.bbox, ratio = uPlot.pxRatio;
        const y = Math.round(u.valToPos(value, "y", true)) + 0.5;
        ctx.save();
        ctx.strokeStyle = ctx.fillStyle = D.colour("--good");
        ctx.lineWidth = 2 * ratio;
        ctx.setLineDash([8 * ratio, 5 * ratio]);
        ctx.beginPath();
        ctx.moveTo(left, y);
        ctx.lineTo(left + width, y);
        ctx.stroke();
        ctx.font = `${12 * ratio}px system-ui, sans-serif`;
        ctx.textAlign = "right";
        ctx.fillText(text, left + width - 4 * ratio, y - 6 * ratio);
        ctx.restore();
      }],
    },
  });

  const unitOf = (minimised) => (minimised.endsWith(", s") ? "s" : "mm");
  const shown = (value, unit) => (unit === "s" ? D.format.duration(value) : D.format.mm(value));

  /** Best so far over the time of the search, above what no plan can be better than. */
  function convergence(page) {
    const { history } = page;
    const unit = unitOf(history.minimised);
    const s = [0, ...history.s], cost = [history.cost[0], ...history.cost];
    const first = cost[0], best = cost[cost.length - 1], low = history.bound || best;
    const from = history.s.length ? history.s[history.s.length - 1] : 0;
    const what = history.minimised.replace(/, (s|mm)$/, "");
    const said = [`The search brought the ${what} from ${shown(first, unit)} down to ${shown(best, unit)}; its last gain came after ${D.format.duration(from)}.`];
    const { end_s } = page.plans[1];
    if (page.plans[1].heads.length > 1 && end_s / best > 1.005) {
      said.push(`With all its stops, the finished plan takes ${D.format.duration(end_s)}.`);
    }
    if (history.cooled) said.push("After the search, beads that would be printed over too soon are moved back, so the plan may end higher than the curve.");
    const space = 0.12 * (Math.max(first, low) - Math.min(best, low)) + 1e-3 * Math.max(first, low);
    return figure({
      title: "How the search came closer",
      said: said.join(" "),
      label: `Best ${what} over the seconds of the search: from ${shown(first, unit)} to ${shown(best, unit)}`,
      data: [s, cost],
      table: () => D.table("Each gain of the search", ["second of the search", history.minimised], thin(s.map((t, k) => [`${t.toFixed(2)} s`, cost[k]]))),
      options: () => ({
        scales: { x: { time: false }, y: { range: [Math.min(best, low) - space, Math.max(first, low) + space] } },
        axes: [axis("seconds of search", FLAT), axis(history.minimised, { size: 70, values: wide })],
        series: [{ label: "second", value: (u, v) => (v === null ? "–" : v.toFixed(2)) },
          line("best so far", D.colour("--accent"), { paths: uPlot.paths.stepped({ align: 1 }), value: number })],
        plugins: history.bound ? [bound(history.bound, `proven bound ${shown(history.bound, unit)}`)] : [],
      }),
    });
  }

  /** At most 200 rows, both ends among them. */
  function thin(rows) {
    const step = Math.ceil(rows.length / 200);
    return rows.filter((row, k) => k % step === 0 || k === rows.length - 1);
  }

  const sum = (values) => values.reduce((total, value) => total + value, 0);

  /** The part of the saving that the best few of `n` parts make up. */
  function bestParts(saved, few) {
    const order = saved.map((mm, k) => [mm, k]).sort((a, b) => b[0] - a[0]).slice(0, few).filter(([mm]) => mm > 0);
    return { mm: sum(order.map(([mm]) => mm)), parts: order.map(([, k]) => k).sort((a, b) => a - b) };
  }

  /** Layers as ranges: "1–3, 7". */
  function ranges(parts) {
    const runs = [];
    for (const k of parts) {
      const run = runs[runs.length - 1];
      if (run && run[1] === k - 1) run[1] = k; else runs.push([k, k]);
    }
    return runs.map(([a, b]) => (a === b ? `${a + 1}` : `${a + 1}–${b + 1}`)).join(", ");
  }

  /** Means over so many layers each that the chart stays legible. */
  function grouped(n, columns) {
    const per = Math.ceil(n / GROUPS), count = Math.ceil(n / per);
    const first = Array.from({ length: count }, (_, g) => g * per);
    const mean = (values) => first.map((k) => sum(values.slice(k, k + per)) / Math.min(per, n - k));
    return { per, data: [first.map((k) => k + 1), ...columns.map(mean)] };
  }

  const savedMm = ({ saving: { by_layer: { before, after } } }) => sum(before) - sum(after);

  /** In which layers the saving is: the few best ones, and how much of it they have. */
  function placed(saved, total) {
    const { mm, parts } = bestParts(saved, Math.max(1, Math.min(10, Math.ceil(saved.length / 10))));
    if (saved.length < 2) return "";
    const names = parts.length === 1 ? "layer" : "layers";
    if (mm > total) return `: ${D.format.mm(mm)} less in ${names} ${ranges(parts)}, and more in others`;
    const even = mm / parts.length < (EVEN * total) / saved.length && saved.length > 20;
    return even ? `, spread over all layers: the ${parts.length} that save most have ${D.format.mm(mm)} of it`
      : `: ${D.format.mm(mm)} of it in ${names} ${ranges(parts)}`;
  }

  function byLayer({ by_layer: { layer, before, after } }) {
    const saved = before.map((each, k) => each - after[k]), total = sum(saved);
    const where = placed(saved, total);
    const means = grouped(layer.length, [before, after]);
    const said = Math.abs(total) < 1 ? "As much travel between beads as before." : total > 0
      ? `${D.format.mm(total)} of travel less between beads${where}.`
      : `${D.format.mm(-total)} of travel more between beads: that is no saving of travel.`;
    const label = D.page.plans[0].label;
    return figure({
      title: total >= 1 ? "Saving by layer" : "Travel by layer",
      said,
      label: `Travel between beads in each layer, ${label} and after`,
      data: means.data,
      table: () => D.table("Travel by layer", ["layer", `${label}, mm`, "after, mm"], thin(layer.map((k, i) => [String(k + 1), before[i], after[i]]))),
      options: () => ({
        scales: { x: { time: false }, y: { range: (u, low, high) => [0, 1.05 * high || 1] } },
        axes: [axis("layer", { ...FLAT, values: (u, values) => values.map((v) => (Number.isInteger(v) ? v : "")) }), axis(means.per > 1 ? `travel in a layer, mm (mean of ${means.per})` : "travel, mm", { size: 64, values: wide })],
        series: [{ label: "layer", value: (u, v) => (v === null ? "–" : String(v)) },
          line(label, D.colour("--muted"), { dash: [5, 4], paths: uPlot.paths.stepped({ align: 1 }), value: number }),
          line("after", D.colour("--accent"), { fill: tint(), paths: uPlot.paths.stepped({ align: 1 }), value: number })],
      }),
    });
  }

  const tint = () => `color-mix(in srgb, ${D.colour("--accent")} 22%, transparent)`;

  /** Names of bins: "under 1", "1 to 2", …, "over 200". */
  const bins = (edges, n) =>
    Array.from({ length: n }, (_, k) => (k + 1 < edges.length ? (edges[k] ? `${edges[k]}–${edges[k + 1]}` : `<${edges[k + 1]}`) : `>${edges[k]}`));

  function byLength({ by_length: { edges_mm, before, after, before_mm, after_mm } }) {
    const names = bins(edges_mm, before.length), label = D.page.plans[0].label;
    const saved = before_mm.map((mm, k) => mm - after_mm[k]), total = sum(saved);
    const changed = saved.map((mm) => (total < 0 ? -mm : mm));
    const most = changed.indexOf(Math.max(...changed));
    const said = Math.abs(total) < 1 ? null : `Most of the ${total < 0 ? "increase" : "saving"} is in travels of ${names[most]} mm: ${D.format.mm(changed[most])}. There were ${D.format.number(before[most])} of them, there are ${D.format.number(after[most])} now.`;
    const bar = (align) => uPlot.paths.bars({ size: [0.42, 60], align });
    return figure({
      title: total >= 1 ? "Saving by length of travel" : "Travel by length",
      said,
      label: `Travel in all by the length of single travels, ${label} and after`,
      data: [names.map((_, k) => k), before_mm, after_mm],
      table: () => D.table("Travel by length", ["length, mm", `${label}, travels`, "after, travels", `${label}, mm`, "after, mm"],
        names.map((name, k) => [name, before[k], after[k], before_mm[k], after_mm[k]])),
      options: () => ({
        scales: { x: { time: false, range: [-0.6, names.length - 0.4] }, y: { range: (u, low, high) => [0, 1.05 * high || 1] } },
        axes: [axis("length of a travel, mm", { ...FLAT, splits: names.map((_, k) => k), values: (u) => tickNames(u, names), grid: { show: false } }),
          axis("travel in all, mm", { size: 64, values: wide })],
        series: [{ label: "length, mm", value: (u, v) => (v === null ? "–" : names[v]) },
          line(label, D.colour("--muted"), { width: 1, fill: hatch, paths: bar(-1), value: number }),
          line("after", D.colour("--accent"), { width: 1, fill: D.colour("--accent"), paths: bar(1), value: number })],
      }),
    });
  }

  const tickNames = (u, names) => names.map((name, k) => (u.width > 520 || k % 2 === 0 ? name : ""));
  const hatch = (u) => D.pattern(u.ctx, "waits", D.colour("--muted"), D.colour("--panel"));

  /** How the heads agreed: their distributions get sharper until one plan is left. */
  function team(told) {
    const agents = told.agents || [];
    const parts = [e("h3", {}, "How the heads agreed")];
    if (told.found_by) parts.push(e("p", {}, `The plan they kept was found by ${told.found_by}.`));
    if (told.entropy && told.entropy.length && told.rounds_s.length > 1) parts.push(sharpening(told));
    if (agents.length) parts.push(agentTable(agents));
    return e("div", {}, ...parts);
  }

  function sharpening(told) {
    const names = told.entropy.map((_, k) => D.words.headName(k));
    const last = (values) => values[values.length - 1].toFixed(2);
    const changes = told.entropy.map((row, k) => `${names[k]} went from ${row[0].toFixed(2)} to ${last(row)}`);
    return figure({
      title: "How sure each head is of what it will do",
      said: `Each head keeps several plans, each with a probability. 1: all are as likely; 0: one is chosen. ${changes.join(", ")}.`,
      label: "Entropy of each head's distribution over the time of the search",
      data: [told.rounds_s, ...told.entropy],
      table: () => D.table("Entropy by round", ["second", ...names], thin(told.rounds_s.map((s, k) => [`${s.toFixed(2)} s`, ...told.entropy.map((row) => row[k].toFixed(3))]))),
      options: () => ({
        scales: { x: { time: false }, y: { range: [0, 1.02] } },
        axes: [axis("seconds of search", FLAT), axis("entropy, share of the most", { size: 50 })],
        series: [{ label: "second", value: (u, v) => (v === null ? "–" : v.toFixed(2)) },
          ...names.map((name, k) => line(name, D.colour(`--head${k % 8}`), { dash: DASHES[k % DASHES.length], paths: uPlot.paths.stepped({ align: 1 }), value: (u, v) => (v === null ? "–" : v.toFixed(2)) }))],
      }),
    });
  }

  const COUNTS = [["rounds", "rounds"], ["samples", "plans tried"], ["sent", "messages sent"], ["sent_bytes", "bytes sent"], ["received", "messages received"], ["dropped", "dropped"]];

  function agentTable(agents) {
    const columns = COUNTS.filter(([key]) => agents.some((agent) => typeof agent[key] === "number"));
    const rows = agents.map((agent) => [String(agent.head || agent.name), ...columns.map(([key]) => agent[key] ?? "–")]);
    return D.table("What each head's agent did", ["head", ...columns.map(([, text]) => text)], rows);
  }

  function show(page) {
    const section = document.getElementById("search");
    const made = [];
    if (page.saving.by_layer.layer.length && !page.run) made.push(byLayer(page.saving), byLength(page.saving));
    if (page.history.s.length && !page.facts.kept_source) made.push(convergence(page));
    if (!made.length) return;
    section.append(e("h2", {}, savedMm(page) >= 1 ? "Where the saving comes from" : "Travel and search"), e("div", { class: "figures" }, ...made));
    if (page.graph && D.orderGraph) section.append(D.orderGraph.folded(page));
    D.state.on((now, was) => { if (now.theme !== was.theme) kept.forEach((entry) => entry.draw()); });
  }

  D.charts = { show, team, kept };
})();
