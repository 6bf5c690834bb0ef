"use strict";
/* Behind the Gantt: waits summed by cause, the longest ones as buttons, all as a table, the
   critical path in words. */
(() => {
  const e = D.element;
  const SHOWN = 8, LISTED = 300;
  const lasting = (wait) => wait.end_s - wait.begin_s;

  function show(page) {
    const section = document.getElementById("heads");
    if (section.hidden) return;
    const real = D.gantt.longest().filter((wait) => wait.cause !== "end" && wait.cause !== "unused");
    const others = real.filter((wait) => wait.cause !== "signal");
    section.append(...[
      page.critical.length ? chainText(page) : null,
      e("div", { class: "halves" }, page.waits.length ? sums(page) : e("p", {}, "No head ever waits."), others.length ? list(others) : null),
      real.length > SHOWN ? D.folded(`All waits as a table (${D.format.number(real.length)})`, () => table(real)) : null,
      page.team ? D.charts.team(page.team) : null,
    ].filter(Boolean));
  }

  /** Where the makespan hangs. */
  function chainText(page) {
    const { on, handed, waited } = D.timeline.chain(D.gantt.rows(), page.critical);
    const parts = on.map((seconds, head) => [seconds, D.words.headName(head)]).filter(([s]) => s > 0)
      .map(([seconds, name]) => `${D.format.duration(seconds)} by ${name}`);
    const times = handed === 1 ? "changes head once" : handed ? `changes head ${D.format.number(handed)} times` : "never changes head";
    const rest = waited > 1 ? `, with ${D.format.duration(waited)} of waiting in it` : "";
    return e("p", {}, e("strong", {}, "Critical path: "),
      `the print ends sooner only if this chain gets shorter: ${parts.join(", ")}. It ${times}${rest}.`);
  }

  /** Waits by cause, as bars. */
  function sums(page) {
    const sorted = [...page.wait_sums].sort((a, b) => b.seconds - a.seconds);
    const total = sorted.reduce((sum, row) => sum + row.seconds, 0);
    const all = page.plans[1].end_s * page.plans[1].heads.length;
    const row = ({ cause, seconds, count }) =>
      e("tr", {},
        e("th", { scope: "row" }, D.words.long(cause)),
        e("td", { class: "number" }, D.format.duration(seconds)),
        e("td", { class: "number" }, `${D.format.number(count)} ×`),
        e("td", { class: "stretch", "aria-hidden": "true" }, e("div", { class: "hatched", style: `width:${(100 * seconds) / sorted[0].seconds}%` })));
    return e("div", {},
      e("h3", {}, page.plans[1].heads.length > 1 ? "Why heads stand still" : "Why the head stands still"),
      e("p", {}, `${D.format.duration(total)} in all: ${D.format.percent(total / all)} of ${page.plans[1].heads.length > 1 ? "the heads' time" : "the time"}.`),
      e("table", { class: "sums" }, e("tbody", {}, ...sorted.map(row))));
  }

  function list(real) {
    const item = (wait) =>
      e("li", {}, e("button", { type: "button", onclick: () => D.gantt.goto(wait, { closer: true }) },
        e("b", {}, D.format.clock(wait.begin_s)), ` ${D.words.headName(wait.head)} ${D.words.labels(wait)[0]}`));
    return e("div", {},
      e("h3", {}, real.length > SHOWN ? "The longest waits" : "The waits"),
      e("ol", { class: "waits" }, ...real.slice(0, SHOWN).map(item)));
  }

  function table(real) {
    const shown = real.slice(0, LISTED).sort((a, b) => a.begin_s - b.begin_s);
    const sum = (waits) => waits.reduce((total, wait) => total + lasting(wait), 0);
    const part = real.length > LISTED ? `The ${LISTED} longest of ${D.format.number(real.length)} waits, ${D.format.percent(sum(shown) / sum(real))} of the waiting` : "All waits";
    const rows = shown.map((wait) => [
      e("button", { type: "button", onclick: () => D.gantt.goto(wait, { closer: true }) }, D.format.clock(wait.begin_s)),
      D.words.headName(wait.head),
      D.format.duration(lasting(wait)),
      wait.other_head === null ? "–" : D.words.headName(wait.other_head),
      (wait.other_head !== null && D.words.bead(wait.other_head, wait.other_action)) || "–",
      D.words.long(wait.cause),
    ]);
    return D.table(part, ["at", "head", "waits", "for", "what", "why"], rows);
  }

  D.waits = { show };
})();
