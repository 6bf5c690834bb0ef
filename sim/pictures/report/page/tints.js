"use strict";
// Which colour everything in the view has now: beads, travels, heads, bed; and the legend of it.
(() => {
  const { SHOWN } = D.beads;
  const GRID_MM = 50;

  /** Legend entries switched off, by what is coloured. */
  const off = new Map();

  function offIn(mode) {
    if (!off.has(mode)) {
      off.set(mode, new Set(mode === "changed"
        ? D.changes.KINDS.filter(({ on }) => !on).map(({ key }) => key) : []));
    }
    return off.get(mode);
  }

  const headRgb = (scene, p, h) => D.colours.named(`--head${scene.page.plans[p].heads[h].colour % 8}`);

  /** The colour of a head's travels: of its own where there are several. */
  const travelRgb = (scene, p, h) => (scene.page.plans[1].heads.length > 1
    ? D.colours.mixed(headRgb(scene, p, h), D.colours.named("--fg"), 0.5) : D.colours.named("--travel"));

  function travelNames(scene) {
    const { heads } = scene.page.plans[1], one = heads.length === 1;
    const names = heads.map(({ name }, h) => ({ name: one ? "travels" : `travels of ${name}`, rgb: travelRgb(scene, 1, h) }));
    const over = scene.travels.some(({ runs }) => runs.some((run) => run.over));
    return over ? [...names, { name: "over outer walls", rgb: one ? travelRgb(scene, 1, 0) : D.colours.named("--fg"), dash: true }] : names;
  }

  function byKind(scene, painter, state, faint) {
    const mode = state.colour;
    const legend = { mode, off: offIn(mode), ...D.colours.MODES[mode](scene) };
    const colours = legend.entries.map(({ rgb }, k) => (
      legend.off.has(k) ? faint : D.colours.packed(rgb, SHOWN.plain)));
    scene.page.plans.forEach((plan, p) => {
      painter.tint(p, (c) => colours[legend.of(c, p)] ?? faint);
      const travel = plan.heads.map((_, h) => D.colours.packed(travelRgb(scene, p, h), SHOWN.plain));
      painter.tintTravels(p, ({ head }) => travel[head]);
    });
    if (state.travels) legend.travels = travelNames(scene);
    return legend;
  }

  function byChange(scene, painter, faint) {
    const hidden = offIn("changed");
    const colour = Object.fromEntries(D.changes.KINDS.map(({ key, colour: name }) => [
      key, hidden.has(key) ? null : D.colours.packed(D.colours.named(name), SHOWN.lit)]));
    scene.page.plans.forEach((_, p) => {
      painter.tint(p, (c) => {
        const shown = D.changes.contourKinds(scene, c).find((kind) => colour[kind] !== null);
        return shown ? colour[shown] : faint;
      });
      painter.tintTravels(p, ({ kind }) => colour[kind] ?? 0);
    });
    return { mode: "changed", off: hidden, sums: () => D.changes.sums(scene, D.state.get().layers) };
  }

  /** The bed's outline and a grid. */
  function bedOf(scene, painter, ground) {
    const { bed_min: [x0, y0], bed_max: [x1, y1] } = scene.page.machine;
    const rgb = D.colours.named("--line");
    const lines = [{ points: [[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0], [x0, y0, 0]], rgb }];
    const faint = D.colours.mixed(ground, rgb, 0.55);
    const first = (v) => Math.ceil(v / GRID_MM) * GRID_MM;
    for (let x = first(x0); x < x1; x += GRID_MM) lines.push({ points: [[x, y0, 0], [x, y1, 0]], rgb: faint });
    for (let y = first(y0); y < y1; y += GRID_MM) lines.push({ points: [[x0, y, 0], [x1, y, 0]], rgb: faint });
    return D.painter.linesOf(painter, lines, SHOWN.plain);
  }

  /** A point at each nozzle, relative to it. */
  const markOf = (painter, rgb) => D.painter.linesOf(painter, [{ points: [[0, 0, 0]], rgb }]);

  /** Colour everything by the state; changes the view's ground, bed and marks. Returns the legend. */
  function apply(scene, painter, view) {
    const state = D.state.get();
    view.ground = D.colours.named("--scene");
    const ghost = D.colours.mixed(view.ground, D.colours.named("--fg"), state.theme === "dark" ? 0.2 : 0.16);
    const faint = D.colours.packed(ghost, SHOWN.ghost);
    const legend = state.changed ? byChange(scene, painter, faint) : byKind(scene, painter, state, faint);
    [view.bed, ...view.marks.flat()].forEach((old) => old && D.beads.release(old));
    view.bed = bedOf(scene, painter, view.ground);
    view.marks = scene.page.plans.map((plan, p) => plan.heads.map((_, h) => markOf(painter, headRgb(scene, p, h))));
    painter.tintHeads((p, h) => headRgb(scene, p, h));
    return legend;
  }

  D.tints = { apply, headRgb };
})();
