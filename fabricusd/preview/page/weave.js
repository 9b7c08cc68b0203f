// The weave as a grid to draw on, and how much each set covers.
const MOST_ENDS = 64;
let cursor = [0, 0], painting = null;
const grid = by('grid');

function isWeave(text) {
  const rows = text.split('/');
  return text === '' || rows.every(row => /^[01]+$/.test(row) && row.length === rows[0].length && row.length <= 512);
}

// Rows of 0 and 1, the first pick first; none where the weave is too large to draw.
function rowsNow() {
  const text = state.weave || data.sides.front.weave;
  return text ? text.split('/') : [];
}

function put(rows, key = '') {
  const text = rows.join('/');
  change(s => { s.weave = text === data.sides.front.weave ? '' : text; }, { key });
}

function swap(i, j, to, key) {
  const rows = rowsNow();
  if (!rows[j] || i < 0 || i >= rows[j].length || rows[j][i] === to) return;
  rows[j] = rows[j].slice(0, i) + to + rows[j].slice(i + 1);
  put(rows, key);
}

function showWeave() {
  const rows = rowsNow(), ends = rows[0]?.length ?? 0, picks = rows.length, pen = grid.getContext('2d');
  by('weave').hidden = !ends;
  if (!ends) return;
  cursor = [Math.min(cursor[0], ends - 1), Math.min(cursor[1], picks - 1)];
  const size = Math.max(4, Math.min(22, Math.floor(300 / Math.max(ends, picks))));
  grid.width = ends * size + 1; grid.height = picks * size + 1;
  rows.forEach((row, j) => [...row].forEach((cell, i) => {
    pen.fillStyle = cell === '1' ? '#e0e0e0' : '#2a2a2a';
    pen.fillRect(i * size + 1, (picks - 1 - j) * size + 1, size - 1, size - 1);
  }));
  if (document.activeElement === grid) {
    pen.strokeStyle = '#8ab4ff';
    pen.lineWidth = 2;
    pen.strokeRect(cursor[0] * size + 1, (picks - 1 - cursor[1]) * size + 1, size - 1, size - 1);
  }
  const [i, j] = cursor, top = rows[j][i] === '1' ? 'warp' : 'weft';
  by('cell').textContent = `End ${i + 1} of ${ends}, pick ${j + 1} of ${picks}: ${top} on top.`;
}

function cellAt(e) {
  const rows = rowsNow(), box = grid.getBoundingClientRect();
  const i = Math.floor((e.clientX - box.left) / box.width * rows[0].length);
  return [i, rows.length - 1 - Math.floor((e.clientY - box.top) / box.height * rows.length)];
}

function resized(rows, ends, picks) {
  const wide = row => row.repeat(Math.ceil(ends / row.length)).slice(0, ends);
  return Array.from({ length: picks }, (_, j) => wide(rows[j % rows.length]));
}

function makeWeave() {
  const without = served ? '' : `The weave ${NEEDS_SERVER}`, why = `The weave and what it covers ${served ? '' : NEEDS_SERVER}.`;
  by('weaveWhy').textContent = served ? 'Light: warp on top. Click or drag to swap.' : why;
  const name = k => (k ? 'Weft covers' : 'Warp covers'), share = (s, k) => (s.coverage[k] < 0 ? cloth.coverage[k] : s.coverage[k]);
  for (const k of [0, 1]) {
    number('coverage', {
      label: name(k), low: 0, high: 1, step: 0.005, without, get: s => share(s, k),
      set: (s, v) => {
        const other = share(s, 1 - k);
        s.coverage[1 - k] = other;
        s.coverage[k] = Math.min(v, 1 - other);
      },
    });
  }
  for (const k of [0, 1]) {
    number('coverage', {
      label: k ? 'Picks' : 'Ends', unit: 'per cm', low: 0.5, high: 400, step: 0.5, without,
      get: s => (s.density[k] < 0 ? cloth.density[k] : s.density[k]), set: (s, v) => { s.density[k] = v; },
    });
  }
  for (const [label, k] of [['Ends of the repeat', 0], ['Picks of the repeat', 1]]) {
    number('repeat', {
      label, low: 1, high: MOST_ENDS, step: 1, without, get: () => (k ? rowsNow().length : rowsNow()[0]?.length ?? 0),
      set: (s, v) => {
        const rows = rowsNow(), size = [rows[0].length, rows.length];
        size[k] = Math.round(v);
        const text = resized(rows, ...size).join('/');
        s.weave = text === data.sides.front.weave ? '' : text;
      },
    });
  }
  by('ownWeave').onclick = () => change(s => { Object.assign(s, copy(OWN)); });
  grid.onfocus = grid.onblur = () => showWeave();
  if (!served) {
    by('ownWeave').disabled = true;
    grid.setAttribute('aria-disabled', 'true');
    grid.title = without;
    return;
  }
  grid.onpointerdown = e => {
    const [i, j] = cellAt(e), row = rowsNow()[j];
    if (!row) return;
    cursor = [i, j];
    painting = row[i] === '1' ? '0' : '1';
    grid.setPointerCapture(e.pointerId);
    swap(i, j, painting, 'weave');
  };
  grid.onpointermove = e => { if (painting !== null) swap(...cellAt(e), painting, 'weave'); };
  grid.onpointerup = grid.onpointercancel = () => { painting = null; };
  grid.onkeydown = e => {
    const rows = rowsNow(), move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (move) cursor = [0, 1].map(k => Math.max(0, Math.min([rows[0].length, rows.length][k] - 1, cursor[k] + move[k])));
    else if (e.key === ' ' || e.key === 'Enter') swap(...cursor, rows[cursor[1]][cursor[0]] === '1' ? '0' : '1', '');
    else return;
    e.preventDefault();
    showWeave();
  };
}
