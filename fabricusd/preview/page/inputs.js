// Inputs for what the state holds: sliders with fields, and choices.

// A slider and a field for the same number. without : why it cannot be changed, "" where it can.
function number(parent, { label, low, high, step, unit = '', get, set, without = '' }) {
  const row = document.createElement('div'), name = document.createElement('span');
  const [slide, type] = ['range', 'number'].map(kind => {
    const input = document.createElement('input');
    Object.assign(input, { type: kind, min: low, max: high, step: kind === 'range' ? step : 'any', disabled: !!without, title: without });
    input.setAttribute('aria-label', unit ? `${label}, ${unit}` : label);
    return input;
  });
  row.className = 'row';
  name.textContent = unit ? `${label} (${unit})` : label;
  row.append(name, slide, type);
  (typeof parent === 'string' ? by(parent) : parent).append(row);
  const put = (text, key) => {
    const value = Number(text);
    if (text === '' || !Number.isFinite(value)) { show(); return; }
    change(s => set(s, Math.min(high, Math.max(low, value))), { key });
  };
  slide.oninput = () => put(slide.value, `${parent.id ?? parent} ${label}`);
  type.onchange = () => put(type.value, '');
  const show = () => { slide.value = get(state); type.value = +get(state).toPrecision(4); };
  const control = { show, row };
  controls.push(control);
  return control;
}

function choice(id, get, set) {
  by(id).onchange = () => change(s => set(s, by(id).value));
  controls.push({ show() { by(id).value = get(state); } });
}

const plain = (name, rest) => ({ get: s => s[name], set: (s, v) => { s[name] = v; }, ...rest });

function makeInputs() {
  for (const name of Object.keys(data.meshes)) by('shape').append(new Option(name));
  choice('shape', s => s.shape, (s, v) => { s.shape = v; });
  choice('level', s => s.level, (s, v) => { s.level = v; });
  choice('side', s => s.side, (s, v) => { s.side = v; });
  choice('tone', s => s.tone, (s, v) => { s.tone = +v; });
  number('grain', plain('grain', { label: 'Grain', low: -180, high: 180, step: 1, unit: '°' }));
  number('light', plain('azimuth', { label: 'Azimuth', low: -180, high: 180, step: 1, unit: '°' }));
  number('light', plain('elevation', { label: 'Elevation', low: -90, high: 90, step: 1, unit: '°' }));
  number('light', plain('key', { label: 'Key', low: 0, high: 10, step: 0.05, unit: 'W/m²' }));
  number('light', plain('sky', { label: 'Sky', low: 0, high: 2, step: 0.01, unit: 'W/m²/sr' }));
  number('display', plain('exposure', { label: 'Exposure', low: -6, high: 6, step: 0.1, unit: 'EV' }));
}

by('panel').onsubmit = e => e.preventDefault();
addEventListener('keydown', e => {
  if (!(e.ctrlKey || e.metaKey) || e.target.matches('input[type=number], input[type=text]')) return;
  if (e.key.toLowerCase() === 'z') { e.preventDefault(); if (e.shiftKey) step(future, past); else step(past, future); }
});
