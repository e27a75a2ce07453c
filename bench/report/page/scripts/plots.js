// Plots: Vega-Lite where the page has it, else the pictures that came with the page.
const hasVega = typeof vegaEmbed === 'function';
const shownPlots = [];  // {box, plot}: drawn again when the colours change

function cssColor(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

function plotConfig(width) {
  const ink = cssColor('--ink'), faint = cssColor('--faint'), line = cssColor('--line');
  const font = getComputedStyle(document.body).fontFamily;
  return {
    background: 'transparent', font,
    view: { stroke: line },
    axis: { gridColor: line, domainColor: faint, tickColor: line, labelColor: faint, titleColor: ink, titleFontWeight: 500, labelFontSize: 11, titleFontSize: 12 },
    legend: { symbolOpacity: 1, symbolBaseFillColor: ink, symbolBaseStrokeColor: ink, labelColor: ink, titleColor: faint, titleFontWeight: 500, labelLimit: 150, ...(width < 560 ? { orient: 'bottom', columns: 3 } : {}) },
    title: { color: ink },
  };
}

function hideTip() { byId('tip').hidden = true; }

/** What a mark is about, beside the pointer. */
function showTip(point, x, y) {
  const tip = byId('tip');
  tip.replaceChildren(element('b', {}, page.labels[point]),
    ...mainCells(point).map(({ column, cell }) => element('span', {}, `${column.label}: ${cellText(cell)}`)));
  tip.hidden = false;
  const box = tip.getBoundingClientRect();
  tip.style.left = `${Math.max(4, Math.min(x + 14, innerWidth - box.width - 8))}px`;
  tip.style.top = `${y + 16 + box.height > innerHeight ? Math.max(4, y - box.height - 12) : y + 16}px`;
}

const pointOf = (item) => (item && item.datum && Number.isInteger(item.datum.point) ? item.datum.point : null);

/** More marks are drawn as a picture: an element each takes the page's time. */
const MOST_ELEMENTS = 500;
const marksOf = (spec) => [spec, ...(spec.layer ?? [])].reduce((sum, layer) => sum + (layer.data?.values?.length ?? 0), 0);

async function drawPlot(box, plot) {
  const spec = structuredClone(plot.spec);
  for (const layer of spec.layer ?? []) if (layer.mark.style === 'ink-line') layer.mark.color = cssColor('--ink');
  const compact = box.clientWidth < 560;
  if (compact)  // long names leave no room for what they name
    for (const layer of spec.layer ?? []) if (layer.encoding.y.type === 'ordinal') layer.encoding.y.axis.labelLimit = 120;
  const result = await vegaEmbed(box, spec, {
    mode: 'vega-lite', renderer: marksOf(spec) > MOST_ELEMENTS ? 'canvas' : 'svg', ast: true, config: plotConfig(box.clientWidth),
    actions: { export: true, source: false, compiled: false, editor: false },
    tooltip: (_, event, item) => {
      const point = pointOf(item);
      if (point === null || event.type === 'mouseout' || event.type === 'pointerout') hideTip();
      else showTip(point, event.clientX, event.clientY);
    },
  });
  result.view.addEventListener('click', (_, item) => {
    const point = pointOf(item);
    if (point !== null) { hideTip(); openRecord(point); }
  });
  box.dataset.drawn = 'yes';
}

/** Drawn when it comes into sight, one at a time and after what somebody types: compiling a plot takes longer than looking at another. */
const waitingPlots = [];
const whenIdle = (then) => (window.requestIdleCallback ? requestIdleCallback(then, { timeout: 300 }) : setTimeout(then, 0));

async function drawWaiting() {
  const box = waitingPlots[0];
  const shown = shownPlots.find((one) => one.box === box);
  try {
    if (shown && !box.dataset.drawn) await drawPlot(shown.box, shown.plot);
  } finally {  // one that cannot be drawn holds up no other
    waitingPlots.shift();
    if (waitingPlots.length > 0) whenIdle(drawWaiting);
  }
}

const plotWatcher = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (!entry.isIntersecting) continue;
    plotWatcher.unobserve(entry.target);
    waitingPlots.push(entry.target);
    if (waitingPlots.length === 1) whenIdle(drawWaiting);
  }
}, { rootMargin: '400px' });

function forgetPlots(container) {
  for (let i = shownPlots.length - 1; i >= 0; --i)
    if (container.contains(shownPlots[i].box)) {
      plotWatcher.unobserve(shownPlots[i].box);
      shownPlots.splice(i, 1);
    }
  container.replaceChildren();
}

function addPlot(container, plot) {
  const box = element('div', { class: 'vega', role: 'img', 'aria-label': `${plot.title}. ${plot.note}` });
  container.append(element('figure', { class: 'plot' }, plot.title ? element('h3', {}, plot.title) : null, box, element('figcaption', {}, plot.note)));
  if (hasVega) {
    shownPlots.push({ box, plot });
    plotWatcher.observe(box);
  } else if (plot.svg) {
    box.classList.add('still');
    box.append(document.importNode(new DOMParser().parseFromString(plot.svg, 'image/svg+xml').documentElement, true));
  }
}

/** Plots of a section, which goes where there are none. */
function showPlots(id, plots) {
  const section = byId(id), container = section.querySelector('.plots');
  forgetPlots(container);
  for (const plot of plots) addPlot(container, plot);
  section.hidden = plots.length === 0;
}

function drawPlotsAgain() {
  if (!hasVega) return;
  for (const { box, plot } of shownPlots) if (box.dataset.drawn) drawPlot(box, plot);
}

function startPlots() {
  themeListeners.push(drawPlotsAgain);
  showPlots('mesh-size', page.mesh_size);
  showPlots('diagrams', hasVega ? page.diagrams : []);
  let width = innerWidth;
  window.addEventListener('resize', () => {
    if ((width < 700) !== (innerWidth < 700)) drawPlotsAgain();
    width = innerWidth;
  });
  window.addEventListener('beforeprint', () => {
    for (const { box, plot } of shownPlots) if (hasVega && !box.dataset.drawn) drawPlot(box, plot);
  });
}
