// Frame after frame, until the picture has settled.
// On a slow machine the picture has fewer pixels, so that it follows the hand; on a fast one, a frame more passes.
const SLOW = 250, FAST = 20, STEADY = 50, COARSEST = 0.25, MOST_PASSES = 8;  // milliseconds, share of the pixels' sides
let passesOf = '', mostPasses = MOST_PASSES;
function adapt() {
  const before = [finer, viewer.passes], now = [viewer.level, state.shape, canvas.width, canvas.height].join();
  if (passesOf !== now) { passesOf = now; mostPasses = MOST_PASSES; }
  if (mean > SLOW) slow = true;
  if (viewer.frames === 3 && slow && !still) finer = Math.max(COARSEST, finer / 2);
  if (viewer.frames === 3 && mean <= FAST) finer = Math.min(1, finer * 2);
  if (viewer.frames > 24 && !fingers.size && !spin) { finer = 1; still = true; }
  // What was too slow once is not tried again.
  const least = viewer.level || slow ? 1 : 2;  // at `far` a pass is cheap
  if (mean > STEADY && viewer.passes > least) viewer.passes = mostPasses = viewer.passes / 2;
  else if (mean && mean <= FAST && finer === 1 && viewer.frames % 8 === 7) viewer.passes = Math.min(mostPasses, 2 * viewer.passes);
  viewer.passes = Math.max(viewer.passes, least);
  if (finer !== before[0] || viewer.passes !== before[1]) mean = last = 0;
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
  if (!showOnly) viewer.draw(placed(), lights());
  showPicture();
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
  watchFrame(now);
  by('status').textContent = `${LEVELS[viewer.level]} · frame ${viewer.frames} of ${MOST_FRAMES}, ${viewer.samples} samples · ${mean.toFixed(0)} ms a frame`;
  showScale();
}

by('undo').onclick = () => step(past, future);
by('redo').onclick = () => step(future, past);
by('reset').onclick = () => { change(s => Object.assign(s, copy(first), unedited(s.cloth, 'front'))); frameShape(); };
by('spin').onchange = e => { spin = e.target.checked; };
makeInputs();
makeWeave();
makeCompare();
makeFiles();
viewer.ground = data.ground;
if (location.hash.length > 1) state = restored(location.hash.slice(1));
fit();
apply();
requestAnimationFrame(frame);
window.fabricusd = {
  viewer, decode, sobol, placed, lights, showScale, whole: () => wholeOf(state), get traced() { return traced; }, get data() { return data; }, get cloth() { return cloth; },
  get state() { return state; }, get camera() { return camera; },
};
