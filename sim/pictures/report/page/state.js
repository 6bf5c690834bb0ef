// What all sections of the page share: the time shown, what is selected, what is drawn how.
"use strict";
(() => {
  let now = Object.freeze({
    time: 0, playing: false, speed: 60, layers: [0, 0], plans: "after", colour: "role",
    travels: false, changed: false, bodies: true, cuts: false, selected: null, theme: "light",
  });
  const heard = [];

  D.state = {
    get: () => now,
    /** Change some keys; whoever listens is told, if any is another. */
    set(change) {
      const was = now, next = { ...was, ...change };
      if (Object.keys(change).every((key) => was[key] === next[key])) return;
      now = Object.freeze(next);
      for (const listener of heard) listener(now, was);
    },
    /** Be told of changes: listener(now, was). */
    on(listener) {
      heard.push(listener);
    },
  };

  /** The value of a colour of the page's style, e.g. D.colour("--head0"). */
  D.colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
})();
