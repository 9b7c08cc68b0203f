// The server, where the page has one. A page in a file asks nobody.
export const by = id => document.getElementById(id);
const served = !by('data');
const NEEDS_SERVER = "needs the server: start 'fabricusd preview --serve'";

// The token follows the # of the address that the terminal shows; the tab keeps it.
function takeToken() {
  const said = new URLSearchParams(location.hash.slice(1)).get('token');
  if (said) {
    sessionStorage.setItem('token', said);
    history.replaceState(null, '', location.pathname);
  }
  return sessionStorage.getItem('token') ?? '';
}
const token = served ? takeToken() : '';

async function ask(path, said) {
  let answer, found;
  const headers = { 'Content-Type': 'application/json', 'X-Fabricusd-Token': token };
  try {
    answer = await fetch(path, { method: 'POST', headers, body: JSON.stringify(said) });
    found = await answer.json();
  } catch {
    throw Error('the server does not answer; was it stopped?');
  }
  if (answer.status === 403) throw Error(`${found.error}: open the address that the terminal shows`);
  if (!answer.ok) throw Error(found.error);
  return found;
}

// A line over the picture, until the next one; "" for none.
function trouble(text) {
  by('trouble').textContent = text;
  by('trouble').hidden = !text;
}

function tell(text) { by('told').textContent = text; }
