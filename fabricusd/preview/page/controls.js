// The page's controls: one state, which the URL keeps, and which can be undone.
const data = JSON.parse(document.getElementById('data').textContent);
const by = id => document.getElementById(id), RADIAN = Math.PI / 180, MOST_FRAMES = 256;
const viewer = start();

function start() {
  try {
    const made = new Viewer(by('view'), data.shaders);
    made.setFabric(data.fabric);
    return made;
  } catch (error) {
    by('trouble').textContent = `The picture cannot be drawn: ${error.message}`;
    by('trouble').hidden = false;
    throw error;
  }
}

const shapes = Object.keys(data.meshes);
const first = {
  shape: shapes[0], level: data.level, tone: 0, exposure: 0, grain: 0,
  azimuth: data.light.azimuth, elevation: data.light.elevation, key: data.light.key_power,
  sky: data.light.even, threads: data.threads.map(t => t.values),
};
const copy = value => JSON.parse(JSON.stringify(value));
let last = 0, mean = 0, state = copy(first), past = [], future = [], camera = null, spin = false;

// What a URL says is taken only where it is of the kind that the page has there.
function restored(text) {
  try {
    const said = JSON.parse(decodeURIComponent(text));
    const fits = (a, b) => Array.isArray(b) ? Array.isArray(a) && a.length === b.length && b.every((x, k) => fits(a[k], x))
      : typeof a === typeof b && (typeof b !== 'number' || Number.isFinite(a));
    const found = copy(first);
    for (const name of Object.keys(first)) if (fits(said[name], first[name])) found[name] = said[name];
    if (!shapes.includes(found.shape)) found.shape = first.shape;
    return found;
  } catch { return copy(first); }
}

// On a slow machine the picture has fewer pixels, so that it follows the hand.
const SLOW = 250, FAST = 17, COARSEST = 0.25;  // milliseconds, milliseconds, share of the pixels' sides
let finer = 0.5, slow = false, still = false;

const controls = [];  // each { show() } brings an input up to the state

function change(edit, { again = true, key = '' } = {}) {
  const before = copy(state);
  edit(state);
  if (JSON.stringify(before) === JSON.stringify(state)) return;
  // Steps of one drag of one slider are one step back.
  const last = past[past.length - 1];
  if (!(key && last && last.key === key && performance.now() - last.time < 800)) past.push({ state: before, key, time: 0 });
  past[past.length - 1].time = performance.now();
  future = [];
  if (again) apply();
}

function step(from, to) {
  if (!from.length) return;
  to.push({ state: copy(state), key: '', time: 0 });
  state = from.pop().state;
  apply();
}

function apply() {
  if (viewer.shown !== state.shape) {
    viewer.shown = state.shape;
    viewer.setMesh(data.meshes[state.shape]);
    frameShape();
  }
  const light = { azimuth: state.azimuth * RADIAN, elevation: state.elevation * RADIAN };
  if (light.azimuth !== viewer.light.azimuth || light.elevation !== viewer.light.elevation) viewer.keyIsDrawn = false;
  viewer.light = light;
  viewer.lay = [Math.cos(state.grain * RADIAN), Math.sin(state.grain * RADIAN)];
  viewer.exposure = state.exposure;
  viewer.view = state.tone;
  state.threads.forEach((values, k) => writeThread(k, values));
  for (const control of controls) control.show();
  moved();
  by('undo').disabled = !past.length;
  by('redo').disabled = !future.length;
  keep();
}

let keeping = 0;
function keep() {
  clearTimeout(keeping);
  keeping = setTimeout(() => history.replaceState(null, '', `#${encodeURIComponent(JSON.stringify(state))}`), 300);
}

// The numbers of a thread's row that depend on its parameters, as `scattering.table` has them.
function writeThread(k, values) {
  const { columns, start, width, names } = data.rows, said = {};
  names.forEach((name, n) => { said[name] = values[n]; });
  const put = (column, numbers) => viewer.writeFloats(start + k * width + columns[column], numbers);
  const lobe = degrees => { const s = degrees * RADIAN; return [0.5 / (s * s), 1 / (s * Math.sqrt(2 * Math.PI))]; };
  put('albedo', [said.red, said.green, said.blue]);
  put('ior', [(said.ior - 1) * (said.ior + 1)]);
  put('isotropic', [said.isotropic]);
  put('gamma', [said.surface * RADIAN, said.volume * RADIAN]);
  put('lobes', [...lobe(said.surface), ...lobe(said.volume)]);
}

// A slider and a field for the same number.
function number(parent, { label, low, high, step, unit = '', get, set }) {
  const row = document.createElement('div'), name = document.createElement('span');
  const [slide, type] = ['range', 'number'].map(kind => {
    const input = document.createElement('input');
    Object.assign(input, { type: kind, min: low, max: high, step: kind === 'range' ? step : 'any' });
    input.setAttribute('aria-label', unit ? `${label}, ${unit}` : label);
    return input;
  });
  row.className = 'row';
  name.textContent = unit ? `${label} (${unit})` : label;
  row.append(name, slide, type);
  by(parent).append(row);
  const put = (text, key) => {
    const value = Number(text);
    if (text === '' || !Number.isFinite(value)) { show(); return; }
    change(s => set(s, Math.min(high, Math.max(low, value))), { key });
  };
  slide.oninput = () => put(slide.value, `${parent} ${label}`);
  type.onchange = () => put(type.value, '');
  const show = () => { slide.value = get(state); type.value = +get(state).toPrecision(4); };
  controls.push({ show });
}

function choice(id, get, set) {
  by(id).onchange = () => change(s => set(s, by(id).value));
  controls.push({ show() { by(id).value = get(state); } });
}

for (const name of shapes) by('shape').append(new Option(name));
choice('shape', s => s.shape, (s, v) => { s.shape = v; });
choice('level', s => s.level, (s, v) => { s.level = v; });
choice('tone', s => s.tone, (s, v) => { s.tone = +v; });
const plain = (name, rest) => ({ get: s => s[name], set: (s, v) => { s[name] = v; }, ...rest });
number('grain', plain('grain', { label: 'Grain', low: -180, high: 180, step: 1, unit: '°' }));
number('light', plain('azimuth', { label: 'Azimuth', low: -180, high: 180, step: 1, unit: '°' }));
number('light', plain('elevation', { label: 'Elevation', low: -90, high: 90, step: 1, unit: '°' }));
number('light', plain('key', { label: 'Key', low: 0, high: 10, step: 0.05, unit: 'W/m²' }));
number('light', plain('sky', { label: 'Sky', low: 0, high: 2, step: 0.01, unit: 'W/m²/sr' }));
number('display', plain('exposure', { label: 'Exposure', low: -6, high: 6, step: 0.1, unit: 'EV' }));
data.threads.forEach((thread, k) => {
  const box = document.createElement('fieldset'), legend = document.createElement('legend');
  box.id = `thread${k}`;
  legend.textContent = `Thread ${thread.name}`;
  box.append(legend);
  by('threads').append(box);
  thread.controls.forEach((control, n) => number(box.id, {
    ...control, get: s => s.threads[k][n], set: (s, v) => { s.threads[k][n] = v; },
  }));
});

by('undo').onclick = () => step(past, future);
by('redo').onclick = () => step(future, past);
by('reset').onclick = () => { change(s => Object.assign(s, copy(first))); frameShape(); };
by('spin').onchange = e => { spin = e.target.checked; };
by('save').onclick = () => {
  draw(true);
  by('view').toBlob(blob => {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = `${data.name}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
};
by('panel').onsubmit = e => e.preventDefault();
addEventListener('keydown', e => {
  if (!(e.ctrlKey || e.metaKey) || e.target.matches('input[type=number]')) return;
  if (e.key.toLowerCase() === 'z') { e.preventDefault(); if (e.shiftKey) step(future, past); else step(past, future); }
});

// The camera goes around `target`, as that of the preview's pictures stands.
function frameShape() {
  const { towards, distance, centre } = viewer.mesh, t = unit(towards);
  camera = { yaw: Math.atan2(t[0], t[2]), pitch: Math.asin(t[1]), distance, target: [...centre] };
  viewer.frames = 0;
}

function placed() {
  const { yaw, pitch, distance, target } = camera, c = Math.cos, s = Math.sin, { width, height } = viewer.canvas;
  const back = [s(yaw) * c(pitch), s(pitch), c(yaw) * c(pitch)], right = [c(yaw), 0, -s(yaw)], up = cross(back, right);
  const eye = target.map((x, k) => x + distance * back[k]), f = data.focal * Math.min(width, height);
  const near = Math.max(distance * 0.02, distance - 3 * viewer.mesh.radius), far = distance + 4 * viewer.mesh.radius;
  const a = (far + near) / (near - far), b = 2 * far * near / (near - far);
  const row = [[f / width, right], [f / height, up], [a, back], [-1, back]];
  const matrix = [0, 1, 2].flatMap(k => row.map(([scale, v]) => scale * v[k]));
  matrix.push(...row.map(([scale, v], k) => -scale * dot(v, eye) + (k === 2 ? b : 0)));
  return { eye, matrix, right, up };
}

const metresPerPixel = () => 2 * camera.distance / (data.focal * Math.min(viewer.canvas.width, viewer.canvas.height));

function levelNow() {
  if (state.level !== 'auto') return state.level === 'far' ? 0 : 1;
  const size = metresPerPixel(), [u, v] = data.fabric.density, [ends, picks] = data.fabric.repeat;
  return size * u > 0.4 * ends && size * v > 0.4 * picks ? 0 : 1;
}

function moved() {  // coarse again, if finer pictures were slow
  viewer.frames = 0;
  still = false;
  if (slow) finer = COARSEST;
}

function turn(dx, dy) { camera.yaw -= dx; camera.pitch = Math.max(-1.55, Math.min(1.55, camera.pitch + dy)); moved(); }
function move(dx, dy) {  // in canvas pixels
  const { right, up } = placed(), size = metresPerPixel();
  camera.target = camera.target.map((x, k) => x - size * dx * right[k] + size * dy * up[k]);
  moved();
}
function moveLight(dx, dy) {
  const wrap = x => (x + 540) % 360 - 180;
  change(s => { s.azimuth = wrap(s.azimuth + dx); s.elevation = Math.max(-90, Math.min(90, s.elevation + dy)); }, { key: 'light' });
}
function zoom(factor) {
  const r = viewer.mesh.radius;
  camera.distance = Math.max(r * 0.02, Math.min(r * 30, camera.distance * factor));
  moved();
}

const fingers = new Map(), canvas = by('view');
canvas.onpointerdown = e => { fingers.set(e.pointerId, e); canvas.setPointerCapture(e.pointerId); };
canvas.onpointerup = canvas.onpointercancel = e => fingers.delete(e.pointerId);
canvas.onpointermove = e => {
  const before = fingers.get(e.pointerId);
  if (!before) return;
  const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
  const apart = fingers.size === 2 ? spread() : 0;
  const dx = e.clientX - before.clientX, dy = e.clientY - before.clientY, ratio = canvas.width / canvas.clientWidth;
  fingers.set(e.pointerId, e);
  const mode = document.querySelector('input[name=drag]:checked').value;
  if (fingers.size === 2) { zoom(apart / Math.max(spread(), 1)); move(dx * ratio / 2, dy * ratio / 2); }
  else if (e.altKey || mode === 'light') moveLight(dx * 0.4, -dy * 0.4);
  else if (e.shiftKey || e.buttons === 4 || e.buttons === 2 || mode === 'move') move(dx * ratio, dy * ratio);
  else turn(dx * 0.01, dy * 0.01);
};
canvas.oncontextmenu = e => e.preventDefault();
canvas.addEventListener('wheel', e => { e.preventDefault(); zoom(Math.exp(0.001 * e.deltaY)); }, { passive: false });
canvas.onkeydown = e => {
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
  if (arrow) {
    if (e.altKey) moveLight(5 * arrow[0], -5 * arrow[1]);
    else if (e.shiftKey) move(20 * arrow[0], 20 * arrow[1]);
    else turn(0.08 * arrow[0], 0.08 * arrow[1]);
  } else if (e.key === '+' || e.key === '=') zoom(0.85);
  else if (e.key === '-') zoom(1 / 0.85);
  else if (e.key === '0') frameShape();
  else return;
  e.preventDefault();
};

function adapt() {
  const before = finer;
  if (mean > SLOW) slow = true;
  if (viewer.frames === 3 && slow && !still) finer = Math.max(COARSEST, finer / 2);
  if (viewer.frames === 3 && mean <= FAST) finer = Math.min(1, finer * 2);
  if (viewer.frames > 24 && !fingers.size && !spin) { finer = 1; still = true; }
  if (finer !== before) mean = last = 0;
}

function fit() {
  const ratio = finer * Math.min(devicePixelRatio || 1, 2), { clientWidth: w, clientHeight: h } = by('stage');
  const width = Math.max(1, Math.round(w * ratio)), height = Math.max(1, Math.round(h * ratio));
  if (canvas.width !== width || canvas.height !== height) viewer.resize(width, height);
}

function showScale() {
  const size = metresPerPixel() * canvas.width / canvas.clientWidth * 1000;  // mm per CSS pixel
  const power = 10 ** Math.floor(Math.log10(90 * size)), nice = [5, 2, 1].find(k => k * power <= 120 * size) * power;
  by('scale').querySelector('i').style.width = `${nice / size}px`;
  by('scale').querySelector('span').textContent = nice >= 1 ? `${+nice.toFixed(0)} mm` : `${+(nice * 1000).toPrecision(3)} µm`;
}

function draw(showOnly = false) {
  viewer.level = levelNow();
  const slope = state.sky * data.light.slope / Math.max(data.light.even, 1e-9);
  if (!showOnly) viewer.draw(placed(), { key_power: state.key, even: state.sky, slope });
  viewer.show();
}

let before = 0;
function frame(now) {
  requestAnimationFrame(frame);
  if (spin) turn(-0.0006 * Math.min(now - before, 100), 0);
  before = now;
  fit();
  if (viewer.frames >= MOST_FRAMES) { last = 0; return; }
  draw();
  // What a frame takes shows in when the browser asks for the next one.
  if (last) mean = mean ? 0.9 * mean + 0.1 * (now - last) : now - last;
  last = now;
  adapt();
  const detail = viewer.level ? 'weave' : 'far';
  by('status').textContent = `${detail} · ${viewer.frames} of ${MOST_FRAMES} samples · ${mean.toFixed(0)} ms a frame`;
  showScale();
}

if (location.hash.length > 1) state = restored(location.hash.slice(1));
fit();
apply();
requestAnimationFrame(frame);
window.fabricusd = { viewer, data, decode, placed, showScale, get state() { return state; }, get camera() { return camera; } };
