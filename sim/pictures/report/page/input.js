"use strict";
// Mouse, touch and keys of the view.
(() => {
  const CLICK_PX = 5; // a press that moves less is a click

  function listen(canvas, view, to) {
    const pressed = new Map();
    let [moved, from] = [0, null];
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    /** px from the middle of the picture the pointer is over. */
    const inPane = ([x, y]) => {
      const pane = to.panes().find((p) => x < p.left + p.width && y < p.top + p.height) ?? to.panes()[0];
      return [x - pane.left - pane.width / 2, y - pane.top - pane.height / 2];
    };
    const spread = () => {
      const [a, b] = [...pressed.values()];
      return { apart: Math.hypot(a[0] - b[0], a[1] - b[1]), middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
    };

    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      pressed.set(event.pointerId, at(event));
      if (pressed.size === 1) moved = 0;
      from = pressed.size === 2 ? spread() : null;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!pressed.has(event.pointerId)) return;
      const [x, y] = at(event);
      const [px, py] = pressed.get(event.pointerId);
      pressed.set(event.pointerId, [x, y]);
      moved += Math.hypot(x - px, y - py);
      if (moved < CLICK_PX) return;
      if (pressed.size === 2) {
        const now = spread();
        D.camera.pan(view.camera, now.middle[0] - from.middle[0], now.middle[1] - from.middle[1]);
        D.camera.zoomAt(view.camera, now.apart / Math.max(from.apart, 1), ...inPane(now.middle));
        from = now;
      } else if (event.shiftKey || event.buttons & 6) D.camera.pan(view.camera, x - px, y - py);
      else D.camera.orbit(view.camera, x - px, y - py);
      view.fitted = false;
      to.redraw(true);
    });
    const lift = (event) => {
      const alone = pressed.size === 1;
      const there = pressed.delete(event.pointerId);
      if (there && alone && moved < CLICK_PX && event.type === "pointerup" && event.button === 0) {
        to.choose(...at(event));
      }
    };
    canvas.addEventListener("pointerup", lift);
    canvas.addEventListener("pointercancel", lift);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return; // the page scrolls
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : 1;
      D.camera.zoomAt(view.camera, Math.exp(-event.deltaY * lines * 0.0015), ...inPane(at(event)));
      view.fitted = false;
      to.redraw(true);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => key(event, view, to));
  }

  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

  function key(event, view, to) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { camera } = view;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (ARROWS[name]) {
      const [x, y] = ARROWS[name];
      if (event.shiftKey) D.camera.pan(camera, -40 * x, -40 * y);
      else D.camera.orbit(camera, -15 * x, -15 * y);
      view.fitted = false;
    } else if (name === "+" || name === "=") D.camera.zoomAt(camera, 1.25, 0, 0);
    else if (name === "-") D.camera.zoomAt(camera, 0.8, 0, 0);
    else if (name === "t") to.turnTo("top");
    else if (name === "f") to.turnTo("front");
    else if (name === "r") to.turnTo("right");
    else if (name === "i") to.turnTo("iso");
    else if (name === "z") to.closer();
    else if (name === "0" || name === "Home") to.fit();
    else if (!other(name)) return;
    event.preventDefault();
    to.redraw(true);
  }

  /** Keys that change what is shown; false: none of them. */
  function other(name) {
    const state = D.state.get();
    if (name === " ") D.controls.playOrPause();
    else if (name === "PageUp" || name === "PageDown") D.controls.stepLayer(name === "PageUp" ? 1 : -1);
    else if (name === "n" || name === ".") D.selected.step(1);
    else if (name === "p" || name === ",") D.selected.step(-1);
    else if (name === "c") D.controls.showChanges();
    else if (name === "v") D.state.set({ travels: !state.travels });
    else if (name === "b") D.state.set({ plans: { after: "both", both: "before", before: "after" }[state.plans] });
    else if (name === "Escape") D.state.set({ selected: null });
    else return false;
    return true;
  }

  D.input = { listen };
})();
