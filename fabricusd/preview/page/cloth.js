// The cloth that is drawn: its tables, which the page changes itself or asks the server for.
let cloth = null;       // the side that is shown, as `make.side_data` has it
let written = false;    // whether its numbers were changed on the card
let threadInputs = [], shownData = null;  // the inputs of the threads, and of which cloth they are
const made = new Map(), MOST_MADE = 12;  // sides that the server made, by what they were made of

// What tables depend on; without the numbers that the page can write into them.
function wovenOf(s) {
  const { threads } = data.sides.front, { live } = data.sides[s.side];
  return JSON.stringify([s.cloth, s.side, s.weave, s.coverage, s.density,
    s.threads.map((t, k) => t.filter((_, n) => !(live && threads[k].controls[n].live)))]);
}
const wholeOf = s => JSON.stringify([s.cloth, s.side, s.weave, s.coverage, s.density, s.threads]);

// The state of a cloth as it was opened, from one side.
const unedited = (number, side) => ({ cloth: number, side, ...copy(OWN), threads: valuesOf(cloths.get(number)) });

function showCloth() {
  if (data !== cloths.get(state.cloth)) data = cloths.get(state.cloth);
  if (shownData !== data) makeThreads();
  for (const side of SIDES) {
    const plain = unedited(state.cloth, side);
    Object.assign(data.sides[side], { whole: wholeOf(plain), woven: wovenOf(plain) });
  }
  const whole = wholeOf(state), woven = wovenOf(state), base = data.sides[state.side];
  const exact = base.whole === whole ? base : made.get(whole);
  const near = exact ?? [cloth, base].find(side => side?.woven === woven && side.live);
  if (near) use(near);
  else if (!cloth || !served) use(base);
  if (!exact && near) {
    state.threads.forEach((values, k) => writeThread(k, values));
    written = true;
  }
  by('note').textContent = !near && !served ? `What was changed is not on the back: that ${NEEDS_SERVER}.` : '';
  if (!exact && served) makeLater(whole);
  showWeave();
}

function use(side) {
  if (viewer.fabric !== side.fabric || written) viewer.setFabric(side.fabric);
  written = false;
  if (cloth === side) return;
  cloth = side;
  by('about').textContent = side.about;
}

// Ask for tables once the hand rests, and for one side at a time.
let waiting = 0, asking = false;
function makeLater(whole) {
  clearTimeout(waiting);
  waiting = setTimeout(async () => {
    if (asking) { makeLater(whole); return; }
    if (whole !== wholeOf(state)) return;
    asking = true;
    busy('making tables');
    const { side } = state, woven = wovenOf(state);
    try {
      const found = await ask('/fabric', { side, ...changes() });
      made.set(whole, { ...found.side, swatch: found.swatch, whole, woven });
      if (made.size > MOST_MADE) made.delete(made.keys().next().value);
      trouble('');
      if (whole === wholeOf(state)) apply();
    } catch (error) {
      trouble(error.message);
    } finally {
      asking = false;
      busy('');
    }
  }, 150);
}

// The numbers of a thread's row that depend on its parameters, as `scattering.table` has them.
function writeThread(k, values) {
  const { columns, start, width } = cloth.rows, said = {};
  data.sides.front.threads[k].controls.forEach(({ name }, n) => { said[name] = values[n]; });
  const put = (column, numbers) => viewer.writeFloats(start + k * width + columns[column], numbers);
  const lobe = degrees => { const s = degrees * RADIAN; return [0.5 / (s * s), 1 / (s * Math.sqrt(2 * Math.PI))]; };
  put('albedo', [said.red, said.green, said.blue]);
  put('ior', [(said.ior - 1) * (said.ior + 1)]);
  put('isotropic', [said.isotropic]);
  put('gamma', [said.surface * RADIAN, said.volume * RADIAN]);
  put('lobes', [...lobe(said.surface), ...lobe(said.volume)]);
}

// Where an input of a group goes: a fold of its own, closed until somebody opens it.
function folded(box, folds, group) {
  if (!group) return box;
  if (!folds.has(group)) {
    const fold = document.createElement('details'), said = document.createElement('summary');
    said.textContent = group;
    fold.id = `${box.id} ${group}`;
    fold.append(said);
    box.append(fold);
    folds.set(group, fold);
  }
  return folds.get(group);
}

// The inputs of this cloth's threads, in place of those of another.
function makeThreads() {
  for (const input of threadInputs) controls.splice(controls.indexOf(input), 1);
  threadInputs = [];
  by('threads').replaceChildren();
  shownData = data;
  by('name').textContent = document.title = data.name;
  canvas.setAttribute('aria-label', `${data.name} on a shape, lit from the side`);
  data.sides.front.threads.forEach((thread, k) => {
    const box = document.createElement('fieldset'), legend = document.createElement('legend');
    box.id = `thread${k}`;
    legend.textContent = `Thread ${thread.name}`;
    box.append(legend);
    by('threads').append(box);
    const reached = thread.controls.filter(control => served || control.live);
    const folds = new Map();
    thread.controls.forEach((control, n) => threadInputs.push(number(folded(box, folds, control.group), {
      ...control, get: s => s.threads[k][n], set: (s, v) => { s.threads[k][n] = v; },
      without: served || control.live ? '' : `${control.label} ${NEEDS_SERVER}`,
    })));
    if (reached.length < thread.controls.length) {
      const why = document.createElement('p');
      why.className = 'why';
      why.textContent = `${reached.length ? 'What is grey' : 'To change this thread'} ${NEEDS_SERVER}.`;
      box.append(why);
    }
  });
}

function showMesh() {
  const mesh = (state.shape === 'swatch' && cloth.swatch) || data.meshes[state.shape];
  if (viewer.shown === mesh) return;
  const same = viewer.mesh && viewer.shownName === state.shape && viewer.mesh.radius === mesh.radius;
  viewer.shown = mesh;
  viewer.shownName = state.shape;
  viewer.setMesh(mesh);
  if (!same) frameShape();
}

function busy(text) { by('busy').textContent = text ? `${text} …` : ''; }
