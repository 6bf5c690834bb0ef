"use strict";
/* What if a head stopped at the time shown: what the others could still print of the plan, what waits. */
(() => {
  const e = D.element;
  let page = null, box = null, printed = [], reached = [], told = 0;

  /** Of each head, which beads it can print by its reach and its tools: a byte a bead. */
  function reachOf({ reach, tools }) {
    const { contours } = page, can = new Uint8Array(contours.n), axes = ["x", "y", "z"];
    for (let c = 0; c < contours.n; c++) {
      let within = !tools.length || tools.includes(contours.tool[c]);
      for (let i = contours.offsets[c]; within && i < contours.offsets[c + 1]; i++)
        within = axes.every((axis, k) => contours[axis][i] >= reach.min[k] - 0.01 && contours[axis][i] <= reach.max[k] + 0.01);
      can[c] = within ? 1 : 0;
    }
    return can;
  }

  /** How many actions of each head are done at a time; the one it is at is not. */
  const doneAt = (seconds) => page.plans[1].heads.map((head) => D.lastUpTo(head.end, seconds + 0.001) + 1);

  /**
   * The first action of each head that never begins if one stands still behind `done` actions: one
   * that waits for what the stopped head, or a head that waits for it, does not do any more.
   */
  function heldBy(stopped, done) {
    const first = page.after.map((row) => row.n);
    first[stopped] = done[stopped];
    for (let again = true; again; ) {
      again = false;
      page.after.forEach(({ action, head, until }, h) => {
        for (let k = 0; k < action.length && action[k] < first[h]; k++) {
          if (action[k] >= done[h] && until[k] >= first[head[k]]) { first[h] = action[k]; again = true; }
        }
      });
    }
    return first;
  }

  /** Beads of a head among its actions from one to another. */
  const beads = (h, from, to) => printed[h].filter(([action]) => action >= from && action < to);

  /** What is left at a time without one head: beads, in numbers. */
  function at(stopped, seconds) {
    const done = doneAt(seconds), first = heldBy(stopped, done);
    let [waiting, free] = [0, 0];
    page.after.forEach((row, h) => {
      if (h === stopped) return;
      free += beads(h, done[h], first[h]).length;
      waiting += beads(h, Math.max(first[h], done[h]), row.n).length;
    });
    const left = beads(stopped, done[stopped], Infinity);
    const alone = left.filter(([, c]) => !reached.some((can, h) => h !== stopped && can[c])).length;
    return { left: left.length, waiting, free, alone };
  }

  function tell() {
    told = 0;
    const { time } = D.state.get();
    const rows = page.after.map((_, h) => {
      const { left, waiting, free, alone } = at(h, time);
      return [D.words.headName(h), left, free, waiting, alone];
    });
    box.replaceChildren(D.table(`If a head stopped for good at ${D.format.clock(time)}`,
      ["head", "its beads not printed", "others print on", "others wait for it", "no other reaches"], rows));
  }

  function show(from) {
    const section = document.getElementById("heads");
    if (section.hidden || !from.after || from.after.length < 2) return;
    page = from;
    printed = page.after.map(({ bead }) => Array.from(bead, (c, a) => [a, c]).filter(([, c]) => c >= 0));
    reached = page.machine.heads.map(reachOf);
    box = e("div", { id: "stops" });
    section.append(e("h3", {}, "What if a head stopped now?"),
      e("p", { class: "note" }, "At the time shown: beads of this plan that others could still print, and those that wait for the stopped head, by however many steps. A bead it is at counts as not printed. The rest is planned anew for the heads that live; what no other head can print, by its reach and its tools, stays unprinted."),
      box);
    D.state.on((now, was) => { if (now.time !== was.time && !told) told = requestAnimationFrame(tell); });
    tell();
  }

  D.stops = { show, at };
})();
