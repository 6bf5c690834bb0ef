"use strict";
/* The heads over time: what is shown of it, what is where, and what a click or a key selects. */
(() => {
  const e = D.element;
  const LEAST_SPAN_S = 0.5;
  const ROUNDED_S = 0.01; // times are rounded: at its begin an action has begun
  const view = { from: 0, to: 1, left: 64, width: 600, ratio: 1 };
  let rows = [], planned = [], anew = [], longest = [], placed = [], critical = null, focus = null;
  let base, over, line, nowList, asked = 0, told = 0;

  const plan = () => D.page.plans[1];
  /** The end of what is shown: of a run, where what was planned ends later, that. */
  const end = () => {
    const { run, plans } = D.page;
    return Math.max(plan().end_s, ...(run ? [plans[0].end_s, ...run.anew.map(({ ended_s }) => ended_s)] : []));
  };
  const drawing = () => D.ganttDrawing;

  /** What a head does at a time, in figures: for the lines below the Gantt, and for tests. */
  function at(head, seconds) {
    const later = anew.filter(({ row, begin_s }) => row.head === head && begin_s <= seconds).pop();
    const row = later ? later.row : rows[head], s = row.segment(seconds);
    const kind = row.kind[s], wait = kind >= 3 ? row.wait(seconds) : null;
    const action = later ? -1 : row.action[s]; // of the plan that is shown
    const contour = action < 0 ? -1 : plan().heads[head].contour[action];
    const shares = new Float64Array(D.timeline.KINDS);
    const half = (view.to - view.from) / (view.width - view.left) / 2;
    row.shares(seconds - half, seconds + half, shares);
    return {
      head, name: row.name, what: D.timeline.VERBS[kind], action, contour, wait,
      begin_s: wait ? wait.begin_s : row.begin[s], end_s: wait ? wait.end_s : row.end[s],
      shares: Object.fromEntries(D.timeline.VERBS.map((verb, k) => [verb, shares[k]])),
    };
  }

  const sentence = (found) => `${D.format.clock(found.begin_s)} to ${D.format.clock(found.end_s)}: ${deed(found)}`;

  /** The same in words, without the times. */
  function deed(found) {
    if (found.wait) {
      const time = D.format.duration(found.end_s - found.begin_s);
      if (found.wait.cause === "unused") return `${found.name} ${D.page.run ? "printed nothing" : "is not used"}`;
      if (found.wait.cause === "end") return `${found.name} has nothing left to do for ${time}`;
      const other = found.wait.other_head, action = found.wait.other_action;
      const contour = other === null || action === null ? -1 : D.words.beadBy(other, action);
      const next = found.wait.action === null ? -1 : D.words.beadFrom(found.head, found.wait.action);
      const then = next < 0 ? "" : `; then it prints bead ${next} ${D.words.origin(next)}`;
      const lag = found.wait.lag_s ? `, and ${D.format.duration(found.wait.lag_s)} after that` : "";
      return `${found.name} waits ${time}${D.words.reason(found.wait)}${lag}${contour < 0 ? "" : ` ${D.words.origin(contour)}`}${then}`;
    }
    const time = D.format.duration(found.end_s - found.begin_s);
    const what = found.contour < 0 ? "" : ` bead ${found.contour} ${D.words.origin(found.contour)}`;
    return `${found.name} ${found.what}${what} for ${time}`;
  }

  /** Where much happens within a pixel: shares instead of one action. */
  function summary(found, seconds) {
    const wide = ((view.to - view.from) / (view.width - view.left)) * 4;
    if (found.end_s - found.begin_s > wide / 4) return sentence(found);
    const shares = new Float64Array(D.timeline.KINDS);
    rows[found.head].shares(seconds - wide / 2, seconds + wide / 2, shares);
    const parts = D.timeline.VERBS.map((verb, k) => [verb, shares[k]]).filter(([, share]) => share >= 0.005);
    const list = parts.map(([verb, share]) => `${verb} ${Math.round(100 * share)} %`).join(", ");
    return `${sentence(found)} · within ${D.format.duration(wide)}: ${list}`;
  }

  function redraw() {
    if (asked) return;
    asked = requestAnimationFrame(() => {
      asked = 0;
      placed = drawing().draw(base.getContext("2d", { willReadFrequently: true }), rows, view, { longest, critical, planned, anew, failed: D.page.run ? D.page.run.failed : [] });
      redrawOver();
    });
  }

  function redrawOver() {
    const { time, selected } = D.state.get();
    const shown = selected && selected.plan === 1 ? boxOf(selected.head, selected.action) : null;
    drawing().drawOver(over.getContext("2d", { willReadFrequently: true }), rows, view, { time, selected: shown, focus });
  }

  function boxOf(head, action) {
    const row = rows[head], s = row.actionSegment[action];
    return { head, begin_s: row.begin[s], end_s: row.end[s] };
  }

  function resize() {
    const box = base.parentElement;
    view.width = Math.max(280, box.clientWidth);
    view.left = view.width < 520 ? 44 : 72;
    view.ratio = window.devicePixelRatio || 1;
    const height = drawing().height(rows);
    for (const canvas of [base, over]) {
      canvas.width = Math.round(view.width * view.ratio);
      canvas.height = Math.round(height * view.ratio);
      canvas.style.width = `${view.width}px`;
      canvas.style.height = `${height}px`;
    }
    box.style.height = `${height}px`;
    redraw();
  }

  /** Show a span of time; it stays within the plan. */
  function span(from, to) {
    const wide = Math.min(Math.max(to - from, LEAST_SPAN_S), end());
    const middle = (from + to) / 2;
    view.from = Math.min(Math.max(middle - wide / 2, 0), end() - wide);
    view.to = view.from + wide;
    redraw();
  }

  /** Make the span `factor` times as long around a time. */
  function zoom(factor, around = (view.from + view.to) / 2) {
    span(around - (around - view.from) * factor, around + (view.to - around) * factor);
  }

  const pan = (share) => {
    const by = share * (view.to - view.from);
    const held = Math.min(Math.max(by, -view.from), end() - view.to);
    span(view.from + held, view.to + held);
  };

  /** Point at a time of a head: its box, and what it is in words. */
  function point(head, seconds) {
    const found = at(head, seconds);
    focus = { head, seconds, begin_s: found.begin_s, end_s: found.end_s };
    line.textContent = summary(found, seconds);
    redrawOver();
    return found;
  }

  /** What every head does at the time that all sections share. */
  function tellNow() {
    told = 0;
    const { time } = D.state.get(), done = time >= plan().end_s;
    const begin = done ? `Done at ${D.format.clock(plan().end_s)}` : `At ${D.format.clock(time)}`;
    const deeds = done ? [] : rows.map((row) => e("li", {}, deed(at(row.head, time + ROUNDED_S))));
    nowList.replaceChildren(e("li", {}, e("b", {}, begin)), ...deeds);
  }

  function leave() {
    focus = null;
    redrawOver();
  }

  /** Select what is at a time of a head: an action, or what a wait waited for. */
  function select(head, seconds) {
    const found = at(head, seconds);
    if (found.wait) return D.gantt.goto(found.wait);
    if (found.action < 0) return D.state.set({ time: seconds });
    D.state.set({ time: seconds, selected: { plan: 1, head, action: found.action } });
    line.textContent = sentence(found);
  }

  /** Show a wait, and select what it waited for (or what begins after it). */
  function goto(wait, { closer = false } = {}) {
    const other = wait.other_head !== null && wait.other_action !== null;
    const selected = other
      ? { plan: 1, head: wait.other_head, action: wait.other_action }
      : wait.action === null ? null : { plan: 1, head: wait.head, action: wait.action };
    const middle = (wait.begin_s + wait.end_s) / 2;
    point(wait.head, middle);
    if (closer) {
      const until = other ? boxOf(wait.other_head, wait.other_action) : wait;
      const from = Math.min(wait.begin_s, until.begin_s), to = Math.max(wait.end_s, until.end_s);
      const around = Math.min(Math.max(1.4 * (to - from), 20), 8 * (wait.end_s - wait.begin_s) + 20);
      span(middle - around / 2, middle + around / 2);
    }
    D.state.set({ time: wait.begin_s, ...(selected ? { selected } : {}) });
  }

  function onState(now, was) {
    if (now.theme !== was.theme) return redraw();
    const moved = now.selected !== was.selected && now.selected && now.selected.plan === 1;
    if (moved) {
      const { begin_s, end_s } = boxOf(now.selected.head, now.selected.action);
      const half = (view.to - view.from) / 2;
      if (end_s < view.from || begin_s > view.to) span(begin_s - half, begin_s + half);
    }
    if (moved || now.selected !== was.selected || now.time !== was.time) redrawOver();
    if (now.time !== was.time && !told) told = requestAnimationFrame(tellNow);
  }

  function show(page) {
    const section = document.getElementById("heads");
    const several = page.plans[1].heads.length > 1;
    section.hidden = !several && !page.waits.length;
    if (section.hidden) return;
    const rowsOf = ({ heads }, waits) => heads.map((head, k) => new D.timeline.Row(head, k, end(), waits));
    rows = rowsOf(page.plans[1], page.waits);
    planned = page.run ? rowsOf(page.plans[0], []) : [];
    anew = page.run ? page.run.anew.flatMap(laterRows) : [];
    longest = [...page.waits].sort((a, b) => b.end_s - b.begin_s - (a.end_s - a.begin_s));
    view.to = end();
    base = e("canvas", { "aria-hidden": "true" });
    over = e("canvas", { tabindex: "0", role: "application", "aria-label": name(page), "aria-describedby": "gantt-keys gantt-now" });
    nowList = e("ul", { class: "legend nows", "aria-label": "what the heads do now" });
    line = e("p", { id: "gantt-now", class: "now" }, "Point at the chart, or use the keys, to read what a head does.");
    section.append(
      e("h2", {}, several ? "The heads over time" : "The head over time"),
      D.ganttControls.toolbar(page),
      D.ganttControls.legend(page),
      e("div", { class: "gantt" }, base, over),
      nowList,
      line,
      e("p", { id: "gantt-keys", class: "note" }, "Drag to move, click to select; with the chart in focus the wheel zooms. Keys: ← → next action, ↑ ↓ head, + − zoom, Page up and down to move, w next wait, 0 whole print, Enter selects."),
    );
    D.ganttControls.listen(over);
    D.state.on(onState);
    new ResizeObserver(resize).observe(base.parentElement);
    resize();
    tellNow();
    D.waits.show(page);
    D.stops.show(page);
  }

  /** What heads did of a plan made anew: rows of the time line, from when it began. */
  function laterRows({ begin_s, rows: heads }) {
    const names = plan().heads.map((head) => head.name);
    return heads.map((head) => ({ begin_s, row: new D.timeline.Row(head, names.indexOf(head.name), end(), []) }));
  }

  function name(page) {
    const names = page.plans[1].heads.map((head) => head.name).join(", ");
    return `What ${names} do over time, ${D.format.duration(page.plans[1].end_s)}`;
  }

  /** The labels of waits as shown. */
  const labels = () => placed.map(({ wait, text, head, x }) => ({ text, head, x, begin_s: wait.begin_s, end_s: wait.end_s, cause: wait.cause }));

  D.gantt = {
    show, at, labels, sentence, span, zoom, pan, point, leave, select, goto, view,
    rows: () => rows,
    focus: () => focus,
    longest: () => longest,
    critical: (on) => { critical = on ? D.page.critical : null; redraw(); },
  };
})();
