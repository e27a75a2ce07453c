// All points: sorted and filtered by any column. Rows are made when they come into sight, so that thousands of them are no wait.
const BATCH = 150;
const tableState = { sort: null, down: false, search: '', filters: new Map(), shown: new Set(), order: [], made: 0 };

/** A test of a cell from what somebody typed: >2, <=0.5, 2..8, =word, !word, word. */
function filterOf(text, numeric) {
  const typed = text.trim().toLowerCase();
  if (typed === '') return null;
  const said = (cell) => cellText(cell).toLowerCase();
  if (typed.startsWith('!') && typed.length > 1) {
    const inner = filterOf(typed.slice(1), numeric);
    return inner && ((cell) => !inner(cell));
  }
  const comparison = /^(<=|>=|<|>|=)\s*(.*)$/.exec(typed);
  const number = (word) => (numeric && word.trim() !== '' ? Number(word) : NaN);
  if (comparison) {
    const [, sign, word] = comparison, bound = number(word);
    if (Number.isNaN(bound)) return sign === '=' ? (cell) => said(cell) === word : () => true;
    const holds = { '<': (x) => x < bound, '>': (x) => x > bound, '<=': (x) => x <= bound, '>=': (x) => x >= bound, '=': (x) => x === bound || numberText(x) === numberText(bound) }[sign];
    return (cell) => typeof cellValue(cell) === 'number' && holds(cellValue(cell));
  }
  const range = typed.split('..');
  if (range.length === 2 && !Number.isNaN(number(range[0])) && !Number.isNaN(number(range[1])))
    return (cell) => typeof cellValue(cell) === 'number' && cellValue(cell) >= number(range[0]) && cellValue(cell) <= number(range[1]);
  return (cell) => said(cell).includes(typed);
}

/** Numbers before texts, what is not there last, whichever way. */
function compareCells(a, b, down) {
  const x = cellValue(a), y = cellValue(b);
  const absent = (value) => value === null || value === '' || (typeof value === 'number' && !Number.isFinite(value));
  if (absent(x) || absent(y)) return absent(x) - absent(y);
  const ascending = typeof x === 'number' && typeof y === 'number' ? x - y
    : typeof x !== typeof y ? (typeof x === 'number' ? -1 : 1)
      : String(x).localeCompare(String(y), 'en', { numeric: true });
  return down ? -ascending : ascending;
}

let searchTexts = null;

function rowsInOrder() {
  const { rows, columns } = page.table;
  const tests = [...tableState.filters].map(([column, text]) => [column, filterOf(text, columns[column].numeric)]).filter(([, test]) => test);
  const words = tableState.search.toLowerCase().split(/\s+/).filter((word) => word);
  if (words.length > 0 && searchTexts === null) searchTexts = rows.map((row) => row.map(cellText).join(' ').toLowerCase());
  const kept = [];
  for (let i = 0; i < rows.length; ++i)
    if (words.every((word) => searchTexts[i].includes(word)) && tests.every(([column, test]) => test(rows[i][column]))) kept.push(i);
  if (tableState.sort !== null) kept.sort((a, b) => compareCells(rows[a][tableState.sort], rows[b][tableState.sort], tableState.down) || a - b);
  return kept;
}

const shownColumns = () => page.table.columns.map((_, i) => i).filter((i) => tableState.shown.has(i));

function rowOf(point) {
  const { columns, rows } = page.table;
  const status = columns.findIndex((column) => column.key === 'status');
  const made = element('tr', { 'data-point': point, tabindex: -1, class: status >= 0 && rows[point][status] !== 'ok' ? 'bad' : null });
  for (const i of shownColumns()) {
    const text = cellText(rows[point][i]);
    made.append(element('td', { class: columns[i].numeric ? 'number' : null, title: text.length > 40 ? text : null }, text));
  }
  return made;
}

function makeRows(count) {
  const body = byId('table').tBodies[0];
  const next = tableState.order.slice(tableState.made, tableState.made + count);
  const rows = document.createDocumentFragment();
  for (const point of next) rows.append(rowOf(point));
  body.append(rows);
  tableState.made += next.length;
  const left = tableState.order.length - tableState.made;
  byId('more').textContent = left > 0 ? `${left} more below` : '';
}

function showRows() {
  tableState.order = rowsInOrder();
  tableState.made = 0;
  byId('table').tBodies[0].replaceChildren();
  makeRows(BATCH);
  byId('table').tBodies[0].rows[0]?.setAttribute('tabindex', 0);
  const all = page.table.rows.length;
  byId('count').textContent = tableState.order.length === all ? `${all} points` : `${tableState.order.length} of ${all} points`;
  byId('table-box').scrollTop = 0;
}

function sortBy(column) {
  if (tableState.sort !== column) Object.assign(tableState, { sort: column, down: false });
  else if (!tableState.down) tableState.down = true;
  else Object.assign(tableState, { sort: null, down: false });
  showHeadings();
  showRows();
}

function heading(i) {
  const { label, numeric } = page.table.columns[i];
  const sorted = tableState.sort === i;
  return element('th', { scope: 'col', class: numeric ? 'number' : null, 'aria-sort': sorted ? (tableState.down ? 'descending' : 'ascending') : null },
    element('button', { type: 'button', 'data-column': page.table.columns[i].key, onclick: () => sortBy(i) }, `${label}${sorted ? (tableState.down ? ' ↓' : ' ↑') : ''}`));
}

function filterField(i) {
  const { label, key, numeric } = page.table.columns[i];
  const field = element('input', { type: 'text', 'data-filter': key, 'aria-label': `Filter ${label}`, placeholder: numeric ? '>' : '', autocomplete: 'off', spellcheck: 'false' });
  field.value = tableState.filters.get(i) ?? '';
  field.addEventListener('input', () => {
    if (field.value.trim() === '') tableState.filters.delete(i); else tableState.filters.set(i, field.value);
    showRows();
  });
  return element('th', {}, field);
}

function showHeadings() {
  const shown = shownColumns();
  byId('table').tHead.replaceChildren(element('tr', {}, ...shown.map(heading)), element('tr', {}, ...shown.map(filterField)));
}

function columnChoice() {
  return page.table.columns.map((column, i) => {
    const box = element('input', { type: 'checkbox', checked: tableState.shown.has(i) });
    box.addEventListener('change', () => {
      if (box.checked) tableState.shown.add(i);
      else {
        tableState.shown.delete(i);
        tableState.filters.delete(i);
      }
      showHeadings();
      showRows();
    });
    return element('label', {}, box, ` ${column.label}`);
  });
}

/** Arrows go from row to row, Enter opens one. */
function rowKeys(event) {
  const row = event.target.closest('tbody tr');
  if (!row) return;
  if (event.key === 'Enter' || event.key === ' ') openRecord(Number(row.dataset.point));
  else if (event.key === 'ArrowDown' || event.key === 'ArrowUp') {
    const down = event.key === 'ArrowDown';
    if (down && !row.nextElementSibling) makeRows(BATCH);
    const next = down ? row.nextElementSibling : row.previousElementSibling;
    if (!next) return;
    row.tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  } else return;
  event.preventDefault();
}

function startTable() {
  const { columns, constants, notes } = page.table;
  columns.forEach((column, i) => { if (column.shown) tableState.shown.add(i); });
  byId('columns').append(...columnChoice());
  byId('table-constants').textContent = [...constants.map(([name, value]) => `${name}: ${value}`), ...notes].join('; ');
  byId('search').addEventListener('input', (event) => { tableState.search = event.target.value; showRows(); });
  byId('clear').addEventListener('click', () => {
    tableState.search = byId('search').value = '';
    tableState.filters.clear();
    showHeadings();
    showRows();
  });
  const body = byId('table').tBodies[0];
  body.addEventListener('click', (event) => {
    const row = event.target.closest('tr');
    if (row && String(getSelection()) === '') openRecord(Number(row.dataset.point));
  });
  body.addEventListener('keydown', rowKeys);
  new IntersectionObserver((entries) => {
    if (entries[0].isIntersecting && tableState.made < tableState.order.length) makeRows(BATCH);
  }, { root: byId('table-box'), rootMargin: '600px' }).observe(byId('more'));
  window.addEventListener('beforeprint', () => makeRows(tableState.order.length));
  showHeadings();
  showRows();
}
