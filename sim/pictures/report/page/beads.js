"use strict";
// Drawing with the graphics card: beads and lines as strips that face the viewer.
(() => {
  // How a segment is shown stands in the fourth byte of its colour.
  const SHOWN = { hidden: 0, ghost: 85, lit: 170, plain: 255 };

  // Everything is reckoned in the picture's own space: px to the right, px up, px to the viewer.
  // BEAD: round beads, each pixel lit; ROUGH: the same, lit as a whole; LINE: lines, some dashed.
  const VERTEX = `
  precision highp float;
  attribute vec2 corner;
  attribute vec3 from, to;
  attribute vec2 size, when;
  attribute vec4 tint;
  uniform mat4 placed;
  uniform vec3 upright;
  uniform vec2 scale, heights;
  uniform float nearer, now, wide, thick, tall;
  varying vec3 tone, lit;
  varying vec2 along;
  const vec3 light = vec3(-0.381, 0.421, 0.822);
  void main() {
    float first = min(when.x, when.y), last = max(when.x, when.y);
    if (first >= now || tint.a < 0.1) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
    vec3 a = from, b = to;
    if (now < last) {
      float share = (now - first) / (last - first);
      if (when.y >= when.x) b = mix(a, b, share); else a = mix(b, a, share);
    }
    float high = mix(a.z, b.z, corner.x);
    a = (placed * vec4(a, 1.0)).xyz;
    b = (placed * vec4(b, 1.0)).xyz;
    vec3 d = b - a;
    float len = length(d);
    d = len > 1e-6 ? d / len : vec3(1.0, 0.0, 0.0);
    float run = length(d.xy);
    vec2 t = run > 1e-3 ? d.xy / run : vec2(1.0, 0.0);
    vec2 p = vec2(-t.y, t.x);
    vec2 at = mix(a.xy, b.xy, corner.x);
  #ifdef LINE
    float half_width = 0.5 * wide, cap = half_width;
    tone = tint.rgb;
    // Lines of no height are dashed.
    along = vec2(corner.x * len * run, size.y < 0.5 ? 5.0 * wide : 0.0);
  #else
    float steep = dot(p, upright.xy);
    steep *= steep;
    vec2 bead = thick * size * vec2(1.0, tall);
    float round_half = sqrt(mix(bead.x * bead.x, bead.y * bead.y, steep));
    float half_width = max(round_half, 0.45), cap = 0.6 * half_width;
    float sheen = sqrt(max(0.0, 1.0 - pow(dot(d, light), 2.0)));
    float facing = sheen * (light.z * run - d.z * dot(t, light.xy));
    float ground = 0.86 + 0.14 * clamp(1.0 + high * heights.x + heights.y, 0.0, 1.0);
    tone = tint.rgb * ground;
    #ifdef ROUGH
    tone *= min(1.12, 0.5 + 0.525 * max(0.0, facing));
    #else
    float round = clamp(0.7 * round_half - 0.2, 0.0, 1.0); // thin beads shine evenly
    lit = vec3(corner.y * round, dot(p, light.xy) * sheen, facing * mix(0.84, 1.0, round));
    #endif
  #endif
    at += p * half_width * corner.y + t * cap * (2.0 * corner.x - 1.0);
    float depth = 0.5 * clamp(-mix(a.z, b.z, corner.x) * nearer, -1.0, 1.0);
    bool in_front = tint.a > 0.5 && tint.a < 0.8;
    gl_Position = vec4(at * scale, in_front ? depth - 0.5 : depth + 0.5, 1.0);
  }`;

  const FRAGMENT = `
  precision mediump float;
  varying vec3 tone, lit;
  varying vec2 along;
  void main() {
  #ifdef LINE
    if (along.y > 0.0 && mod(along.x, along.y) > 0.62 * along.y) discard;
  #endif
    vec3 colour = tone;
  #ifdef BEAD
    float facing = lit.y * lit.x + lit.z * sqrt(max(0.0, 1.0 - lit.x * lit.x));
    colour *= min(1.12, 0.5 + 0.625 * max(0.0, facing));
  #endif
    gl_FragColor = vec4(colour, 1.0);
  }`;

  const FACE_VERTEX = `
  precision highp float;
  attribute vec3 place;
  uniform vec3 right, up, back, target, shift;
  uniform vec2 scale;
  uniform float nearer;
  void main() {
    vec3 p = place + shift - target;
    float depth = 0.5 * clamp(-dot(p, back) * nearer, -1.0, 1.0) + 0.5;
    gl_Position = vec4(dot(p, right) * scale.x, dot(p, up) * scale.y, depth, 1.0);
  }`;

  const FACE_FRAGMENT = `
  precision mediump float;
  uniform vec4 colour;
  void main() { gl_FragColor = vec4(colour.rgb * colour.a, colour.a); }`;

  const CORNERS = [0, -1, 1, -1, 0, 1, 1, 1];
  const INSTANCED = 1; // rows of a segment's values on the graphics card
  const SPELLED_OUT = 4; // one for each corner

  /** Every `size` values of an array, four times over if each corner has rows of its own. */
  function repeated(data, size, rows) {
    if (rows === INSTANCED) return data;
    const words = (size * data.BYTES_PER_ELEMENT) / 4;
    const from = new Uint32Array(data.buffer, data.byteOffset, data.byteLength / 4);
    const out = new Uint32Array(4 * from.length);
    for (let k = 0, to = 0; k < from.length; k += words, to += 4 * words) {
      for (let m = 0; m < words; m++) {
        const value = from[k + m];
        const at = to + m;
        out[at] = value;
        out[at + words] = value;
        out[at + 2 * words] = value;
        out[at + 3 * words] = value;
      }
    }
    return new data.constructor(out.buffer);
  }

  /** Buffers of a set of segments on the graphics card, each made when it is first drawn. */
  function upload({ regl, rows }, set) {
    const made = new Map();
    const buffer = (name, data, size) => {
      if (!made.has(name)) made.set(name, regl.buffer({ data: repeated(data, size, rows), usage: "dynamic" }));
      return made.get(name);
    };
    return {
      set,
      made,
      place: () => buffer("place", set.place.subarray(0, 8 * set.n), 8),
      when: (plan) => buffer(`when ${plan}`, set.when[plan].subarray(0, 2 * set.n), 2),
      tint: (plan) => buffer(`tint ${plan}`, set.tint[plan].subarray(0, set.n), 1),
    };
  }

  /** Send changed colours of a set, if they have been drawn. */
  function recolour({ rows }, on, plan) {
    const buffer = on.made.get(`tint ${plan}`);
    if (!buffer) return;
    const data = repeated(on.set.tint[plan].subarray(0, on.set.n), 1, rows);
    buffer.subdata(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  }

  const release = ({ made }) => made.forEach((buffer) => buffer.destroy());

  /** What every picture needs of the camera: `box` is {x, y, width, height} in pixels drawn. */
  function seenBy(camera, box, ratio, reach, into) {
    return {
      ...D.camera.basis(camera),
      target: camera.target,
      zoom: camera.zoom,
      scale: [(2 * ratio) / box.width, (2 * ratio) / box.height],
      nearer: 1 / (reach * camera.zoom),
      pane: box,
      into,
    };
  }

  /** From a set's own numbers, 0 to 1 along each side of its box, to the picture's space: columns. */
  function placing({ set: { box: { low, high } } }, { right, up, back, target, zoom, shift = [0, 0, 0] }) {
    const axes = [right, up, back];
    const sides = [0, 1, 2].map((k) => Math.max(high[k] - low[k], 1e-6));
    const from = low.map((v, k) => v + shift[k] - target[k]);
    const column = (k) => axes.map((axis) => axis[k] * sides[k] * zoom);
    return [...column(0), 0, ...column(1), 0, ...column(2), 0,
      ...axes.map((axis) => D.camera.dot(axis, from) * zoom), 1];
  }

  /** The two triangles of a segment, written from a place on; returns the place behind them. */
  function quad(data, to, segment) {
    const first = 4 * segment;
    data[to] = first;
    data[to + 1] = data[to + 4] = first + 1;
    data[to + 2] = data[to + 3] = first + 2;
    data[to + 5] = first + 3;
    return to + 6;
  }

  /** Corners of strips for all that is drawn; spelled out, two triangles for each segment. */
  function corners({ regl, rows, most }) {
    const at = (data) => regl.buffer({ data, type: "int8" });
    if (rows === INSTANCED) return { at: at(Int8Array.from(CORNERS)) };
    const places = new Int8Array(8 * most);
    for (let k = 0; k < places.length; k++) places[k] = CORNERS[k & 7];
    const data = new Uint32Array(6 * most);
    for (let k = 0; k < most; k++) quad(data, 6 * k, k);
    return { at: at(places), elements: regl.elements({ data, primitive: "triangles", type: "uint32" }) };
  }

  /**
   * What draws strips: `begin` and `count` are segments.
   * Instances are drawn one by one where the processor does the graphics, many times slower than
   * as triangles of one list; there each segment's values stand four times, once for each corner.
   * @param {object} drawing  {regl, rows, corners}
   * @param {string} kind  BEAD, ROUGH, LINE, or FIRST: lines in front of all
   */
  function strips({ regl, rows, corners }, named) {
    const kind = named === "FIRST" ? "LINE" : named;
    const once = rows === INSTANCED;
    const of = (buffer, offset, size, type, normalized, stride) => (context, props) => ({
      buffer: buffer(props), offset: offset + (once ? props.begin * stride : 0), stride, size, type,
      normalized, divisor: once ? 1 : 0,
    });
    const place = (props) => props.on.place();
    return regl({
      vert: `#define ${kind}\n${VERTEX}`,
      frag: `#define ${kind}\n${FRAGMENT}`,
      attributes: {
        corner: { buffer: corners.at, size: 2, divisor: 0, normalized: false },
        from: of(place, 0, 3, "uint16", true, 16),
        to: of(place, 6, 3, "uint16", true, 16),
        size: of(place, 12, 2, "uint8", true, 16),
        when: of((props) => props.on.when(props.plan), 0, 2, "float32", false, 8),
        tint: of((props) => props.on.tint(props.plan), 0, 4, "uint8", true, 4),
      },
      ...(once ? { primitive: "triangle strip", count: 4, instances: regl.prop("count") } : {
        elements: (context, props) => props.elements ?? corners.elements,
        offset: (context, { begin }) => 6 * begin,
        count: (context, { count }) => 6 * count,
      }),
      uniforms: {
        placed: (context, props) => placing(props.on, props),
        upright: (context, { right, up, back }) => [right[2], up[2], back[2]],
        heights: (context, { on: { set: { box } }, top }) => (
          [0.2 * (box.high[2] - box.low[2]), 0.2 * (box.low[2] - top)]),
        thick: (context, { largest, zoom }) => 0.5 * largest * zoom,
        ...Object.fromEntries(["scale", "nearer", "now", "wide", "tall"].map((name) => [name, regl.prop(name)])),
      },
      framebuffer: regl.prop("into"),
      viewport: regl.prop("pane"),
      scissor: { enable: true, box: regl.prop("pane") },
      depth: { enable: true, func: named === "FIRST" ? "always" : "lequal", mask: true },
      cull: { enable: false },
    });
  }

  function faces(regl) {
    return regl({
      vert: FACE_VERTEX,
      frag: FACE_FRAGMENT,
      attributes: { place: regl.prop("place") },
      uniforms: {
        ...Object.fromEntries(["right", "up", "back", "target", "shift", "colour"].map((name) => [name, regl.prop(name)])),
        scale: (context, { scale, zoom }) => scale.map((v) => v * zoom),
        nearer: (context, { nearer, zoom }) => nearer * zoom,
      },
      count: regl.prop("count"),
      framebuffer: regl.prop("into"),
      viewport: regl.prop("pane"),
      scissor: { enable: true, box: regl.prop("pane") },
      depth: { enable: true, func: "less", mask: false },
      blend: { enable: true, func: { src: "one", dst: "one minus src alpha" } },
      cull: { enable: false },
    });
  }

  /** What lays a picture drawn elsewhere, finer, over the canvas. */
  function copies(regl) {
    return regl({
      vert: "precision highp float; attribute vec2 corner; varying vec2 at;"
        + "void main() { at = 0.5 + 0.5 * corner; gl_Position = vec4(corner, 0.0, 1.0); }",
      frag: "precision mediump float; uniform sampler2D picture; varying vec2 at;"
        + "void main() { gl_FragColor = texture2D(picture, at); }",
      attributes: { corner: [[-1, -1], [3, -1], [-1, 3]] },
      uniforms: { picture: regl.prop("picture") },
      count: 3,
      depth: { enable: false },
    });
  }

  D.beads = { SHOWN, INSTANCED, SPELLED_OUT, upload, recolour, release, seenBy, quad, corners, strips, faces, copies };
})();
