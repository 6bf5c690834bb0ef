"use strict";
/* What each head does at a time: segments of one kind without holes, and shares of any span. */
(() => {
  const PRINT = 0, TRAVEL = 1, ASIDE = 2, WAIT = 3, NOTHING = 4;
  const KINDS = 5;
  const VERBS = ["prints", "travels", "steps aside", "waits", "has nothing to do"];
  const LEAST_GAP_S = 0.02; // times are 32-bit floats: shorter holes are rounding

  /** A way that leads to no bead is stepping aside, but for the last one, which leads home. */
  function kindOf(head, a) {
    const kind = head.kind[a];
    if (kind === PRINT || kind === WAIT) return kind;
    return a === head.n - 1 || head.kind[a + 1] === PRINT ? TRAVEL : ASIDE;
  }

  /** Segments of a head: its actions, and the holes between them as waits. */
  function segments(head, end_s) {
    const begin = [], end = [], kind = [], action = [];
    const add = (b, e, k, a) => { begin.push(b); end.push(e); kind.push(k); action.push(a); };
    let at = 0;
    for (let a = 0; a < head.n; a++) {
      if (head.begin[a] - at > LEAST_GAP_S) add(at, head.begin[a], WAIT, -1);
      const from = head.begin[a] - at > LEAST_GAP_S ? head.begin[a] : at;
      add(from, Math.max(from, head.end[a]), kindOf(head, a), a);
      at = Math.max(at, head.end[a]);
    }
    if (end_s - at > LEAST_GAP_S) add(at, end_s, NOTHING, -1);
    return { begin: Float64Array.from(begin), end: Float64Array.from(end), kind: Uint8Array.from(kind), action: Int32Array.from(action) };
  }

  /** Seconds of each kind up to the begin of each segment, (n + 1) × KINDS. */
  function sums(row) {
    const n = row.kind.length;
    const total = new Float64Array((n + 1) * KINDS);
    for (let s = 0; s < n; s++) {
      for (let k = 0; k < KINDS; k++) total[(s + 1) * KINDS + k] = total[s * KINDS + k];
      total[(s + 1) * KINDS + row.kind[s]] += row.end[s] - row.begin[s];
    }
    return total;
  }

  /** One head's row: `segment(t)`, `shares(from, to, out)` and the waits in it. */
  class Row {
    constructor(head, index, end_s, waits) {
      Object.assign(this, segments(head, end_s));
      this.name = head.name;
      this.head = index;
      this.total = sums(this);
      this.waits = waits.filter((wait) => wait.head === index);
      this.waitBegin = Float64Array.from(this.waits.map((wait) => wait.begin_s));
      this.actionSegment = new Int32Array(head.n);
      this.action.forEach((a, s) => { if (a >= 0) this.actionSegment[a] = s; });
    }

    /** The segment at a time. */
    segment(seconds) {
      return Math.max(0, D.lastUpTo(this.begin, seconds));
    }

    /** The wait at a time, or null. */
    wait(seconds) {
      const found = D.lastUpTo(this.waitBegin, seconds + LEAST_GAP_S / 2);
      return found >= 0 && seconds <= this.waits[found].end_s ? this.waits[found] : null;
    }

    /** Seconds of a kind from the start until `seconds`, which lies in or before segment `s`. */
    upTo(s, seconds, kind) {
      const within = this.kind[s] === kind ? Math.min(this.end[s], seconds) - this.begin[s] : 0;
      return this.total[s * KINDS + kind] + Math.max(0, within);
    }

    /** Write the share of each kind between two times into `out`; returns the last segment. */
    shares(from, to, out, first = this.segment(from)) {
      let until = first;
      while (until + 1 < this.kind.length && this.begin[until + 1] < to) until++;
      const span = Math.max(1e-9, to - from);
      for (let k = 0; k < KINDS; k++) {
        out[k] = (this.upTo(until, to, k) - this.upTo(first, from, k)) / span;
      }
      return until;
    }
  }

  /** Seconds of the critical chain on each head, how often it changes head, and what it waits. */
  function chain(rows, critical) {
    const on = new Float64Array(rows.length);
    let handed = 0, waited = 0, at = 0;
    critical.forEach(([head, action], k) => {
      const s = rows[head].actionSegment[action];
      const begin = Math.max(at, rows[head].begin[s]);
      waited += k ? Math.max(0, rows[head].begin[s] - at) : 0;
      on[head] += Math.max(0, rows[head].end[s] - begin);
      at = Math.max(at, rows[head].end[s]);
      handed += k && critical[k - 1][0] !== head ? 1 : 0;
    });
    return { on: [...on], handed, waited };
  }

  D.timeline = { PRINT, TRAVEL, ASIDE, WAIT, NOTHING, KINDS, VERBS, Row, chain };
})();
