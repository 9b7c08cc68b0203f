// One state of the page, which the URL keeps, and which can be undone.
const RADIAN = Math.PI / 180, MOST_FRAMES = 256, LEVELS = ['far', 'weave', 'thread'], SIDES = ['front', 'back'];
const canvas = by('view'), copy = value => JSON.parse(JSON.stringify(value));

async function given() {
  try {
    return served ? await ask('/fabric', { first: true }) : JSON.parse(by('data').textContent);
  } catch (error) {
    trouble(error.message);
    throw error;
  }
}

let data = await given();
const cloths = new Map([[0, data]]);  // what was opened, by number; the first is 0
const viewer = start();

function start() {
  try {
    return new Viewer(canvas, data.shaders);
  } catch (error) {
    trouble(`The picture cannot be drawn: ${error.message}`);
    throw error;
  }
}

// The weave, what it covers and how dense it is, as the cloth itself says.
const OWN = { weave: '', coverage: [-1, -1], density: [-1, -1] };
const valuesOf = d => d.sides.front.threads.map(t => [...t.values]);
const first = {
  shape: Object.keys(data.meshes)[0], level: data.level, tone: 0, exposure: 0, grain: 0,
  azimuth: data.light.azimuth, elevation: data.light.elevation, key: data.light.key_power, sky: data.light.even,
  side: 'front', cloth: 0, threads: valuesOf(data), ...copy(OWN),
};
let state = copy(first), past = [], future = [];
const controls = [];  // each { show() } brings an input up to the state

// What a URL says is taken only where it is of the kind that the page has there.
function restored(text) {
  try {
    const said = JSON.parse(decodeURIComponent(text)), found = copy(first);
    const fits = (a, b) => Array.isArray(b) ? Array.isArray(a) && a.length === b.length && b.every((x, k) => fits(a[k], x))
      : typeof a === typeof b && (typeof b !== 'number' || Number.isFinite(a));
    for (const name of Object.keys(first)) if (fits(said[name], first[name])) found[name] = said[name];
    if (!(found.shape in data.meshes)) found.shape = first.shape;
    if (![data.level, ...LEVELS].includes(found.level)) found.level = first.level;
    if (!SIDES.includes(found.side)) found.side = first.side;
    if (!served || !isWeave(found.weave)) found.weave = '';
    return { ...found, cloth: 0 };
  } catch { return copy(first); }
}

// What a request to the server says of the cloth.
const changes = () => ({ cloth: state.cloth, threads: state.threads, weave: state.weave, coverage: state.coverage, density: state.density });

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
  showCloth();
  showMesh();
  const light = { azimuth: state.azimuth * RADIAN, elevation: state.elevation * RADIAN };
  if (light.azimuth !== viewer.light.azimuth || light.elevation !== viewer.light.elevation) viewer.keyIsDrawn = false;
  viewer.light = light;
  viewer.lay = [Math.cos(state.grain * RADIAN), Math.sin(state.grain * RADIAN)];
  viewer.exposure = state.exposure;
  viewer.view = state.tone;
  for (const control of controls) control.show();
  moved();
  by('undo').disabled = !past.length;
  by('redo').disabled = !future.length;
  keep();
}

let keeping = 0;
function keep() {
  clearTimeout(keeping);
  // Cloth that was opened is the server's: a URL could not bring it back.
  const { cloth: number, threads, weave, coverage, density, ...rest } = state;
  const said = number ? rest : { ...rest, threads, coverage, density, ...(weave.length < 1000 ? { weave } : {}) };
  keeping = setTimeout(() => history.replaceState(null, '', `#${encodeURIComponent(JSON.stringify(said))}`), 300);
}
