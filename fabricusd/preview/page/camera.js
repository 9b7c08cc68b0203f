// The camera, and the hands and keys that move it.
let camera = null, spin = false, finer = 0.5, slow = false, still = false, last = 0, mean = 0;
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

// The number of the level that is drawn: beside a traced picture, the level of that.
const levelNow = () => comparing() ? traced.level : levelFor(metresPerPixel());

function levelFor(size) {  // metres that a pixel shows
  if (state.level !== 'auto') return LEVELS.indexOf(state.level);
  const [u, v] = cloth.fabric.density, [ends, picks] = cloth.fabric.repeat;
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

const fingers = new Map();
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
