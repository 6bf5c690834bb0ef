"use strict";
// Drawing with the graphics card: beads and lines as strips that face the viewer.
(() => {
  // How a segment is shown stands in the fourth byte of its colour.
  const SHOWN = { hidden: 0, ghost: 85, lit: 170, plain: 255 };

  const VERTEX = `
  precision highp float;
  attribute vec2 corner;
  attribute vec3 from, to;
  attribute vec2 size, when;
  attribute vec4 tint;
  uniform vec3 low, span, right, up, back, target, light;
  uniform vec2 scale;
  uniform float nearer, pixel, now, least, wide, largest, tall, top;
  varying vec3 tone, lit;
  varying vec2 along;
  void main() {
    float first = min(when.x, when.y), last = max(when.x, when.y);
    if (first >= now || tint.a < 0.1) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
    vec3 a = low + from * span, b = low + to * span;
    if (now < last) {
      float share = (now - first) / (last - first);
      if (when.y >= when.x) b = mix(a, b, share); else a = mix(b, a, share);
    }
    vec3 d = b - a;
    float len = length(d);
    d = len > 1e-6 ? d / len : right;
    vec2 seen = vec2(dot(d, right), dot(d, up));
    float run = length(seen);
    vec2 t = run > 1e-3 ? seen / run : vec2(1.0, 0.0);
    vec3 p = t.x * up - t.y * right;
    vec3 q = cross(d, p);
    if (dot(q, back) < 0.0) q = -q;
    vec3 s = cross(d, vec3(0.0, 0.0, 1.0));
    float level = length(s);
    s = level > 1e-3 ? s / level : p;
    vec3 u = cross(s, d);
    vec2 half_size = 0.5 * largest * size * vec2(1.0, level > 1e-3 ? tall : size.x / size.y);
    float half_width = length(vec2(half_size.x * dot(s, p), half_size.y * dot(u, p)));
    if (wide > 0.0) half_width = 0.0;
    float shown = max(half_width, max(least, 0.5 * wide) * pixel);
    vec3 end = mix(a, b, corner.x);
    float cap = shown * (wide > 0.0 ? 1.0 : 0.6) * (2.0 * corner.x - 1.0);
    vec3 at = end + p * shown * corner.y + (t.x * right + t.y * up) * cap;
    float depth = -dot(end - target, back) * nearer;
    bool in_front = tint.a > 0.5 && tint.a < 0.8;
    depth = in_front ? 0.5 * clamp(depth, -1.0, 1.0) - 0.5 : 0.5 * clamp(depth, -1.0, 1.0) + 0.5;
    gl_Position = vec4(dot(at - target, right) * scale.x, dot(at - target, up) * scale.y, depth, 1.0);
    float sheen = sqrt(max(0.0, 1.0 - pow(dot(d, light), 2.0)));
    float below = exp(min(0.0, end.z - top) * 0.4);
    float ground = mix(0.86, 1.0, below);
    float round = clamp(0.7 * half_width / pixel - 0.2, 0.0, 1.0); // thin beads shine evenly
    lit = vec3(corner.y * round, dot(p, light) * sheen, dot(q, light) * sheen * mix(0.84, 1.0, round));
    tone = tint.rgb * (wide > 0.0 ? 1.0 : ground);
    // Lines of little height are dashed.
    along = vec2((corner.x * len * run + cap) / pixel, wide > 0.0 && size.y < 0.5 ? 5.0 * wide : 0.0);
  }`;

  const FRAGMENT = `
  precision mediump float;
  uniform float ambient;
  varying vec3 tone, lit;
  varying vec2 along;
  void main() {
    if (along.y > 0.0 && mod(along.x, along.y) > 0.62 * along.y) discard;
    float facing = lit.y * lit.x + lit.z * sqrt(max(0.0, 1.0 - lit.x * lit.x));
    gl_FragColor = vec4(tone * min(1.12, ambient + (1.0 - ambient) * 1.25 * max(0.0, facing)), 1.0);
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
    for (let k = 0, to = 0; k < from.length; k += words) {
      for (let r = 0; r < 4; r++) for (let m = 0; m < words; m++) out[to++] = from[k + m];
    }
    return new data.constructor(out.buffer);
  }

  /** Buffers of a set of segments on the graphics card. */
  function upload({ regl, rows }, set) {
    const buffer = (data, size, usage) => regl.buffer({ data: repeated(data, size, rows), usage });
    return {
      set,
      place: buffer(set.place.subarray(0, 8 * set.n), 8, "static"),
      when: set.when.map((data) => buffer(data.subarray(0, 2 * set.n), 2, "static")),
      tint: set.tint.map((data) => buffer(data.subarray(0, set.n), 1, "dynamic")),
    };
  }

  /** Send changed colours of a set. */
  function recolour({ rows }, on, plan) {
    const data = repeated(on.set.tint[plan].subarray(0, on.set.n), 1, rows);
    on.tint[plan].subdata(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  }

  const release = ({ place, when, tint }) => [place, ...when, ...tint].forEach((b) => b.destroy());

  /** What every picture needs of the camera: `box` is {x, y, width, height} in pixels drawn. */
  function seenBy(camera, box, ratio, reach, into) {
    return {
      ...D.camera.basis(camera),
      target: camera.target,
      scale: [(2 * camera.zoom * ratio) / box.width, (2 * camera.zoom * ratio) / box.height],
      nearer: 1 / reach,
      pixel: 1 / camera.zoom,
      pane: box,
      into,
    };
  }

  /** Light from the upper left, a little behind the viewer. */
  function lightOf({ right, up, back }) {
    const sum = right.map((v, k) => -0.38 * v + 0.42 * up[k] + 0.82 * back[k]);
    const size = Math.hypot(...sum);
    return sum.map((v) => v / size);
  }

  const camera = (regl) => Object.fromEntries(
    ["right", "up", "back", "target", "scale", "nearer"].map((name) => [name, regl.prop(name)]));

  /**
   * What draws strips: `begin` and `count` are segments.
   * Instances are drawn one by one where the processor does the graphics, many times slower than
   * as triangles of one list; there each segment's values stand four times, once for each corner.
   * @param {object} drawing  {regl, rows, most: segments of the largest set}
   */
  function strips({ regl, rows, most }) {
    const once = rows === INSTANCED;
    const of = (buffer, offset, size, type, normalized, stride) => (context, props) => ({
      buffer: buffer(props), offset: offset + (once ? props.begin * stride : 0), stride, size, type,
      normalized, divisor: once ? 1 : 0,
    });
    const place = (props) => props.on.place;
    const corners = new Int8Array(once ? CORNERS : 8 * most);
    if (!once) for (let k = 0; k < corners.length; k++) corners[k] = CORNERS[k & 7];
    return regl({
      vert: VERTEX,
      frag: FRAGMENT,
      attributes: {
        corner: { buffer: regl.buffer({ data: corners, type: "int8" }), size: 2, divisor: 0, normalized: false },
        from: of(place, 0, 3, "uint16", true, 16),
        to: of(place, 6, 3, "uint16", true, 16),
        size: of(place, 12, 2, "uint8", true, 16),
        when: of((props) => props.on.when[props.plan], 0, 2, "float32", false, 8),
        tint: of((props) => props.on.tint[props.plan], 0, 4, "uint8", true, 4),
      },
      ...(once ? { primitive: "triangle strip", count: 4, instances: regl.prop("count") } : {
        elements: triangles(regl, most),
        offset: (context, { begin }) => 6 * begin,
        count: (context, { count }) => 6 * count,
      }),
      uniforms: {
        ...camera(regl),
        low: (context, { on, shift }) => on.set.box.low.map((v, k) => v + (shift ? shift[k] : 0)),
        span: (context, { on }) => on.set.box.high.map((v, k) => Math.max(v - on.set.box.low[k], 1e-6)),
        light: (context, props) => lightOf(props),
        pixel: regl.prop("pixel"),
        now: regl.prop("now"),
        least: regl.prop("least"),
        wide: regl.prop("wide"),
        largest: regl.prop("largest"),
        tall: regl.prop("tall"),
        top: regl.prop("top"),
        ambient: regl.prop("ambient"),
      },
      framebuffer: regl.prop("into"),
      viewport: regl.prop("pane"),
      scissor: { enable: true, box: regl.prop("pane") },
      depth: { enable: true, func: "lequal", mask: true },
      cull: { enable: false },
    });
  }

  /** Two triangles for each segment. */
  function triangles(regl, most) {
    const data = new Uint32Array(6 * most);
    for (let k = 0, at = 0; k < most; k++) {
      for (const v of [0, 1, 2, 2, 1, 3]) data[at++] = 4 * k + v;
    }
    return regl.elements({ data, primitive: "triangles", type: "uint32" });
  }

  function faces(regl) {
    return regl({
      vert: FACE_VERTEX,
      frag: FACE_FRAGMENT,
      attributes: { place: regl.prop("place") },
      uniforms: { ...camera(regl), shift: regl.prop("shift"), colour: regl.prop("colour") },
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

  const BEAD = { least: 0.45, wide: 0, tall: 1, ambient: 0.5 };
  const LINE = { least: 0, wide: 1.2, tall: 1, ambient: 1 };

  D.beads = { SHOWN, BEAD, LINE, INSTANCED, SPELLED_OUT, upload, recolour, release, seenBy, strips, faces, copies };
})();
