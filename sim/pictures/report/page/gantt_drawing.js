"use strict";
/* The Gantt's picture. Every pixel column is filled by the shares of its time, so that nothing is
   skipped however many actions there are; long waits are marked even where they are thin. */
(() => {
  const { PRINT, TRAVEL, ASIDE, WAIT, NOTHING, KINDS } = D.timeline;
  const BAND = 36, BAR = 40, CHAIN = 7, GAP = 10, AXIS = 34, LANE = 17, PLANNED = 12; // CSS pixels
  const rowHeight = () => BAND + BAR + CHAIN + GAP + (D.page.run ? PLANNED : 0);
  const ORDER = [PRINT, TRAVEL, ASIDE, WAIT]; // from the foot of a bar
  const MARKED = 40; // so many of the longest waits are marked however thin
  const TRIED = 400; // labels of so many waits are tried
  const LABELLED = 0.002; // of the time shown: a shorter wait gets no label
  const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 432000];
  const APART = 6; // pixels between two lines of the critical path
  const FONT = "12px system-ui, sans-serif";

  const height = (rows) => rows.length * rowHeight() + AXIS;
  const barTop = (row) => row * rowHeight() + BAND;
  const xOf = (view, seconds) => view.left + ((seconds - view.from) / (view.to - view.from)) * (view.width - view.left);
  const secondsOf = (view, x) => view.from + ((x - view.left) / (view.width - view.left)) * (view.to - view.from);

  /** Fill styles of each kind; a head prints in its own colour. */
  function fills(context, head) {
    const panel = D.colour("--panel");
    const filled = [];
    filled[PRINT] = D.colour(`--head${D.page.plans[1].heads[head].colour % 8}`);
    filled[TRAVEL] = D.pattern(context, "travel", D.colour("--travel"), panel);
    filled[ASIDE] = D.pattern(context, "aside", D.colour("--fg"), panel);
    filled[WAIT] = D.pattern(context, "waits", D.colour("--fg"), D.colour("--bg"));
    return filled;
  }

  /** Rectangles of a head's bar in device pixels, for each kind: [x, y, width, height, …]. */
  function columns(row, view, top, tall) {
    const { ratio } = view;
    const first = Math.round(view.left * ratio), last = Math.round(view.width * ratio);
    const per = (view.to - view.from) / (last - first);
    const shares = new Float64Array(KINDS), open = new Float64Array(KINDS).fill(-1);
    const rects = ORDER.map(() => []);
    const foot = (top + tall) * ratio, size = tall * ratio;
    let s = row.segment(view.from);
    for (let x = first; x <= last; x++) {
      const from = view.from + (x - first) * per;
      s = x < last ? row.shares(from, from + per, shares, s) : s;
      let y = foot;
      for (const kind of ORDER) {
        const whole = x < last && shares[kind] > 0.999;
        if (whole && open[kind] < 0) open[kind] = x;
        if (!whole && open[kind] >= 0) {
          rects[kind].push(open[kind], foot - size, x - open[kind], size);
          open[kind] = -1;
        }
        if (x < last && !whole && shares[kind] > 0.002) {
          const part = shares[kind] * size;
          rects[kind].push(x, y - part, 1, part);
          y -= part;
        }
      }
    }
    return rects;
  }

  function drawBar(context, row, view, top, tall = BAR) {
    const { ratio } = view;
    const filled = fills(context, row.head);
    context.fillStyle = D.colour("--panel");
    context.fillRect(view.left * ratio, top * ratio, (view.width - view.left) * ratio, tall * ratio);
    columns(row, view, top, tall).forEach((rects, kind) => {
      context.fillStyle = filled[kind];
      context.beginPath(); // one fill for thousands of rectangles
      for (let k = 0; k < rects.length; k += 4) context.rect(rects[k], rects[k + 1], rects[k + 2], rects[k + 3]);
      context.fill();
    });
  }

  /** What a head did of a plan made anew, from when that began. */
  function drawAnew(context, row, view, begin_s) {
    const x = Math.max(view.left, xOf(view, begin_s));
    if (x >= view.width) return;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.save();
    context.beginPath();
    context.rect(x * view.ratio, 0, (view.width - x) * view.ratio, context.canvas.height);
    context.clip();
    drawBar(context, row, view, barTop(row.head));
    context.restore();
  }

  /** Lines through all heads at some times. */
  function drawMoments(context, rows, view, times, colour) {
    context.strokeStyle = D.colour(colour);
    context.lineWidth = 2;
    context.setLineDash([5, 3]);
    context.beginPath();
    for (const time of times.filter((t) => t >= view.from && t <= view.to)) {
      context.moveTo(xOf(view, time), 0);
      context.lineTo(xOf(view, time), rows.length * rowHeight());
    }
    context.stroke();
    context.setLineDash([]);
    context.lineWidth = 1;
  }

  /** Black or white, whichever is read better on a colour #rrggbb. */
  function inkOn(colour) {
    const [r, g, b] = [1, 3, 5].map((k) => (parseInt(colour.slice(k, k + 2), 16) / 255) ** 2.2);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.18 ? "#000" : "#fff";
  }

  /** Borders and numbers of beads, where they are wide enough to be seen. */
  function drawBeads(context, row, view, top) {
    const from = row.segment(view.from), until = row.segment(view.to);
    if (until - from > (view.width - view.left) / 6) return;
    const ink = inkOn(D.colour(`--head${D.page.plans[1].heads[row.head].colour % 8}`));
    context.lineWidth = 1;
    for (let s = from; s <= until; s++) {
      if (row.kind[s] !== PRINT) continue;
      const a = Math.max(view.left, xOf(view, row.begin[s])), b = Math.min(view.width, xOf(view, row.end[s]));
      context.strokeStyle = D.colour("--bg");
      context.strokeRect(a + 0.5, top + 0.5, Math.max(1, b - a - 1), BAR - 1);
      const text = String(D.page.plans[1].heads[row.head].contour[row.action[s]]);
      if (b - a < context.measureText(text).width + 8) continue;
      context.fillStyle = ink;
      context.fillText(text, a + 4, top + BAR / 2 + 4);
    }
  }

  /** Marks of the longest waits in view, at least 3 pixels wide. */
  function drawMarks(context, row, view, top, longest) {
    context.fillStyle = context.strokeStyle = D.colour("--fg");
    context.lineWidth = 1;
    for (const wait of longest) {
      if (wait.head !== row.head || wait.end_s < view.from || wait.begin_s > view.to) continue;
      const a = Math.max(view.left, xOf(view, wait.begin_s));
      const wide = Math.max(3, Math.min(view.width, xOf(view, wait.end_s)) - a);
      context.strokeRect(a + 0.5, top + 0.5, wide - 1, BAR - 1);
    }
  }

  /** Texts above the bars: the longest waits first, whole if there is space, else shorter. */
  function placeLabels(context, rows, view, longest) {
    const placed = [], lanes = rows.map(() => [[], []]);
    const least = LABELLED * (view.to - view.from);
    let tried = 0;
    for (const wait of longest) {
      if (wait.end_s - wait.begin_s < least) break;
      if (wait.end_s <= view.from || wait.begin_s >= view.to) continue;
      if (tried++ > TRIED) break;
      const x = Math.max(view.left, xOf(view, wait.begin_s)) + 4;
      fit(context, wait, x, lanes[wait.head], view, placed);
    }
    return placed;
  }

  function fit(context, wait, x, lanes, view, placed) {
    for (const text of D.words.labels(wait)) {
      if (!text) return;
      const wide = context.measureText(text).width + 10;
      const from = Math.max(view.left, Math.min(x, view.width - wide + 6));
      if (from + wide > view.width + 6) continue;
      const lane = lanes.findIndex((taken) => taken.every(([a, b]) => from + wide < a || from > b));
      if (lane < 0) continue;
      lanes[lane].push([from - 4, from + wide]);
      placed.push({ wait, text, head: wait.head, lane, x: from, foot: x - 4 });
      return;
    }
  }

  function drawLabels(context, placed) {
    context.lineWidth = 1;
    for (const { head, lane, x, foot, text } of placed) {
      const y = head * rowHeight() + BAND - 5 - lane * LANE;
      context.strokeStyle = D.colour("--muted");
      context.beginPath();
      context.moveTo(Math.round(foot) + 0.5, y - 9);
      context.lineTo(Math.round(foot) + 0.5, head * rowHeight() + BAND);
      context.stroke();
      context.fillStyle = D.colour("--bg");
      context.fillRect(x - 2, y - 12, context.measureText(text).width + 4, 15);
      context.fillStyle = D.colour("--fg");
      context.fillText(text, x, y);
    }
  }

  /** The critical path: a strip below the bars, and lines where it changes head. */
  function drawChain(context, rows, view, critical) {
    context.fillStyle = context.strokeStyle = D.colour("--bad");
    context.lineWidth = 1;
    const foot = (head) => barTop(head) + BAR + 2;
    const done = new Float64Array(rows.length).fill(-1);
    const lines = [];
    let was = -1;
    context.beginPath();
    critical.forEach(([head, action], k) => {
      const row = rows[head], s = row.actionSegment[action];
      const a = Math.max(view.left, xOf(view, row.begin[s])), b = Math.min(view.width, xOf(view, row.end[s]));
      if (b >= done[head] + 0.5 && b > a) {
        context.rect(Math.max(done[head], a), foot(head), b - Math.max(done[head], a) + 0.5, CHAIN - 3);
        done[head] = b;
      }
      if (k && critical[k - 1][0] !== head && a > view.left && a < view.width && a - was > APART) {
        lines.push([Math.round((was = a)) + 0.5, foot(critical[k - 1][0]) + 2, foot(head) + 2]);
      }
    });
    context.fill();
    context.beginPath();
    for (const [x, from, to] of lines) {
      context.moveTo(x, from);
      context.lineTo(x, to);
    }
    context.stroke();
  }

  function drawAxis(context, rows, view) {
    const top = rows.length * rowHeight();
    const wide = view.width - view.left;
    const step = STEPS.find((s) => (s / (view.to - view.from)) * wide > 74) || STEPS[STEPS.length - 1];
    context.strokeStyle = D.colour("--line");
    context.fillStyle = D.colour("--muted");
    context.lineWidth = 1;
    for (let k = Math.ceil(view.from / step); k * step <= view.to; k++) {
      const x = Math.round(xOf(view, k * step)) + 0.5;
      context.beginPath();
      context.moveTo(x, 0);
      context.lineTo(x, top + 5);
      context.stroke();
      const text = step < 1 ? `${(k * step).toFixed(1)} s` : D.format.clock(k * step);
      const half = context.measureText(text).width / 2;
      context.fillText(text, Math.min(Math.max(x - half, view.left), view.width - 2 * half), top + 18);
    }
    context.fillText("h:min:s", 0, top + 18);
  }

  function drawNames(context, rows, view) {
    context.fillStyle = D.colour("--fg");
    for (const row of rows) {
      context.save();
      context.beginPath();
      context.rect(0, row.head * rowHeight(), view.left - 6, rowHeight());
      context.clip();
      context.font = `600 13px system-ui, sans-serif`;
      context.fillText(row.name, 0, barTop(row.head) + BAR / 2 + 4);
      if (D.page.run) {
        context.font = FONT;
        context.fillStyle = D.colour("--muted");
        context.fillText("planned", 0, barTop(row.head) + BAR + CHAIN + PLANNED - 3);
        context.fillStyle = D.colour("--fg");
      }
      context.restore();
    }
  }

  /** Draw all but what moves. Returns the labels that are shown. */
  function draw(context, rows, view, { longest, critical, planned, anew, failed }) {
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, context.canvas.width, context.canvas.height);
    context.font = FONT;
    const scaled = () => context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    scaled();
    drawAxis(context, rows, view);
    for (const row of rows) {
      context.setTransform(1, 0, 0, 1, 0, 0);
      drawBar(context, row, view, barTop(row.head));
      if (planned.length) drawBar(context, planned[row.head], view, barTop(row.head) + BAR + CHAIN, PLANNED - 2);
      scaled();
      drawBeads(context, row, view, barTop(row.head));
      drawMarks(context, row, view, barTop(row.head), longest.slice(0, MARKED));
    }
    for (const { begin_s, row } of anew) drawAnew(context, row, view, begin_s);
    scaled();
    const began = [...new Set(anew.map(({ begin_s }) => begin_s))];
    drawMoments(context, rows, view, failed.map(({ time_s }) => time_s), "--bad");
    drawMoments(context, rows, view, began, "--accent");
    if (critical) drawChain(context, rows, view, critical);
    const placed = placeLabels(context, rows, view, longest);
    drawLabels(context, placed);
    drawNames(context, rows, view);
    return placed;
  }

  /** Draw what moves: the time, what is selected and what is pointed at. */
  function drawOver(context, rows, view, { time, selected, focus }) {
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, context.canvas.width, context.canvas.height);
    context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    context.font = FONT;
    for (const [box, colour, dash] of [[selected, "--accent", []], [focus, "--fg", [4, 3]]]) {
      if (!box || box.end_s < view.from || box.begin_s > view.to) continue;
      const a = Math.max(view.left, xOf(view, box.begin_s)), b = Math.min(view.width, xOf(view, box.end_s));
      context.strokeStyle = D.colour(colour);
      context.lineWidth = 3;
      context.setLineDash(dash);
      context.strokeRect(a - 2, barTop(box.head) - 2, Math.max(4, b - a + 4), BAR + 4);
    }
    context.setLineDash([]);
    if (time < view.from || time > view.to) return;
    const x = xOf(view, time), top = rows.length * rowHeight();
    context.fillStyle = D.colour("--accent");
    context.fillRect(x - 1, 0, 2, top + 6);
    const text = D.format.clock(time), half = context.measureText(text).width / 2 + 5;
    const left = Math.min(Math.max(x - half, 0), view.width - 2 * half);
    context.fillRect(left, top + 4, 2 * half, 19);
    context.fillStyle = D.colour("--bg");
    context.fillText(text, left + 5, top + 18);
  }

  D.ganttDrawing = { draw, drawOver, height, xOf, secondsOf, rowHeight, BAND, BAR, NOTHING };
})();
