(() => {
'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const map = document.getElementById('map'), chart = document.getElementById('chart');
const pick = document.getElementById('pick'), read = document.getElementById('read');
const dot = document.getElementById('dot'), ns = map.namespaceURI;
const byId = new Map(data.tracks.map(one => [one.id, one]));
const rows = document.querySelectorAll('tr[data-id]');
const colour = k => 'var(--s' + (k % 6) + ')';
let current = null, drawn = null, cursor = null;

const el = (parent, name, attributes, text) => {
  const node = document.createElementNS(ns, name);
  for (const key in attributes) node.setAttribute(key, attributes[key]);
  if (text !== undefined) node.textContent = text;
  parent.appendChild(node);
  return node;
};
const seconds = ms => ((ms + data.start_ms) / 1000).toFixed(2) + ' s';
const number = v => v === null || v === undefined ? '–' : Math.abs(v) >= 100 ? v.toFixed(0)
  : Math.abs(v) >= 10 ? v.toFixed(1) : v.toFixed(2);

/* Index of the last entry of an ascending array that is not above v, or -1. */
const last = (array, v) => {
  let low = 0, high = array.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (array[middle] <= v) low = middle + 1; else high = middle;
  }
  return low - 1;
};
const at = (curve, t, column) => {
  const k = last(curve.t, t);
  return k < 0 ? null : curve[column || 'v'][k];
};

const ticks = (low, high, wanted) => {
  const span = high - low || 1, raw = span / wanted, power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 5, 10].map(f => f * power).find(s => s >= raw * .999);
  const out = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * span; v += step) {
    out.push(Math.abs(v) < step * 1e-6 ? 0 : v);
  }
  return out;
};
const label = v => String(+v.toPrecision(6));

/* Bounds of values that leave the widest hundredth out, so that one wild start does not flatten the rest. */
const range = (lists, zero) => {
  const all = [].concat(...lists).filter(v => v !== null).sort((a, b) => a - b);
  if (!all.length) return [0, 1];
  const cut = Math.floor(all.length * .01);
  let low = all[cut], high = all[all.length - 1 - cut];
  if (zero) { low = Math.min(low, 0); high = Math.max(high, 0); }
  const pad = .08 * (high - low) || Math.max(.1, .05 * Math.abs(high));
  return [low - pad, high + pad];
};

/* The strip that says which sensor gave a detection when. */
const strip = track => ({
  title: 'Which sensor gave a detection',
  height: 16 * data.sensors.length,
  rows: data.sensors,
  draw: (g, x, top) => data.sensors.forEach((name, k) => {
    let d = '';
    for (const bin of track.used[k]) {
      const left = x(track.from + bin * track.bin);
      const wide = Math.max(1, x(track.from + (bin + 1) * track.bin) - left).toFixed(1);
      d += 'M' + left.toFixed(1) + ' ' + (top + 16 * k + 2) + 'h' + wide + 'v12h-' + wide + 'z';
    }
    el(g, 'path', {d, fill: colour(k)});
  }),
  read: t => {
    const bin = (t - track.from) / track.bin;
    const seen = data.sensors.filter((_, k) => track.used[k].some(u => u <= bin && bin < u + 1));
    return 'seen by ' + (seen.join(', ') || 'none');
  },
});

const NIS_TITLE = 'NIS of each update (log), dashed: 95 % of χ² with 2 degrees of freedom';
const FILTER = 'var(--now)', LATE = 'var(--late)';
const twice = (list, sign) => list.map(v => v === null ? null : 2 * sign * v);

/* What is shown of a track: one entry a panel. */
const panels = track => {
  const out = [], motion = track.motion, names = data.sensors;
  if (names.length) out.push(strip(track));
  const add = (title, curves, options) => out.push(Object.assign({title, height: 96, curves}, options));
  const existence = {c: track.existence, colour: 'var(--ink)', step: true, name: 'existence'};
  add('Existence probability', [existence], {y: [0, 1.02]});
  if (track.scale) {
    const curves = track.scale.map((c, k) =>
      ({c, colour: colour(k), step: true, name: 's ' + names[k], dash: k % 2 ? '6 3' : ''}));
    const y = range(curves.map(one => one.c.v).concat([[1]]));
    add('Noise scale s, by sensor', curves, {y, bounds: [1]});
  }
  if (track.nis) {
    const curves = track.nis.map((c, k) => ({c, colour: colour(k), points: k, name: 'NIS ' + names[k]}));
    add(NIS_TITLE, curves, {y: [.01, 100], log: true, bounds: data.nis_bounds, height: 130});
  }
  for (const axis of ['x', 'y']) {
    const v = motion['d' + axis], s = motion['s' + axis];
    if (!v) continue;
    const one = {c: {t: motion.t, v, s}, colour: FILTER, band: true, around: 0, name: 'Δ' + axis};
    const title = 'Filter minus smoothed, ' + axis + ' (px), with the filter’s 2σ';
    add(title, [one], {y: range([v, twice(s, 1), twice(s, -1)], true), bounds: [0]});
  }
  for (const axis of ['x', 'y']) {
    const curve = (mean, std, tint, kind) => ({
      c: {t: motion.t, v: motion[mean + axis], s: motion[std + axis]},
      colour: tint, band: true, name: 'v' + axis + ' ' + kind,
    });
    const curves = [curve('v', 'sv', FILTER, 'filter')];
    if (motion['w' + axis]) curves.push(curve('w', 'sw', LATE, 'smoothed'));
    add('Velocity ' + axis + ' (px/s) ± 2σ', curves, {y: range(curves.map(one => one.c.v))});
  }
  return out;
};

/* A mark of its own for each sensor, for those who do not tell colours apart. */
const shape = (k, x, y) => [
  'M' + (x - 2) + ' ' + y + 'a2 2 0 1 0 4 0a2 2 0 1 0 -4 0',
  'M' + (x - 2) + ' ' + (y + 2) + 'l2 -4l2 4z',
  'M' + (x - 1.7) + ' ' + (y - 1.7) + 'h3.4v3.4h-3.4z',
][k % 3];

const drawLines = (g, panel, x, top) => {
  const [low, high] = panel.y, scale = panel.log ? Math.log10 : v => v;
  const a = scale(low), b = scale(high);
  const y = v => top + panel.height * (1 - (scale(Math.min(Math.max(v, low), high)) - a) / (b - a));
  const marks = panel.log ? [.01, .1, 1, 10, 100] : ticks(low, high, 4);
  const [left, right] = x.range;
  for (const v of marks) {
    el(g, 'line', {class: 'grid', x1: left, x2: right, y1: y(v), y2: y(v)});
    el(g, 'text', {x: left - 6, y: y(v) + 4, 'text-anchor': 'end'}, label(v));
  }
  for (const v of panel.bounds || []) {
    if (v >= low && v <= high) el(g, 'line', {class: 'bound', x1: left, x2: right, y1: y(v), y2: y(v)});
  }
  for (const one of panel.curves) {
    const {t, v, s} = one.c;
    if (one.band) {
      let up = '', down = '';
      t.forEach((time, k) => {
        const middle = one.around === undefined ? v[k] : one.around;
        if (middle === null || s[k] === null) return;
        up += (up ? 'L' : 'M') + x(time).toFixed(1) + ' ' + y(middle + 2 * s[k]).toFixed(1);
        down = 'L' + x(time).toFixed(1) + ' ' + y(middle - 2 * s[k]).toFixed(1) + down;
      });
      if (up) el(g, 'path', {class: 'fill', d: up + down + 'z', fill: one.colour});
    }
    let d = '', before = null;
    t.forEach((time, k) => {
      if (v[k] === null) { before = null; return; }
      const px = +x(time).toFixed(1), py = +y(v[k]).toFixed(1);
      if (one.points !== undefined) d += shape(one.points, px, py);
      else if (before === null) d += 'M' + px + ' ' + py;
      else d += one.step ? 'H' + px + 'V' + py : 'L' + px + ' ' + py;
      before = v[k];
    });
    if (one.points !== undefined) el(g, 'path', {d, fill: one.colour, opacity: .8});
    else el(g, 'path', {class: 'curve', d, stroke: one.colour, 'stroke-dasharray': one.dash || 'none'});
  }
};

const draw = track => {
  const width = Math.max(280, chart.clientWidth), left = 52, right = width - 10;
  const span = Math.max(1, track.to - track.from);
  const x = t => left + (right - left) * (t - track.from) / span;
  x.range = [left, right];
  const list = panels(track);
  let top = 0;
  const old = chart.firstChild;
  const svg = document.createElementNS(ns, 'svg');
  svg.setAttribute('role', 'img');
  svg.setAttribute('tabindex', '0');
  svg.setAttribute('aria-label', 'Curves of track ' + track.id + ' from ' + seconds(track.from) + ' to ' +
    seconds(track.to) + ': ' + list.map(one => one.title).join('; ') +
    '. Arrow keys move the moment that is read below.');
  for (const panel of list) {
    top += 26;
    const g = el(svg, 'g', {});
    const title = width < 500 ? panel.title.replace(/,? (dashed|with the).*$/, '') : panel.title;
    el(g, 'text', {class: 'title', x: 4, y: top - 7}, title);
    if (panel.rows) {
      panel.rows.forEach((name, k) => {
        const text = name.length > 7 ? name.slice(0, 6) + '…' : name;
        el(g, 'text', {x: left - 6, y: top + 16 * k + 12, 'text-anchor': 'end'}, text);
      });
      panel.draw(g, x, top);
    } else drawLines(g, panel, x, top);
    top += panel.height + 8;
  }
  const [begin, end] = [track.from, track.to].map(ms => (ms + data.start_ms) / 1000);
  for (const v of ticks(begin, end, width < 500 ? 4 : 9)) {
    const px = x(v * 1000 - data.start_ms);
    el(svg, 'line', {class: 'grid', x1: px, x2: px, y1: top, y2: top + 5});
    el(svg, 'text', {x: px, y: top + 18, 'text-anchor': 'middle'}, label(v));
  }
  el(svg, 'text', {x: right, y: top + 34, 'text-anchor': 'end'}, 'time (s)');
  const line = el(svg, 'line', {class: 'cursor', x1: 0, x2: 0, y1: 0, y2: top, visibility: 'hidden'});
  top += 40;
  svg.setAttribute('viewBox', '0 0 ' + width + ' ' + top);
  if (old) chart.replaceChild(svg, old); else chart.appendChild(svg);
  drawn = {track, list, x, line, svg, width};
  const point = event => {
    read.setAttribute('aria-live', 'off');  // a voice could not keep up with a pointer
    const box = svg.getBoundingClientRect();
    const px = (event.clientX - box.left) * width / box.width;
    moveTo(track.from + span * (px - left) / (right - left));
  };
  svg.addEventListener('pointermove', point);
  svg.addEventListener('pointerdown', point);
  svg.addEventListener('keydown', event => {
    const step = {ArrowLeft: -1, ArrowRight: 1, Home: -1e9, End: 1e9}[event.key];
    if (step === undefined) return;
    event.preventDefault();
    read.setAttribute('aria-live', 'polite');
    moveTo((cursor === null ? track.from : cursor) + step * span / 100);
  });
};

const moveTo = time => {
  const {track, list, x, line} = drawn;
  cursor = Math.min(Math.max(time, track.from), track.to);
  line.setAttribute('x1', x(cursor));
  line.setAttribute('x2', x(cursor));
  line.setAttribute('visibility', 'visible');
  read.textContent = '';
  const say = text => {
    const span = document.createElement('span');
    span.textContent = text;
    read.appendChild(span);
  };
  say('t = ' + seconds(cursor));
  for (const panel of list) {
    if (panel.read) say(panel.read(cursor));
    else for (const one of panel.curves) {
      const sigma = one.band && one.around === undefined ? ' ± ' + number(2 * at(one.c, cursor, 's')) : '';
      say(one.name + ' ' + number(at(one.c, cursor)) + sigma);
    }
  }
  const k = last(track.motion.t, cursor);
  dot.setAttribute('r', k < 0 ? 0 : data.width / 220);
  if (k >= 0) { dot.setAttribute('cx', track.motion.x[k]); dot.setAttribute('cy', track.motion.y[k]); }
};

const choose = (id, jump) => {
  const track = byId.get(id);
  current = id;
  cursor = null;
  for (const g of map.querySelectorAll('.track')) g.classList.toggle('on', +g.dataset.id === id);
  map.classList.add('some');
  for (const row of rows) row.classList.toggle('on', +row.dataset.id === id);
  dot.setAttribute('r', 0);
  read.textContent = track ? 'Move over the curves, or use the arrow keys, to read values.'
    : 'This track has no curves on this page: it is one of the short ones beyond the limit.';
  if (track) { pick.value = String(id); draw(track); } else chart.textContent = '';
  if (jump) document.getElementById('timelines').scrollIntoView({block: 'start'});
};

pick.addEventListener('change', () => choose(+pick.value));
const step = by => {
  const k = data.tracks.findIndex(one => one.id === current);
  choose(data.tracks[(k + by + data.tracks.length) % data.tracks.length].id);
};
document.getElementById('before').addEventListener('click', () => step(-1));
document.getElementById('after').addEventListener('click', () => step(1));
document.getElementById('all').addEventListener('click', () => {
  map.classList.remove('some');
  dot.setAttribute('r', 0);
});
map.addEventListener('click', event => {
  const g = event.target.closest('.track');
  if (g) choose(+g.dataset.id);
});
for (const row of rows) {
  row.querySelector('button').addEventListener('click', () => choose(+row.dataset.id, true));
}
let waiting = null;
addEventListener('resize', () => {
  clearTimeout(waiting);
  waiting = setTimeout(() => { if (drawn && chart.clientWidth !== drawn.width) draw(drawn.track); }, 100);
});
const wanted = +new URLSearchParams(location.hash.slice(1)).get('track');
choose(byId.has(wanted) ? wanted : data.first);
map.classList.toggle('some', byId.has(wanted));
if (byId.has(wanted)) moveTo((byId.get(wanted).from + byId.get(wanted).to) / 2);
})();
