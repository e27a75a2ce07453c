// The answer of one scene: two sentences, what each choice costs, and its plots.
function sceneTitle(scene) {
  const several = (key) => new Set(page.scenes.map((one) => one[key])).size > 1;
  return [several('experiment') ? scene.experiment : null, scene.name, several('context') ? scene.context : null]
    .filter((part) => part).join(' · ') + ` (${scene.points})`;
}

function answerCard({ asked, point, setting, cost }) {
  const title = element('b', {}, asked === 'smallest' ? 'smallest' : `fastest at ${asked}`);
  if (point === null) return element('div', { class: 'card' }, title, element('span', { class: 'setting' }, 'none reaches it'));
  return element('button', { type: 'button', class: 'card', 'data-point': point, onclick: () => openRecord(point) },
    title, element('span', { class: 'setting' }, setting), element('span', { class: 'cost' }, cost));
}

function showScene(number) {
  const scene = page.scenes[number];
  byId('verdict').textContent = `${scene.smallest} ${scene.fastest}`;
  byId('answers').replaceChildren(...scene.answers.map(answerCard));
  byId('error-note').textContent = `${scene.error}. Renderer: ${scene.context}.`;
  const of = (...kinds) => scene.plots.filter((plot) => kinds.some((kind) => plot.kind.startsWith(kind)));
  showPlots('fronts', of('front'));
  showPlots('parameters', of('parameter'));
  showPlots('memory', of('memory'));
  showPlots('causes', of('causes'));
  showNavigation();
}

function startAnswers() {
  const choice = byId('scene');
  page.scenes.forEach((scene, i) => choice.append(element('option', { value: i }, sceneTitle(scene))));
  choice.addEventListener('change', () => showScene(Number(choice.value)));
  byId('scene-choice').hidden = page.scenes.length < 2;
  showScene(0);
}

function showNavigation() {
  const sections = [...document.querySelectorAll('main > section')].filter((section) => !section.hidden);
  byId('nav').replaceChildren(...sections.map((section) => element('a', { href: `#${section.id}` }, section.dataset.nav)));
}
