"use strict";
/* How the Gantt is moved: buttons, keys, wheel, and pointers (drag, click, two fingers). */
(() => {
  const e = D.element;
  const NEAR = 5; // pixels a pointer may move and still click

  function toolbar(page) {
    const button = (text, label, act) => e("button", { type: "button", "aria-label": label, title: label, onclick: act }, text);
    const chain = e("button", { type: "button", "aria-pressed": "false", onclick: () => toggle(chain) }, "Critical path");
    const several = page.critical.length > 0;
    if (several) queueMicrotask(() => toggle(chain));
    return e("div", { class: "bar", role: "toolbar", "aria-label": "heads over time" },
      button("−", "zoom out", () => D.gantt.zoom(2)),
      button("+", "zoom in", () => D.gantt.zoom(0.5)),
      button("←", "earlier", () => D.gantt.pan(-0.5)),
      button("→", "later", () => D.gantt.pan(0.5)),
      button("Whole print", "show the whole print", whole),
      button("Now", "Now: show the current time", now),
      page.waits.length ? button("Next wait", "go to the next wait", () => nextWait(1)) : null,
      several ? chain : null,
      button("See it in the print", "See it in the print, in three dimensions", () => document.getElementById("view").scrollIntoView()));
  }

  function toggle(button) {
    const on = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(on));
    D.gantt.critical(on);
  }

  const whole = () => D.gantt.span(0, D.page.plans[1].end_s);
  const now = () => {
    const { time } = D.state.get(), { from, to } = D.gantt.view;
    D.gantt.span(time - (to - from) / 2, time + (to - from) / 2);
  };

  /** Swatches drawn with the same patterns as the bars. */
  function legend(page) {
    const list = e("ul", { class: "legend", "aria-label": "legend" });
    const fill = () => list.replaceChildren(...entries(page));
    fill();
    D.state.on((state, was) => { if (state.theme !== was.theme) fill(); });
    return list;
  }

  function entries(page) {
    const panel = D.colour("--panel");
    const of = (text, paint) => e("li", {}, swatch(paint), text);
    const made = page.plans[1].heads.map((head) => of(`${head.name} prints`, () => D.colour(`--head${head.colour % 8}`)));
    made.push(of("travels", (c) => D.pattern(c, "travel", D.colour("--travel"), panel)));
    if (page.facts.heads.some((head) => head.aside_s > 0)) {
      made.push(of("steps aside", (c) => D.pattern(c, "aside", D.colour("--fg"), panel)));
    }
    if (page.waits.length) made.push(of("waits", (c) => D.pattern(c, "waits", D.colour("--fg"), D.colour("--bg"))));
    if (page.critical.length) made.push(of("critical path", () => D.colour("--bad"), true));
    if (page.run && page.run.failed.length) made.push(of("a head failed", () => D.colour("--bad"), true));
    if (page.run && page.run.anew.length) made.push(of("planned anew", () => D.colour("--accent"), true));
    return made;
  }

  function swatch(paint) {
    const ratio = window.devicePixelRatio || 1;
    const canvas = e("canvas", { width: Math.round(26 * ratio), height: Math.round(14 * ratio), "aria-hidden": "true" });
    const context = canvas.getContext("2d");
    context.fillStyle = paint(context);
    context.fillRect(0, 0, canvas.width, canvas.height);
    return canvas;
  }

  /** Head and time under a pointer. */
  function under(event, canvas) {
    const box = canvas.getBoundingClientRect();
    const x = event.clientX - box.left, y = event.clientY - box.top;
    const { secondsOf, rowHeight } = D.ganttDrawing;
    const head = Math.floor(y / rowHeight()), seconds = secondsOf(D.gantt.view, x);
    const inside = seconds >= D.gantt.view.from && seconds <= D.gantt.view.to;
    return { x, head: inside && head >= 0 && head < D.gantt.rows().length ? head : -1, seconds };
  }

  function listen(canvas) {
    const pointers = new Map();
    let dragged = false, shown = null;
    canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, event.clientX);
      canvas.setPointerCapture(event.pointerId);
      dragged = pointers.size > 1;
      shown = { ...D.gantt.view, x: event.clientX, starts: new Map(pointers) };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!pointers.has(event.pointerId)) return hover(under(event, canvas));
      pointers.set(event.pointerId, event.clientX);
      if (pointers.size === 1 && !dragged && Math.abs(event.clientX - shown.x) < NEAR) return;
      dragged = true;
      drag(shown, [...shown.starts.values()], [...pointers.values()], canvas);
    });
    const release = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      shown = { ...D.gantt.view, x: event.clientX, starts: new Map(pointers) };
      if (!dragged && event.type === "pointerup") click(under(event, canvas));
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => D.gantt.leave());
    canvas.addEventListener("wheel", (event) => wheel(event, canvas), { passive: false });
    canvas.addEventListener("keydown", key);
    canvas.addEventListener("focus", () => { if (!D.gantt.focus()) D.gantt.point(0, Math.max(D.gantt.view.from, Math.min(D.state.get().time, D.gantt.view.to))); });
  }

  function hover({ head, seconds }) {
    if (head >= 0) D.gantt.point(head, seconds); else D.gantt.leave();
  }

  function click({ head, seconds }) {
    if (head >= 0) D.gantt.select(head, seconds);
    else D.state.set({ time: Math.min(Math.max(seconds, 0), D.page.plans[1].end_s) });
  }

  /** One pointer moves the span, two keep the times below them. */
  function drag(shown, starts, ends, canvas) {
    const left = canvas.getBoundingClientRect().left;
    const time = (x) => D.ganttDrawing.secondsOf(shown, x - left);
    if (ends.length === 1) {
      const by = time(starts[0]) - time(ends[0]);
      const held = Math.min(Math.max(by, -shown.from), D.page.plans[1].end_s - shown.to);
      return D.gantt.span(shown.from + held, shown.to + held);
    }
    const factor = Math.abs(starts[0] - starts[1]) / Math.max(8, Math.abs(ends[0] - ends[1]));
    const middle = time((starts[0] + starts[1]) / 2), moved = time((ends[0] + ends[1]) / 2) - middle;
    D.gantt.span(middle - (middle + moved - shown.from) * factor, middle + (shown.to - middle - moved) * factor);
  }

  /** The wheel scrolls the page as usual unless the chart is in focus or Ctrl is held. */
  function wheel(event, canvas) {
    const sideways = event.shiftKey ? event.deltaY || event.deltaX : event.deltaX;
    if (Math.abs(sideways) > Math.abs(event.shiftKey ? 0 : event.deltaY)) {
      event.preventDefault();
      D.gantt.pan(Math.sign(sideways) * Math.min(0.2, Math.abs(sideways) / 800));
    } else if (document.activeElement === canvas || event.ctrlKey || event.metaKey) {
      event.preventDefault();
      D.gantt.zoom(event.deltaY > 0 ? 1.25 : 0.8, under(event, canvas).seconds);
    }
  }

  /** The next wait after what is pointed at, on any head; after the last one comes the first. */
  function nextWait(step) {
    const focus = D.gantt.focus(), real = D.page.waits.filter((wait) => !["signal", "end", "unused"].includes(wait.cause));
    const waits = real.length ? real : D.page.waits;
    const at = focus ? focus.begin_s : D.gantt.view.from - 1;
    const after = (wait) => wait.begin_s > at + 1e-3 || (focus && wait.begin_s > at - 1e-3 && wait.head > focus.head);
    const before = (wait) => wait.begin_s < at - 1e-3 || (focus && wait.begin_s < at + 1e-3 && wait.head < focus.head);
    const found = step > 0 ? waits.find(after) : waits.findLast(before);
    visit(found || waits[step > 0 ? 0 : waits.length - 1]);
  }

  function visit(wait) {
    if (!wait) return;
    const { from, to } = D.gantt.view, middle = (wait.begin_s + wait.end_s) / 2;
    D.gantt.point(wait.head, middle);
    if (middle < from || middle > to) D.gantt.span(middle - (to - from) / 2, middle + (to - from) / 2);
  }

  /** To the next action: or 1 % of what is shown, where actions are shorter. */
  function stepAction(step) {
    const { from, to } = D.gantt.view, least = (to - from) / 100;
    const focus = D.gantt.focus();
    const seconds = step > 0 ? Math.max(focus.end_s + 1e-3, focus.seconds + least) : Math.min(focus.begin_s - 1e-3, focus.seconds - least);
    const held = Math.min(Math.max(seconds, 0), D.page.plans[1].end_s);
    if (held < from || held > to) D.gantt.span(held - (to - from) / 2, held + (to - from) / 2);
    D.gantt.point(focus.head, held);
  }

  function stepHead(step) {
    const focus = D.gantt.focus(), last = D.gantt.rows().length - 1;
    D.gantt.point(Math.min(Math.max(focus.head + step, 0), last), focus.seconds);
  }

  function moveTo(seconds) {
    D.gantt.point(D.gantt.focus().head, seconds);
    const { from, to } = D.gantt.view;
    if (seconds < from || seconds > to) D.gantt.span(seconds - (to - from) / 2, seconds + (to - from) / 2);
  }

  const KEYS = {
    ArrowRight: () => stepAction(1),
    ArrowLeft: () => stepAction(-1),
    ArrowDown: () => stepHead(1),
    ArrowUp: () => stepHead(-1),
    PageUp: () => D.gantt.pan(-0.5),
    PageDown: () => D.gantt.pan(0.5),
    Home: () => moveTo(0),
    End: () => moveTo(D.page.plans[1].end_s),
    "+": () => D.gantt.zoom(0.5, D.gantt.focus().seconds),
    "=": () => D.gantt.zoom(0.5, D.gantt.focus().seconds),
    "-": () => D.gantt.zoom(2, D.gantt.focus().seconds),
    0: whole,
    w: () => nextWait(1),
    W: () => nextWait(-1),
    Enter: () => D.gantt.select(D.gantt.focus().head, D.gantt.focus().seconds),
  };

  function key(event) {
    const act = KEYS[event.key];
    if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation(); // the page's own keys are for elsewhere
    if (!D.gantt.focus()) D.gantt.point(0, D.gantt.view.from);
    act();
    document.getElementById("gantt-now").setAttribute("aria-live", "polite");
  }

  D.ganttControls = { toolbar, legend, listen };
})();
