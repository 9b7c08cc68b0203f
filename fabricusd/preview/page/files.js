// What is opened, and what is saved: cloth dropped on the page, its picture, a variant in a file.
const MOST_FILE = 16 << 20;

async function openFile(file) {
  if (!served) { trouble(`To open ${file.name} ${NEEDS_SERVER}.`); return; }
  if (file.size > MOST_FILE) { trouble(`${file.name} has ${file.size >> 20} MB; it must have at most ${MOST_FILE >> 20}.`); return; }
  busy(`opening ${file.name}`);
  try {
    const bytes = new Uint8Array(await file.arrayBuffer());
    let text = '';
    for (let k = 0; k < bytes.length; k += 32768) text += String.fromCharCode(...bytes.subarray(k, k + 32768));
    const found = await ask('/open', { name: file.name, data: btoa(text) });
    cloths.set(found.cloth, found);
    change(s => Object.assign(s, { cloth: found.cloth, threads: valuesOf(found), ...copy(OWN) }));
    trouble('');
    tell([`${file.name} is open.`, ...found.notes].join(' '));
  } catch (error) {
    trouble(error.message);
  } finally {
    busy('');
  }
}

async function saveVariant() {
  busy('saving');
  try {
    const found = await ask('/save', { ...changes(), variant: by('variant').value.trim() });
    trouble('');
    tell(`${found.file} has the variant ${found.variant}, which sets ${found.set.length} values.`);
  } catch (error) {
    trouble(error.message);
  } finally {
    busy('');
  }
}

function savePicture() {
  draw(true);
  canvas.toBlob(blob => {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = `${data.name}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

function makeFiles() {
  by('save').onclick = savePicture;
  by('saveVariant').onclick = saveVariant;
  const can = served && data.file;
  for (const id of ['saveVariant', 'variant']) by(id).disabled = !can;
  by('saveWhy').textContent = can ? `Into ${data.file}, which it selects.`
    : served ? "To save a variant, start with '--save FILE'." : `To save a variant ${NEEDS_SERVER}.`;
  by('open').disabled = !served;
  by('openWhy').textContent = served ? 'Or drop it anywhere: .wif, .usda, an image of a weave.' : `To open a draft, an image or a .usda file ${NEEDS_SERVER}.`;
  by('open').onchange = () => { if (by('open').files[0]) openFile(by('open').files[0]); by('open').value = ''; };
  addEventListener('dragover', e => { e.preventDefault(); document.body.classList.add('over'); });
  addEventListener('dragleave', e => { if (!e.relatedTarget) document.body.classList.remove('over'); });
  addEventListener('drop', e => {
    e.preventDefault();
    document.body.classList.remove('over');
    if (e.dataTransfer.files[0]) openFile(e.dataTransfer.files[0]);
  });
}
