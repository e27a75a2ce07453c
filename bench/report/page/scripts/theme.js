// Light, dark, or as the system has it.
const THEMES = ['auto', 'light', 'dark'];
const systemDark = window.matchMedia('(prefers-color-scheme: dark)');
let chosenTheme = 'auto';
const themeListeners = [];

function isDark() { return chosenTheme === 'dark' || (chosenTheme === 'auto' && systemDark.matches); }

function applyTheme() {
  document.documentElement.dataset.theme = isDark() ? 'dark' : 'light';
  byId('theme').textContent = chosenTheme;
  const told = chosenTheme === 'auto' ? 'as the system has them' : chosenTheme;
  byId('theme').setAttribute('aria-label', `Colours: ${told}`);
  for (const listener of themeListeners) listener();
}

function startTheme() {
  try { chosenTheme = localStorage.getItem('amrtex-theme') ?? 'auto'; } catch { /* a page from a file may not remember */ }
  if (!THEMES.includes(chosenTheme)) chosenTheme = 'auto';
  byId('theme').addEventListener('click', () => {
    chosenTheme = THEMES[(THEMES.indexOf(chosenTheme) + 1) % THEMES.length];
    try { localStorage.setItem('amrtex-theme', chosenTheme); } catch { /* likewise */ }
    applyTheme();
  });
  systemDark.addEventListener('change', applyTheme);
  applyTheme();
}
