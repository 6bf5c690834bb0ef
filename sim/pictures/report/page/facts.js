"use strict";
/* The first screen: is it safe, what is saved, how the heads are used. Each figure once. */
(() => {
  const e = D.element;

  const share = (part, whole) => D.format.percent(whole ? part / whole : 0);

  function show(page) {
    const { facts } = page;
    const section = document.getElementById("facts");
    section.append(...[
      origin(facts, page),
      e("div", { class: "cards" }, verdict(facts), time(facts), changes(facts)),
      ...(page.run ? page.run.anew.map((each, k) => anew(each, page.run, k)) : []),
      facts.heads.length ? heads(facts, page) : null,
      warnings([...lost(page.team || {}), ...facts.warnings]),
      facts.settings.length ? D.folded("How it was planned", () => settings(facts)) : null,
    ].filter(Boolean));
  }

  function origin(facts, page) {
    const parts = [facts.file === page.title ? "" : facts.file, `machine ${facts.machine}`, D.format.count(page.contours.n, "bead")];
    return e("p", { class: "origin" }, parts.filter(Boolean).join(" · "));
  }

  const ABOUT = [["checked", "How much"], ["rule", "By these rules"], ["asked", "As it was asked for"]];

  /** How a run ended: what was printed of the plan, and who failed. */
  function ended({ beads, printed, failed, contacts, on_print: met = [], in_the_end: all }) {
    const whole = (all ?? printed) === beads, good = whole && !contacts && !met.length;
    const word = contacts ? "Heads touched" : met.length ? "A head touched the print" : !whole ? "Broken off" : all === null ? "Carried out" : "Carried out, planned anew";
    const lines = failed.map(({ head, time_s, why }) => `${head} failed at ${D.format.clock(time_s)}${why && `: ${why}`}`);
    lines.unshift(...met);
    if (contacts) lines.unshift(D.format.count(contacts, "contact"));
    const done = [`${D.format.number(all ?? printed)} of ${D.format.count(beads, "bead")} printed`];
    if (all !== null) done.push(`${D.format.number(printed)} of them by the first plan, which this page shows`);
    return e("div", { class: `card ${good ? "good" : "bad"}` },
      e("p", { class: "big" }, e("span", { class: "mark", "aria-hidden": "true" }, good ? "✓" : "✗"), word),
      e("ul", { class: "near" }, ...[...done, ...lines].map((text) => e("li", {}, text))));
  }

  /** What a failure changed: who should have printed the rest, and who did by the plan made anew. */
  function anew({ begin_s, old_end_s, new_end_s, ended_s, left, heads: of, moved }, run, k) {
    const later = new_end_s - old_end_s, clock = D.format.clock;
    const beads = (n, words) => `${D.format.count(n, "bead")} ${words}`;
    const missing = k === run.anew.length - 1 ? run.missing : [];
    const compared = missing.length ? ", with less printed" : `, ${D.format.duration(Math.abs(later))} ${later < 0 ? "sooner" : "later"}`;
    const lines = moved.map(({ was, now, beads: n }) => beads(n, `that ${was} should have printed ${n === 1 ? "is" : "are"} ${now}'s`));
    lines.push(...missing);
    return e("div", { class: "card anew" },
      e("h2", {}, `What the failure changed: planned anew at ${clock(begin_s)}`),
      e("p", {}, `${beads(left, "were left of the plan")}, which would have ended at `, e("b", {}, clock(old_end_s)),
        "; by the new one it ends at ", e("b", {}, clock(new_end_s)), `${compared}. It ended at `, e("b", {}, clock(ended_s)), "."),
      D.table("Beads left, and who prints them", ["head", "left of the plan before", "by the new plan"], of.map(({ name, left: n, now }) => [name, n, now])),
      lines.length ? e("ul", { class: "near" }, ...lines.map((text) => e("li", {}, text))) : null);
  }

  /** Whether it is safe, how near it came, and what was checked: in the words of `verify -v`. */
  function verdict(facts) {
    if (D.page.run) return ended(D.page.run);
    const [mark, word] = facts.judged === false ? ["?", "Not checked"] : facts.ok ? ["✓", "Proven safe"] : ["✗", "Not safe: do not print"];
    const of = (kind) => facts.checked.filter(([about]) => about === kind);
    const near = of("nearest");
    return e("div", { class: `card ${facts.ok && facts.judged !== false ? "good" : "bad"}` },
      e("p", { class: "big" }, e("span", { class: "mark", "aria-hidden": "true" }, mark), word),
      near.length ? e("ul", { class: "near" }, ...near.map(nearest)) : null,
      facts.checked.length ? D.folded(`What was checked (${facts.checked.length})`, () => checked(of, near)) : null);
  }

  function checked(of, near) {
    const item = ([, text]) => e("li", {}, text);
    const where = near.filter(([, , at]) => at).map(([, text, at]) => e("li", {}, `${parted(text)[0]}: ${at}`));
    const parts = ABOUT.flatMap(([kind, name]) => [[name, of(kind).map(item)], ...(kind === "checked" ? [["Where it came nearest", where]] : [])]);
    return e("div", { class: "checked" }, ...parts.filter(([, items]) => items.length)
      .flatMap(([name, items]) => [e("h3", {}, name), e("ul", {}, ...items)]));
  }

  /** "heads a and b: 5 mm (3 mm required)" in its parts: between what, how far, what is required. */
  const parted = (text) => text.match(/^(.*): (.*?)( \(.*\))?$/).slice(1).map((part) => part || "");

  /** The least distance of its kind. */
  function nearest([about, text]) {
    const [what, mm, required] = parted(text);
    return e("li", {}, `${about}: ${what}: `, e("b", {}, mm), required);
  }

  /** The difference of two times as they are shown, to the second; to tenths where that is none. */
  const asShown = (before_s, after_s) =>
    D.format.duration(Math.abs(Math.round(before_s) - Math.round(after_s)) || Math.abs(before_s - after_s));

  /** Before, after and what is saved. */
  function time(facts) {
    const { before_s, after_s, of } = facts.time;
    const saved = before_s - after_s, most = Math.max(before_s, after_s, 1e-9);
    const { run } = D.page, broken = run && run.printed < run.beads;
    const less = broken ? `${run.in_the_end === null ? "ended" : "this plan ended"} after ${D.format.duration(after_s)}` : Math.abs(saved) < 0.5 ? "no change" : `${asShown(before_s, after_s)} ${saved < 0 ? "longer" : D.page.run ? "shorter" : "saved"}`;
    const bar = (label, seconds, kind) =>
      e("div", { class: "pair" }, e("span", { class: "name" }, label),
        e("div", { class: "track" }, e("div", { class: kind, style: `width:${(100 * seconds) / most}%` })),
        e("b", { class: "number" }, D.format.clock(seconds)));
    const what = of === "whole file" ? "Time of the whole file, start and end included" : "Time of the print, without start and end of the file";
    return e("div", { class: "card" },
      e("h2", {}, what),
      e("p", { class: "big" }, less, broken || Math.abs(saved) < 0.5 ? "" : e("small", {}, ` ${share(Math.abs(saved), before_s)}`)),
      bar(D.page.plans[0].label, before_s, "was"), bar(D.page.plans[1].label, after_s, "is"),
      ...remarks(facts).map((text) => e("p", { class: "note" }, text)));
  }

  function remarks(facts) {
    return [
      facts.made_safe && "The source's own order would hit the part, so this is compared with printing layer by layer.",
      facts.kept_source && `The source is kept as it is: ${facts.kept_source}.`,
      facts.heads.length < 2 && facts.waits_s >= 1 && `Of that the head waits ${D.format.duration(facts.waits_s)} for plastic to cool.`,
      facts.idle && `${facts.idle}.`,
    ].filter(Boolean);
  }

  /** What no order can be better than, for one head. */
  function proof({ proof }) {
    if (!proof) return null;
    const shown = (value) => (proof.unit === "mm" ? D.format.mm(value) : D.format.duration(value));
    const counted = `Counted straight from bead to bead, without lifts and detours, travels take ${shown(proof.value)}`;
    if (proof.gap_percent < 0.05) return e("p", {}, `${counted}, and no order can have less (proven).`);
    return e("p", {}, `${counted}. No order can have less than ${shown(proof.bound)} (proven): this one is at most ${proof.gap_percent.toFixed(1)} % above.`);
  }

  /** Travel, retractions, walls crossed: before, after, less. */
  function changes(facts) {
    const shown = facts.rows.filter(({ before, after }) => before !== null && after !== null);
    if (!shown.length && !facts.proof) return null;
    const figure = (row, value) => (row.unit === "mm" ? D.format.mm(value) : D.format.number(value));
    const change = ({ before, after }) => {
      if (before === after) return "same";
      const word = after < before ? "less" : "more";
      return before ? `${share(Math.abs(before - after), before)} ${word}` : word;
    };
    const line = (row) => e("tr", {},
      e("th", { scope: "row" }, row.label[0].toUpperCase() + row.label.slice(1)),
      e("td", { class: "number" }, figure(row, row.before)),
      e("td", { class: "number" }, figure(row, row.after)),
      e("td", { class: `number ${row.after < row.before ? "less" : row.after > row.before ? "more" : ""}` }, change(row)));
    return e("div", { class: "card" }, e("h2", {}, "What changed"), e("table", { class: "changes" },
      e("thead", {}, e("tr", {}, e("td", {}), ...[D.page.plans[0].label, D.page.plans[1].label, "change"].map((t) => e("th", { scope: "col", class: "number" }, t)))),
      e("tbody", {}, ...shown.map(line))), proof(facts));
  }

  /** How each head is used, and how much faster the team is; of one head, what its time goes to. */
  function heads(facts, page) {
    const whole = Math.max(page.plans[1].end_s, 1e-9), alone = facts.heads.length === 1;
    const kinds = [["printing_s", "prints", "prints"], ["travelling_s", "travels", "travels"], ["aside_s", "steps aside", "aside"], ["waiting_s", "stands still", "hatched"]];
    const one = (head, k) => {
      const parts = kinds.map(([key, verb, name]) => [head[key], verb, name]).filter(([s]) => s / whole >= 0.0005);
      const used = parts.reduce((sum, [s]) => sum + s, 0);
      if (whole - used > 0.005 * whole) parts.push([whole - used, "stands still", "hatched"]);
      const busy = head.contours || used > 0.001 * whole;
      const said = busy ? parts.map(([s, verb]) => `${verb} ${((100 * s) / whole).toFixed(1)} %`).join(", ") : "has nothing to do";
      const drawn = parts.map(([s, , name]) => e("div", { class: name, style: `width:${(100 * s) / Math.max(whole, used)}%` }));
      const colour = `--head:var(--head${page.plans[1].heads[k] ? page.plans[1].heads[k].colour % 8 : 0})`;
      const who = alone ? "The head" : head.name, what = alone ? "" : ` · ${D.format.count(head.contours, "bead")}`;
      return e("li", { style: colour }, e("b", {}, who), ` ${said}${what}`,
        e("div", { class: "track", "aria-hidden": "true" }, ...drawn));
    };
    return e("div", { class: "card" }, e("h2", {}, alone ? "Where the time goes, after" : "How the heads are used"), speed(facts.speed_up, page.history.cooled, facts.cut), cut(facts.cut),
      e("ul", { class: "used" }, ...facts.heads.map(one)));
  }

  /** What was cut so that heads share it. */
  function cut(of) {
    if (!of) return null;
    const roles = of.roles.map(([name, n]) => `${D.format.number(n)} in ${name}`).join(", ");
    const shows = of.outside ? `${D.format.number(of.outside)} of them show` : "none of them shows";
    const age = (s) => (s < 60 ? `${s.toFixed(1)} s` : D.format.duration(s));
    const welds = of.welds ? ` Between the printing of a cut's two ends pass ${age(of.weld_median_s)} in the median, ${age(of.weld_most_s)} at most` +
      `${of.in_one_go ? `; ${D.format.number(of.in_one_go)} are printed in one go` : ""}.` : "";
    return e("p", {}, e("b", {}, `${D.format.count(of.contours, "contour")} cut at ${D.format.count(of.cuts, "place")}`),
      ` so that heads share them: ${roles}; ${shows}.${welds}`);
  }

  function speed(up, cooled, pieces) {
    if (!up) return null;
    const text = [e("b", {}, `${(up.one_head_s / up.makespan_s).toFixed(2)} times as fast`), ` as one head alone, which takes ${D.format.duration(up.one_head_s)}.`];
    if (up.bound_s) {
      const above = share(up.makespan_s - up.bound_s, up.makespan_s);
      text.push(` No plan for these heads can be shorter than ${D.format.duration(up.bound_s)} (proven${pieces ? " for the pieces as they are cut" : ""}), so at most ${above} is left to gain${cooled ? ", less what plastic needs to cool" : ""}.`);
    }
    return e("p", {}, ...text);
  }

  /** Heads that the plan does without. */
  function lost({ failed, lost: heads = {} }) {
    const lines = Object.entries(heads).map(([head, why]) => `${head} was lost, so the plan does without it: ${why}`);
    return failed ? [`The heads came to no plan (${failed}), so one head prints alone`, ...lines] : lines;
  }

  function warnings(lines) {
    if (!lines.length) return null;
    return e("div", { class: "card warned" }, e("h2", {}, lines.length > 1 ? `${lines.length} warnings` : "Warning"),
      e("ul", {}, ...lines.map((text) => e("li", {}, text))));
  }

  function settings(facts) {
    const rows = facts.settings.map(([k, v]) => [k, String(v)]);
    return D.table("Settings", ["setting", "value"], rows);
  }

  D.facts = { show };
})();
