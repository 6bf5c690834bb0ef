"use strict";
/* What is said of times, beads and waits: the same words in the Gantt, its lists and the charts. */
(() => {
  /** Why a head waits: short, behind "for right: bead 812, …", and as a heading of its sum. */
  const CAUSES = {
    support: ["needs what it lies on", "what it lies on, or must not be blocked by, is not printed yet"],
    order: ["keeps the slicer's order of walls and fill", "the slicer's order of walls and fill"],
    space: ["is in the way", "another head is in the way"],
    cooling: ["is still too warm to print over", "what lies below has to cool"],
    priming: ["primes the nozzle first", "the nozzle's priming comes first"],
    tool: ["comes before settings change", "settings change there: first layer, fan, temperature, tool"],
    layers: ["would be left too many layers behind", "no head runs too many layers ahead"],
    signal: ["stops to be heard", "a short stop in which heads signal each other"],
    end: ["nothing is left to do", "nothing is left to do"],
  };

  /** What a head does that prints nothing; in a run it may have failed. */
  const unused = () => (D.page.run ? "printed nothing" : "is not used: no plan found is shorter with it");
  const long = (cause) => (cause === "unused" ? `a head ${unused()}` : (CAUSES[cause] || ["", cause])[1]);
  const short = (cause) => (CAUSES[cause] || [cause])[0];

  const after = () => D.page.plans[1];
  const headName = (head) => after().heads[head].name;

  /** The bead an action of the plan prints: "bead 812"; null where it prints none. */
  const bead = (head, action) => {
    const contour = action === null ? -1 : after().heads[head].contour[action];
    return contour < 0 ? null : `bead ${contour}`;
  };

  /** The last bead a head has begun by an action; -1: none. */
  const beadBy = (head, action) => {
    const { contour } = after().heads[head];
    let k = action;
    while (k >= 0 && contour[k] < 0) k--;
    return k < 0 ? -1 : contour[k];
  };

  /** The next bead of a head from an action on; -1: none. */
  const beadFrom = (head, action) => {
    const { contour, n } = after().heads[head];
    let k = action;
    while (k < n && contour[k] < 0) k++;
    return k < n ? contour[k] : -1;
  };

  /** What makes way: "bead 812 is in the way", or "to make way after bead 812". */
  const makesWay = (wait, what) => {
    if (what) return `: ${what} is in the way`;
    const contour = wait.other_action === null ? -1 : beadBy(wait.other_head, wait.other_action);
    return contour < 0 ? " to make way" : ` to make way after bead ${contour}`;
  };

  /** Role, layer and line of the source of a contour, in brackets. */
  const origin = (contour) => {
    const { role, layer, line } = D.page.contours;
    const parts = [D.page.roles[role[contour]], `layer ${layer[contour] + 1}`];
    if (line[contour] > 0) parts.push(`line ${line[contour]} of the file`);
    return `(${parts.join(", ")})`;
  };

  /** What a wait is for, without its length: "for right: bead 812, needs what it lies on". */
  const reason = (wait) => {
    if (wait.other_head === null) return `: ${long(wait.cause)}`;
    const name = headName(wait.other_head);
    const what = bead(wait.other_head, wait.other_action);
    const why = short(wait.cause);
    if (wait.cause === "space") return ` for ${name}${makesWay(wait, what)}`;
    if (wait.cause === "support" || wait.cause === "order") {
      return ` for ${name}${what ? `: ${what},` : ","} ${why}`;
    }
    return ` for ${name}${what ? `: ${what}` : ""}, ${long(wait.cause)}`;
  };

  /** Three lengths of a wait's label, the longest first. */
  const labels = (wait) => {
    const time = D.format.duration(wait.end_s - wait.begin_s);
    if (wait.cause === "unused") return [unused(), D.page.run ? "nothing" : "not used", ""];
    if (wait.cause === "end") return [`${time}: nothing is left to do`, "done", ""];
    const other = wait.other_head === null ? "" : ` for ${headName(wait.other_head)}`;
    const what = wait.other_head === null ? null : bead(wait.other_head, wait.other_action);
    return [
      `waits ${time}${reason(wait)}`,
      `${time}${other}${what ? `: ${what}` : other ? "" : `: ${wait.cause}`}`,
      time,
    ];
  };

  D.words = { long, headName, bead, beadBy, beadFrom, origin, reason, labels };
})();
