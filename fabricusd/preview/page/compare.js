// The path tracer's picture of the same view: a wipe, where the two differ, and what each took.
const MOST_TRACED = 1024;
let traced = null;  // { of, level, samples, seconds, found } of the picture that was traced last
let mode = 'page', tracing = false, begun = 0, took = 0;

// What the picture depends on; exposure and view are laid over both.
function viewKey() {
  const { grain, azimuth, elevation, key, sky, shape } = state, { clientWidth, clientHeight } = canvas;
  return JSON.stringify([wholeOf(state), shape, grain, azimuth, elevation, key, sky, state.level, camera, clientWidth, clientHeight]);
}

const comparing = () => mode !== 'page' && traced !== null && traced.of === viewKey();

function lights() {
  return { key_power: state.key, even: state.sky, slope: state.sky * data.light.slope / Math.max(data.light.even, 1e-9) };
}

async function trace() {
  if (tracing) return;
  tracing = true;
  by('trace').disabled = true;
  busy('path tracing');
  const of = viewKey(), { eye, right, up } = placed(), { key_power: key, even, slope } = lights();
  const { side, shape, grain, azimuth, elevation } = state;
  const { clientWidth, clientHeight } = canvas;
  const size = Math.max(16, Math.min(MOST_TRACED, clientWidth, clientHeight));
  try {
    takeTraced(await ask('/render', {
      ...changes(), side, shape, grain, azimuth, elevation, key, even, slope, eye, right, up,
      focal: data.focal, size, samples: Math.round(+by('samples').value) || 64, level: LEVELS[levelFor(metresPerPixel() * Math.min(canvas.width, canvas.height) / size)],
    }), of);
    trouble('');
  } catch (error) {
    trouble(error.message);
  } finally {
    tracing = false;
    by('trace').disabled = false;
    busy('');
  }
}

function takeTraced(found, of) {
  viewer.setTraced(decode(found.pixels), found.size);
  traced = { of, level: LEVELS.indexOf(found.level), samples: found.samples, seconds: found.seconds, size: found.size, found: null };
  for (const option of by('compare').options) option.disabled = false;
  if (mode === 'page') by('compare').value = mode = 'wipe';
  viewer.frames = 0;
  showCompared();
}

// The file's own picture is of the view that the page began with.
function showHeld() {
  change(s => {
    for (const name of ['shape', 'grain', 'azimuth', 'elevation', 'key', 'sky', 'side', 'threads', ...Object.keys(OWN)]) s[name] = copy(first[name]);
    s.level = data.reference.level;
  });
  frameShape();
  takeTraced(data.reference, viewKey());
}

function showCompared() {
  const on = comparing();
  by('wipe').hidden = !(on && mode === 'wipe');
  by('legend').hidden = !(on && mode === 'heat');
  by('compared').textContent = !traced ? '' : !on ? (mode === 'page' ? '' : 'The view has changed since it was traced.') : said();
}

function said() {
  const { found, samples, seconds } = traced;
  const differ = found ? `ΔE2000 ${found.whole.toFixed(2)} over the square, ${found.covered.toFixed(2)} on the cloth. ` : '';
  return `${differ}Page: ${viewer.frames} frames in ${(took / 1000).toFixed(1)} s. Path tracer: ${samples} samples in ${seconds.toFixed(1)} s.`;
}

function measure() {
  const pixels = viewer.differences();
  let whole = 0, covered = 0, count = 0;
  for (let k = 0; k < pixels.length; k += 4) {
    whole += pixels[k];
    if (pixels[k + 1] > 0.99) { covered += pixels[k]; ++count; }
  }
  traced.found = { whole: whole / (pixels.length / 4), covered: count ? covered / count : 0, frames: viewer.frames };
}

// Called with each frame: how long this picture took, and how far it is from the other.
function watchFrame(now) {
  if (viewer.frames <= 1) begun = now;
  if (viewer.frames < MOST_FRAMES) took = now - begun;
  const n = viewer.frames, fine = Math.min(canvas.width, canvas.height) >= (traced?.size ?? 0);
  if (comparing() && fine && n !== traced.found?.frames && (n === MOST_FRAMES || (n & (n - 1)) === 0)) measure();
  showCompared();
}

function showPicture() {
  if (comparing()) viewer.compare(mode === 'heat' ? 1 : 0, +by('wipe').value);
  else viewer.show();
}

function makeCompare() {
  by('trace').onclick = served ? trace : showHeld;
  by('trace').disabled = !served && !data.reference;
  if (!served) by('trace').textContent = 'Show the reference';
  by('samplesRow').hidden = !served;
  by('compareWhy').textContent = served || data.reference ? '' : `The path tracer ${NEEDS_SERVER}, or a page made with --reference.`;
  by('compare').onchange = () => { mode = by('compare').value; viewer.frames = 0; showCompared(); };
  by('wipe').oninput = () => showPicture();
}
