"use strict";
/* Elements of the page, made from JavaScript: text is always text, never markup. */
(() => {
  /**
   * Make an element. Children are elements or text; null is left out. `onclick: …` listens.
   * @param {string} tag
   * @param {object} attributes  true: there without a value; false or null: left out
   * @param {...(Node|string|number|null)} children
   */
  D.element = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (value === true) made.setAttribute(key, "");
      else if (value !== false && value != null) made.setAttribute(key, value);
    }
    made.append(...children.filter((child) => child != null));
    return made;
  };

  /**
   * Make a table; numbers stand to the right.
   * @param {string} caption
   * @param {string[]} head
   * @param {Array<Array<Node|string|number>>} rows
   */
  D.table = (caption, head, rows) => {
    const e = D.element;
    const first = rows[0] || [];
    const right = (k) => (typeof first[k] === "number" ? { class: "number" } : {});
    const cell = (value, k) =>
      e("td", right(k), typeof value === "number" ? D.format.number(value) : value);
    return e("div", { class: "wide", tabindex: "0", role: "region", "aria-label": caption },
      e("table", {},
        e("caption", {}, caption),
        e("thead", {}, e("tr", {}, ...head.map((t, k) => e("th", { scope: "col", ...right(k) }, t)))),
        e("tbody", {}, ...rows.map((row) => e("tr", {}, ...row.map(cell))))));
  };

  /** Make what opens on request; its content is made when it is opened first. */
  D.folded = (title, content) => {
    const made = D.element("details", {}, D.element("summary", {}, title));
    made.addEventListener("toggle", () => {
      if (made.open && made.children.length === 1) made.append(content());
    });
    return made;
  };

  /**
   * Patterns that tell kinds apart without colour, for a canvas.
   * @param {"waits"|"aside"|"travel"} name
   * @returns {CanvasPattern}
   */
  D.pattern = (context, name, colour, ground) => {
    const scale = window.devicePixelRatio || 1;
    const size = Math.round((name === "aside" ? 5 : 7) * scale);
    const tile = document.createElement("canvas");
    tile.width = tile.height = size;
    const c = tile.getContext("2d");
    c.fillStyle = ground;
    c.fillRect(0, 0, size, size);
    c.strokeStyle = c.fillStyle = colour;
    c.lineWidth = 1.3 * scale;
    if (name === "aside") {
      c.beginPath();
      c.arc(size / 2, size / 2, 1.2 * scale, 0, 2 * Math.PI);
      c.fill();
    } else if (name === "travel") {
      c.fillRect(0, Math.floor(size / 2), size, Math.max(1, Math.round(scale)));
    } else {
      c.beginPath();
      for (const shift of [-size, 0, size]) {
        c.moveTo(shift - 1, size + 1);
        c.lineTo(shift + size + 1, -1);
      }
      c.stroke();
    }
    return context.createPattern(tile, "repeat");
  };
})();
