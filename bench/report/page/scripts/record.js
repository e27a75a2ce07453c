// The whole record of a point, and the command that measures it again.
function treeOf(value) {
  return Object.entries(value).map(([key, part]) => {
    if (part !== null && typeof part === 'object' && !isShort(part))
      return element('details', { open: !Array.isArray(part) && Object.keys(part).length < 24 }, element('summary', {}, key), ...treeOf(part));
    return element('div', {}, element('span', {}, key), element('span', {}, part === null ? '–' : typeof part === 'string' ? part : JSON.stringify(part)));
  });
}

/** A list of numbers or an empty thing stands on one line. */
function isShort(part) {
  const items = Object.values(part);
  return items.length === 0 || (Array.isArray(part) && items.every((item) => item === null || typeof item !== 'object'));
}

async function copyText(text, button) {
  const before = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = 'Copied';
  } catch {
    button.textContent = 'Select it';  // a page from a file may not write to the clipboard
  }
  setTimeout(() => { button.textContent = before; }, 1500);
}

function commandBox(point) {
  const command = page.commands[point];
  if (command === null)
    return element('p', { class: 'note' }, 'This record does not say what was asked for, so it cannot be measured again from it alone (schema amrtex-record/1).');
  return element('div', { class: 'command' }, element('code', { id: 'again' }, command),
    element('button', { type: 'button', onclick: (event) => copyText(command, event.currentTarget) }, 'Copy'));
}

function openRecord(point) {
  const record = recordOf(point);
  byId('record-title').textContent = page.labels[point];
  const json = element('button', { type: 'button', class: 'quiet', onclick: (event) => copyText(JSON.stringify(record, null, 1), event.currentTarget) }, 'Copy as JSON');
  byId('record-body').replaceChildren(
    element('h3', {}, 'Measure it again'), commandBox(point),
    element('h3', {}, 'Record ', json), element('div', { class: 'tree' }, ...treeOf(record)));
  const dialog = byId('record');
  dialog.dataset.point = point;
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0;
}

function startRecord() {
  const dialog = byId('record');
  byId('record-close').addEventListener('click', () => dialog.close());
  dialog.addEventListener('click', (event) => { if (event.target === dialog) dialog.close(); });
}
