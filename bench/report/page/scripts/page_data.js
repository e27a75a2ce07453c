// The page's data, and how its values are written.
const page = JSON.parse(document.getElementById('page-data').textContent);
const SHARED = '\u0001';  // shared_parts.hpp

/** The whole record of a point: shared parts are put back in their places. */
function recordOf(point) {
  const whole = (value) => {
    if (Array.isArray(value)) return value.map(whole);
    if (value === null || typeof value !== 'object') return value;
    if (Object.hasOwn(value, SHARED)) return whole(page.shared.parts[value[SHARED]]);
    return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, whole(part)]));
  };
  return whole(page.shared.records[point]);
}

/** As tables have it: four digits, an exponent only where it is needed. */
function numberText(value) {
  if (!Number.isFinite(value)) return '–';
  if (value === 0 || (Number.isInteger(value) && Math.abs(value) < 1e12)) return String(value);
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e7) return value.toExponential(2);
  if (size >= 9999.5) return value.toFixed(0);
  return String(Number(value.toPrecision(4)));
}

/** Of a cell: a text, a number, [median, deviation], or null. */
function cellText(cell) {
  if (cell === null || cell === '') return '–';
  if (Array.isArray(cell)) return `${numberText(cell[0])} ± ${numberText(cell[1])}`;
  return typeof cell === 'number' ? numberText(cell) : String(cell);
}

/** What a cell is sorted and filtered by. */
function cellValue(cell) { return Array.isArray(cell) ? cell[0] : cell; }

/** An element: texts among its children stay texts. */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith('on')) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, '');
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const byId = (id) => document.getElementById(id);

/** The cells that people look at first, with their labels. */
function mainCells(point) {
  const row = page.table.rows[point];
  return page.table.columns
    .map((column, i) => ({ column, cell: row[i] }))
    .filter(({ column, cell }) => column.shown && column.numeric && cell !== null);
}
