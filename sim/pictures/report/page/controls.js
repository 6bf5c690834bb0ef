"use strict";
// The controls around the view: what is shown, camera, layers, time, legend.
(() => {
  const SPEEDS = [1, 10, 60, 300, 1000, 3000];
  const DENSE = 500; // beads; of more, what changed is shown layer by layer at first
  const SHOW_S = 90; // in which a print is played at most at first
  const COLOURS = { role: "role", head: "head", tool: "tool", layer: "layer", time: "time", speed: "speed", change: "change in order" };
  /** Names of the plans: the first is the source's own order, one made safe, or of a run what was planned. */
  const plansOf = (plans) => {
    const [before, after] = plans.map(({ label }) => label[0].toUpperCase() + label.slice(1));
    return { before, after, both: "Side by side" };
  };

  const { element } = { element: (...given) => D.element(...given) };
  let [page, layers, end] = [null, [0, 0], 0];
  const shown = []; // functions that bring controls in line with the state

  const button = (text, attributes, act) => {
    const made = element("button", { type: "button", ...attributes }, text);
    made.addEventListener("click", act);
    return made;
  };

  /** A button that switches a key of the state. */
  function toggle(key, text, title, act = () => D.state.set({ [key]: !D.state.get()[key] })) {
    const made = button(text, { id: `view-${key}`, title }, act);
    shown.push((now) => made.setAttribute("aria-pressed", String(Boolean(now[key]))));
    return made;
  }

  /** Buttons of which one is chosen. */
  function choice(key, names, label) {
    const made = Object.entries(names).map(([value, text]) => {
      const each = button(text, { id: `view-${key}-${value}` }, () => D.state.set({ [key]: value }));
      shown.push((now) => each.setAttribute("aria-pressed", String(now[key] === value)));
      return each;
    });
    return element("div", { class: "view-choice", role: "group", "aria-label": label }, ...made);
  }

  function selection(id, label, options, value, act) {
    const made = element("select", { id }, ...options.map(([v, text]) => element("option", { value: v }, text)));
    made.value = value;
    made.addEventListener("change", () => act(made.value));
    return [element("span", { class: "view-pair" }, element("label", { for: id }, label), made), made];
  }

  function slider(id, label, low, high, step, act) {
    const made = element("input", { id, type: "range", min: low, max: high, step, "aria-label": label });
    made.addEventListener("input", () => act(Number(made.value)));
    return made;
  }

  function playOrPause() {
    const { playing, time } = D.state.get();
    D.state.set({ playing: !playing, time: !playing && time >= end ? 0 : time });
  }

  function timeRow() {
    const play = button("Play", { id: "view-play" }, playOrPause);
    const time = slider("view-time", "time", 0, end, "any", (v) => D.state.set({ time: v, playing: false }));
    time.step = Math.max(end / 2000, 0.1);
    time.max = end;
    const text = element("output", { class: "number", for: "view-time" });
    const speeds = SPEEDS.map((v) => [v, `${v}× as fast`]);
    const [pair, speed] = selection("view-speed", "Speed", speeds, "", (v) => D.state.set({ speed: Number(v) }));
    shown.push((now) => {
      play.textContent = now.playing ? "Pause" : "Play";
      time.value = now.time >= end ? end : now.time;
      text.textContent = `${D.format.clock(Math.min(now.time, end))} of ${D.format.clock(end)}`;
      time.setAttribute("aria-valuetext", text.textContent);
      speed.value = String(now.speed);
    });
    return element("div", {}, element("div", { class: "view-row view-time" }, play, time, text, pair), clockNote());
  }

  /** Whose clock this is, where the times on the first screen are of whole files. */
  function clockNote() {
    if (page.facts.time.of !== "whole file") return "";
    const ends = page.plans.map((plan) => `${D.format.clock(plan.end_s)} ${plan.label}`).join(", ");
    return element("p", { id: "view-clock", class: "note" }, `This clock is the plan's: ${ends}, from park to park. ` +
      "The times above are estimated from all lines of the files, start and end included, so they differ a little.");
  }

  /** Both ends of the layers as sliders over a strip that shows travel by layer. */
  function layerRow() {
    const [low, high] = layers;
    const set = (from, to) => D.state.set({ layers: [Math.min(from, to), Math.max(from, to)] });
    const from = slider("view-layer-from", "first layer shown", low, high, 1, (v) => set(v, D.state.get().layers[1]));
    const to = slider("view-layer-to", "last layer shown", low, high, 1, (v) => set(D.state.get().layers[0], v));
    const text = element("output", { class: "number", for: "view-layer-from view-layer-to" });
    const single = button("One layer", { id: "view-one" }, () => {
      const now = D.state.get().layers;
      D.state.set({ layers: now[0] === now[1] ? layers.slice() : [now[1], now[1]] });
    });
    const most = button("Most changed", { id: "view-most", title: "the layer in which travel changed most" }, mostChanged);
    shown.push(({ layers: [a, b] }) => {
      [from.value, to.value] = [a, b];
      text.textContent = a === b ? `layer ${a + 1} of ${high + 1}` : `layers ${a + 1} to ${b + 1} of ${high + 1}`;
      from.setAttribute("aria-valuetext", `layer ${a + 1}`);
      to.setAttribute("aria-valuetext", `layer ${b + 1}`);
      single.setAttribute("aria-pressed", String(a === b));
    });
    const strip = element("canvas", { id: "view-strip", role: "img", "aria-label": `Travel in each layer, ${page.plans[0].label} and ${page.plans[1].label}` });
    const words = element("span", { class: "view-bars muted" }, "travel in each layer:", element("i", { class: "was" }),
      page.plans[0].label, element("i", {}), page.plans[1].label);
    return element("div", { class: "view-row view-layers" }, element("span", {}, "Layers"),
      element("div", { class: "view-range" }, strip, from, to), text, single, most, words);
  }

  let travelled = null;

  function mostChanged() {
    const k = page.saving.most_changed;
    D.state.set({ layers: [k, k], changed: true, plans: "both", time: end, playing: false });
  }

  /** Light up what changed, or no more; of a dense print one layer, where all hide each other. */
  function showChanges() {
    const { changed, layers: [from, to] } = D.state.get();
    const whole = from === layers[0] && to === layers[1] && from < to;
    if (!changed && whole && page.contours.n > DENSE) mostChanged();
    else D.state.set({ changed: !changed, ...(changed && from === to ? { layers: layers.slice() } : {}) });
  }

  /** Move the shown layers up or down by one. */
  function stepLayer(by) {
    const [a, b] = D.state.get().layers;
    if (a === b || (a + by >= layers[0] && b + by <= layers[1])) {
      const [x, y] = [a + by, b + by];
      if (x >= layers[0] && y <= layers[1]) D.state.set({ layers: [x, y] });
    } else D.state.set({ layers: [a, Math.min(layers[1], Math.max(a, b + by))] });
  }

  /** Travel of each layer: before as a bar, after as a bar in front of it. */
  function drawStrip() {
    const strip = document.getElementById("view-strip");
    if (!strip || !travelled) return;
    const ratio = window.devicePixelRatio || 1;
    [strip.width, strip.height] = [strip.clientWidth * ratio, strip.clientHeight * ratio];
    const c = strip.getContext("2d");
    const count = travelled[0].length;
    const most = Math.max(1e-9, ...travelled.flatMap((of) => [...of]));
    [["--gone", 0], ["--new", 1]].forEach(([name, p]) => {
      c.fillStyle = D.colour(name);
      c.globalAlpha = p ? 1 : 0.45;
      for (let k = 0; k < count; k++) {
        const h = Math.round((travelled[p][k] / most) * strip.height);
        const [x0, x1] = [k, k + 1].map((v) => Math.round((v * strip.width) / count));
        c.fillRect(x0, strip.height - h, Math.max(1, x1 - x0), h);
      }
    });
    c.fillStyle = D.colour("--gone"); // where there is more now, before is a line in front of it
    for (let k = 0; k < count; k++) {
      const y = strip.height - Math.round((travelled[0][k] / most) * strip.height);
      const [x0, x1] = [k, k + 1].map((v) => Math.round((v * strip.width) / count));
      if (travelled[0][k] < travelled[1][k]) c.fillRect(x0, Math.min(y, strip.height - ratio), Math.max(1, x1 - x0), ratio);
    }
  }

  /** Names of colours; an entry is a button that dims what it names. */
  function legendInto(box, recolour) {
    const row = (key, swatch, text, off) => {
      const made = button("", { class: "view-entry", "aria-pressed": String(!off.has(key)) }, () => {
        if (!off.delete(key)) off.add(key);
        recolour();
      });
      made.append(swatch, text);
      return made;
    };
    const swatch = (rgb, kind = "") => element("i", { class: kind, style: `--c:${D.colours.css(rgb)}` });
    return (legend) => {
      if (!legend) return;
      const active = document.activeElement?.textContent;
      if (legend.mode === "changed") box.replaceChildren(...changesRows(legend, row, swatch));
      else if (legend.gradient) box.replaceChildren(...rampRows(legend, row, swatch));
      else box.replaceChildren(...legend.entries.map(({ name, rgb }, k) => row(k, swatch(rgb), name, legend.off)));
      const told = (rgb, text, kind) => box.append(element("span", { class: "view-entry" }, swatch(rgb, kind), text));
      for (const { name, rgb, dash } of legend.travels ?? []) told(rgb, name, dash ? "line dashed" : "line");
      for (const { name, rgb } of legend.cuts ?? []) told(rgb, name);
      if (legend.bodies) told(D.colours.named("--head0"), "frames: bodies of the heads; on the bed, the space a head needs now", "frame");
      for (const [name, rgb, count = 1] of legend.selected) {
        const text = count > 1 ? `${name}: ${D.format.count(count, "bead")}${count > D.view.MOST ? `, ${D.view.MOST} drawn` : ""}` : name;
        told(rgb, text);
      }
      [...box.querySelectorAll("button")].find((each) => each.textContent === active)?.focus();
    };
  }

  function changesRows(legend, row, swatch) {
    const sums = legend.sums();
    return D.changes.KINDS.flatMap(({ key, name, colour, dash, plan }) => {
      const { count, mm } = sums[key];
      const text = plan === undefined ? `${name}: ${D.format.count(count, "bead")}`
        : `${name}: ${D.format.number(count)}, ${D.format.mm(mm)}`;
      return count || plan === 0 ? [row(key, swatch(D.colours.named(colour), plan === undefined ? "" : dash ? "line dashed" : "line"), text, legend.off)] : [];
    });
  }

  function rampRows(legend, row, swatch) {
    const ramp = element("span", { class: "view-ramp" }, legend.ramp[0],
      element("i", { style: `background:${legend.gradient}` }), legend.ramp[1]);
    const named = legend.entries.flatMap(({ name, rgb }, k) => (name ? [row(k, swatch(rgb), name, legend.off)] : []));
    return [ramp, ...named];
  }

  function camera(acts) {
    const to = (name, text, key) => button(text, { id: `view-to-${name}`, title: `key ${key}` }, () => acts.turnTo(name));
    return element("div", { class: "view-choice", role: "group", "aria-label": "Camera" },
      to("iso", "Slanted", "I"), to("top", "Top", "T"), to("front", "Front", "F"), to("right", "Right", "R"),
      button("Fit", { id: "view-fit", title: "key 0" }, acts.fit));
  }

  const KEYS = "Drag to turn, Shift and drag to move, wheel to zoom once clicked; two fingers move and zoom. " +
    "Keys in the picture: arrows turn, Shift and arrows move, + and - zoom, T F R I views, 0 fits, space plays, " +
    "Page Up and Page Down go through layers, N and P through a head's actions, Z goes near the selected one, B compares, C shows what changed, V travels, Escape selects nothing.";

  /** Ways of colouring; clusters where the page has them. */
  const coloured = () => [...Object.entries(COLOURS), ...(page.contours.cluster ? [["cluster", "cluster of the graph"]] : [])];

  function bar(acts) {
    const [pair, colours] = selection("view-colour", "Colour by", coloured(), "role",
      (v) => D.state.set({ colour: v, changed: false }));
    shown.push((now) => { colours.value = now.colour; });
    return element("div", { class: "view-row" }, choice("plans", plansOf(page.plans), "Plans shown"), pair,
      toggle("changed", "What changed", "lights up what changed, dims the rest", showChanges),
      toggle("travels", "Travels", "shows travels too"),
      toggle("bodies", "Heads", "shows the heads' bodies while they move"),
      page.cuts ? toggle("cuts", "Cuts", "marks the places at which contours are cut") : "", camera(acts));
  }

  /** Build the section; returns what the view writes into. */
  function make(of, acts) {
    page = of;
    end = Math.max(...page.plans.map((plan) => plan.end_s));
    layers = D.state.get().layers;
    D.state.set({ speed: SPEEDS.find((v) => end / v <= SHOW_S) ?? SPEEDS[SPEEDS.length - 1] });
    const section = document.getElementById("view");
    const stage = element("div", { class: "view-stage" },
      element("canvas", { id: "view-canvas", tabindex: 0, role: "img", "aria-label": "The print in three dimensions; keys turn, move and step", "aria-describedby": "view-keys" }),
      element("div", { id: "view-labels", "aria-hidden": "true" }));
    const legend = element("div", { id: "view-legend", role: "group", "aria-label": "Legend: each entry dims what it names" });
    const drawn = element("span", { id: "view-drawn", class: "muted" }, "Preparing the picture…");
    section.replaceChildren(element("h2", {}, "The print"), element("div", { class: "panel" },
      bar(acts), stage, legend, layerRow(), timeRow(), drawn,
      element("details", { class: "note" }, element("summary", {}, "Mouse, touch and keys"), element("p", { id: "view-keys" }, KEYS))));
    const follow = (now) => shown.forEach((each) => each(now));
    D.state.on((now, was) => {
      follow(now);
      if (now.theme !== was.theme) drawStrip();
    });
    follow(D.state.get());
    return {
      drawn,
      legend: legendInto(legend, acts.recolour),
      begun(scene) {
        travelled = D.layers.travelled(scene);
        drawStrip();
        new ResizeObserver(drawStrip).observe(document.getElementById("view-strip"));
      },
      missing(error) {
        stage.replaceChildren(element("p", { class: "warning" },
          `This browser cannot draw the print: it offers no WebGL (${String(error.message).split("\n")[0]}). The rest of the report works.`));
        drawn.textContent = "";
      },
    };
  }

  D.controls = { make, playOrPause, showChanges, stepLayer };
})();
