// Two pictures under one slider, and what a picture is off by.
const pictureState = { left: 0, right: null };  // right: a number of page.pictures, or null for the reference of the left one

const imageOf = (place) => (place === null ? '' : page.images[place]);

function pictureName(picture) {
  const scene = page.scenes[page.scene_of[picture.point]];
  const prefix = page.scenes.length > 1 ? `${scene.name}: ` : '';
  return prefix + page.labels[picture.point];
}

function pictureCost(point) {
  const cost = mainCells(point).filter(({ column }) => ['wall', 'total', 'psnr', 'psnr_common'].includes(column.key));
  return cost.map(({ column, cell }) => `${numberText(cellValue(cell))} ${/\((.*)\)/.exec(column.label)?.[1] ?? ''}`).join(', ');
}

function showPictures() {
  const left = page.pictures[pictureState.left];
  const right = pictureState.right === null ? null : page.pictures[pictureState.right];
  const place = right ? right.image : left.reference;
  byId('image-left').src = imageOf(left.image);
  byId('image-left').alt = `picture of ${pictureName(left)}`;
  byId('image-right').src = imageOf(place ?? left.image);
  byId('image-right').alt = right ? `picture of ${pictureName(right)}` : 'its reference in double precision';
  byId('left').value = pictureState.left;
  byId('right').value = pictureState.right ?? 'reference';
  const told = right ? pictureName(right) : place === null ? 'no reference is stored' : 'its reference in double precision';
  byId('stage-caption').textContent = `Left: ${pictureName(left)}. Right: ${told}. ${left.width} × ${left.height} pixels.`;
  showDifference(left);
  for (const button of byId('thumbnails').children) button.setAttribute('aria-pressed', String(Number(button.dataset.picture) === pictureState.left));
}

function showDifference(picture) {
  byId('difference-figure').hidden = picture.difference === null;
  if (picture.difference === null) return;
  byId('image-difference').src = imageOf(picture.difference);
  byId('image-difference').alt = 'signed difference of the left picture to its reference';
  byId('scale-low').textContent = `−${numberText(picture.scale)}`;
  byId('scale-high').textContent = `+${numberText(picture.scale)}`;
  byId('difference-caption').textContent =
    `Left picture − its reference: of each pixel the channel that is off most. 99.5 % of the pixels lie within the colours; the largest difference is ${numberText(picture.largest)}.`;
}

function split(share) {
  byId('stage').style.setProperty('--split', `${share}%`);
  byId('slider').value = share;
}

function startSlider() {
  const stage = byId('stage');
  const follow = (event) => {
    const box = stage.getBoundingClientRect();
    split(Math.round(100 * Math.min(1, Math.max(0, (event.clientX - box.left) / box.width))));
  };
  stage.addEventListener('pointerdown', (event) => { stage.setPointerCapture(event.pointerId); follow(event); });
  stage.addEventListener('pointermove', (event) => { if (event.buttons) follow(event); });
  byId('slider').addEventListener('input', (event) => split(event.target.value));
  split(50);
}

function startPictures() {
  const pictures = page.pictures;
  byId('pictures').hidden = pictures.length === 0;
  if (pictures.length === 0) return;
  byId('scale-bar').style.background = `linear-gradient(to right, ${page.difference_colors.join(', ')})`;
  byId('right').append(element('option', { value: 'reference' }, 'its reference'));
  pictures.forEach((picture, i) => {
    for (const id of ['left', 'right']) byId(id).append(element('option', { value: i }, pictureName(picture)));
    const show = () => { pictureState.left = i; showPictures(); };
    byId('thumbnails').append(element('button', { type: 'button', 'data-picture': i, onclick: show },
      element('img', { src: imageOf(picture.image), alt: '', loading: 'lazy' }),
      element('span', {}, pictureName(picture), element('small', {}, pictureCost(picture.point)))));
  });
  byId('left').addEventListener('change', (event) => { pictureState.left = Number(event.target.value); showPictures(); });
  byId('right').addEventListener('change', (event) => {
    pictureState.right = event.target.value === 'reference' ? null : Number(event.target.value);
    showPictures();
  });
  startSlider();
  showPictures();
}
