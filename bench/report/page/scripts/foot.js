// Where it was measured, and what is not there.
function countedTable(title, headings, rows) {
  if (rows.length === 0) return [];
  return [element('h3', {}, title), element('div', { class: 'scroll' }, element('table', {},
    element('thead', {}, element('tr', {}, ...headings.map((text) => element('th', { scope: 'col' }, text)))),
    element('tbody', {}, ...rows.map((row) => element('tr', {}, ...row.map((cell) => element('td', {}, String(cell))))))))];
}

function startFoot() {
  byId('contexts').append(...page.contexts.flatMap((context) => [
    page.contexts.length > 1 ? element('h3', {}, `${context.name} (${context.points} points)`) : '',
    element('dl', {}, ...context.rows.flatMap(([label, text]) => [element('dt', {}, label), element('dd', {}, text)]))]));
  byId('not-measured').append(...countedTable('Not measured', ['points', 'encoding', 'status', 'reason'], page.not_measured));
  byId('left-out').append(...countedTable('Left out of structures, since the scene does not need it', ['points', 'encoding', 'what', 'why'], page.left_out));
  byId('warnings').append(...countedTable('Warnings', ['points', 'what'], page.warnings));
  byId('failed').hidden = page.not_measured.length + page.left_out.length + page.warnings.length === 0;
}
