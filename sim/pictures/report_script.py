"""The script of the report page: it draws the curves and moves the time slider.

Curves arrive as base64 of little-endian float32 columns x, y, z, seconds; a NaN
point ends a path. No other code is in the page but plotly's own.
"""

SCRIPT = """
const floats = text => {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
};
const curves = PAGE.curves.map(c => ({...c, x: floats(c.x), y: floats(c.y), z: floats(c.z),
  t: floats(c.t)}));
const upto = (times, t) => {  // how many points are reached by t; times ascend
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle + 1; else high = middle;
  }
  return low;
};
const lines = curves.map(c => ({
  type: 'scatter3d', mode: 'lines', x: c.x, y: c.y, z: c.z, scene: c.scene, name: c.name,
  legendgroup: c.name, showlegend: c.legend, hoverinfo: 'skip', opacity: c.opacity,
  line: {color: c.color, width: c.width},
}));
const nozzles = PAGE.nozzles.map(n => ({
  type: 'scatter3d', mode: 'markers', x: [null], y: [null], z: [null], scene: n.scene,
  name: n.name, showlegend: false, hoverinfo: 'name', marker: {color: n.color, size: 6,
  symbol: 'diamond', line: {color: '#000', width: 1}},
}));
const scene = document.getElementById('scene');
Plotly.newPlot(scene, lines.concat(nozzles), PAGE.layout, {responsive: true, displaylogo: false});

const slider = document.getElementById('time'), label = document.getElementById('now');
const play = document.getElementById('play');
const clock = s => {
  const h = Math.floor(s / 3600), m = Math.floor(s / 60) % 60;
  return `${h}:${String(m).padStart(2, '0')}:${String(Math.floor(s) % 60).padStart(2, '0')}`;
};
const show = () => {
  const share = slider.value / slider.max, t = share * PAGE.end;
  const done = share >= 1;
  label.textContent = `${clock(t)} of ${clock(PAGE.end)}`;
  const cut = curves.map(c => done ? c.x.length : upto(c.t, t));
  const part = axis => curves.map((c, i) => c[axis].subarray(0, cut[i]));
  const ids = curves.map((_, i) => i);
  const place = {x: [], y: [], z: []};
  PAGE.nozzles.forEach(n => {
    let best = null;
    n.curves.forEach(i => {
      let k = cut[i] - 1;
      while (k > 0 && Number.isNaN(curves[i].x[k])) k -= 1;
      if (k >= 0 && !Number.isNaN(curves[i].x[k]) && (!best || curves[i].t[k] >= best.t))
        best = {t: curves[i].t[k], x: curves[i].x[k], y: curves[i].y[k], z: curves[i].z[k]};
    });
    ['x', 'y', 'z'].forEach(a => place[a].push([best && !done ? best[a] : null]));
  });
  ['x', 'y', 'z'].forEach(a => { place[a] = part(a).concat(place[a]); });
  const all = ids.concat(PAGE.nozzles.map((_, i) => curves.length + i));
  return Plotly.restyle(scene, place, all);
};
label.textContent = `${clock(PAGE.end)} of ${clock(PAGE.end)}`;
slider.addEventListener('input', show);
let running = false;
const step = async () => {
  if (!running) return;
  slider.value = Math.min(Number(slider.max), Number(slider.value) + 5);
  await show();
  if (Number(slider.value) >= Number(slider.max)) stop();
  else setTimeout(step, 40);
};
const stop = () => { running = false; play.textContent = 'Play'; };
play.addEventListener('click', () => {
  if (running) return stop();
  if (Number(slider.value) >= Number(slider.max)) slider.value = 0;
  running = true;
  play.textContent = 'Stop';
  step();
});
"""
