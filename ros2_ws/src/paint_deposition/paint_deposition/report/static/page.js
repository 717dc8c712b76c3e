// The page: messages of the server come in, the reader's choices go out.

import { applyFilm, connect } from './connection.js';
import { showCharts } from './charts.js';
import { PartView } from './part.js';

const COLUMNS = ['time', 'mean', 'sd', 'min', 'max', 'coverage', 'within', 'volume', 'capture', 'rmse'];
const find = (id) => document.getElementById(id);
const view = new PartView(find('part'));
const state = { against: false, scale: null, history: [], doubts: '' };
// For tests, and for a look from the browser's console.
globalThis.page = { view, state };

const text = (value, digits, unit) => (Number.isFinite(value) ? `${value.toFixed(digits)}<small> ${unit}</small>` : '–');
const element = (tag, content, className = '') => Object.assign(document.createElement(tag), { innerHTML: content, className });
const signed = (value, digits) => `${value < 0 ? '−' : value > 0 ? '+' : ''}${Math.abs(value).toFixed(digits)}`;
const press = (button, on) => button.setAttribute('aria-pressed', on);

// --- what the server says

const receive = {
  // The first message of a connection, and of another part: what was shown before is gone.
  part(part) {
    Object.assign(state, { history: [], doubts: '' });
    view.showPart(part);
    view.showGuns([]);
    view.clearTrack();
    for (const id of ['track', 'replay', 'message']) find(id).hidden = true;
    hovered = null;
    showProbe();
    showHistory();
    showLink();
  },
  scale(scale) {
    state.scale = scale;
    find('colours').hidden = !scale.target;
    if (!scale.target) state.against = false;
    showColours();
  },
  film(changes) {
    applyFilm(view.film, changes);
    view.filmChanged();
    showProbe();
  },
  guns({ guns }) { view.showGuns(guns); },
  rows({ series, first, rows }) {
    if (series === 'track') {
      if (!first) view.clearTrack();
      view.addTrack(rows);
      find('track').hidden = !view.segments;
    } else {
      state.history.length = first;
      for (let at = 0; at < rows.length; at += COLUMNS.length) {
        state.history.push(Object.fromEntries(COLUMNS.map((name, column) => [name, rows[at + column]])));
      }
      showHistory();
    }
  },
  about({ text: words }) {
    find('about').textContent = words;
    document.title = `${words} – film`;
  },
  replay({ paused }) {
    find('replay').hidden = false;
    find('replay').firstElementChild.textContent = paused ? 'go on' : 'pause';
  },
  trust({ doubts }) {
    state.doubts = doubts;
    showLink();
  },
  message({ text: words }) {
    find('message').textContent = words;
    find('message').hidden = !words;
  },
  alive() {},
};

const send = connect(
  (message) => receive[message.kind](message),
  (there) => {
    state.there = there;
    showLink();
  },
);

function showLink() {
  const { there, doubts } = state;
  find('link').textContent = !there ? 'no connection – trying again' : doubts ? `in doubt: ${doubts}` : 'connected';
  find('link').classList.toggle('off', !there || Boolean(doubts));
}

// --- choices

find('colours').onclick = ({ target }) => {
  if (!target.dataset.colours) return;
  state.against = target.dataset.colours === 'target';
  showColours();
};
find('replay').onclick = ({ target }) => {
  const { command } = target.dataset;
  if (command) send(command);
};
find('front').onclick = () => view.lookAtFront();
find('track').onclick = ({ target }) => {
  view.track.visible = !view.track.visible;
  press(target, view.track.visible);
  view.draw();
};

// --- colours and what they mean

function showColours() {
  const { scale, against } = state;
  for (const button of find('colours').children) press(button, (button.dataset.colours === 'target') === against);
  const span = 2 * scale.tolerance || 0.25 * scale.target;
  const [low, high] = against ? [-span, span] : [scale.low, scale.high];
  view.setColours({ ...scale, low, high, against });
  const ramp = find('ramp').getContext('2d');
  const pixels = ramp.createImageData(1, 256);
  for (let row = 0; row < 256; row++) {
    const from = 4 * ((against ? 259 : 0) + 255 - row);
    pixels.data.set(scale.palettes.subarray(from, from + 4), 4 * row);
  }
  ramp.putImageData(pixels, 0, 0);
  find('unit').textContent = against ? 'film − target [µm]' : 'film [µm]';
  // Against a target the steps are its tolerance.
  const step = against ? span / 2 : roundStep((high - low) / 5);
  const digits = Number.isInteger(step) ? 0 : Math.max(1, -Math.floor(Math.log10(step) + 1e-9));
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high * (1 + 1e-6); k++) ticks.push([k * step, '']);
  const goal = against ? 0 : scale.target;
  if (goal && goal < high) ticks.push([goal, ' target']);
  const near = (value) => goal && !against && Math.abs(value - goal) < 0.06 * (high - low);
  find('ticks').replaceChildren(...ticks.filter(([value, words]) => words || !near(value)).map(([value, words]) => {
    const tick = element('li', `– ${against ? signed(value, digits) : value.toFixed(digits)}${words}`, words && 'goal');
    tick.style.bottom = `${(100 * (value - low)) / (high - low)}%`;
    return tick;
  }));
  showKeys();
}

// The next larger of 1, 2, 5, 10, 20 and so on.
function roundStep(least) {
  const unit = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].find((step) => step * unit >= least * (1 - 1e-6)) * unit;
}

function showKeys() {
  const { scale, against } = state;
  const last = state.history.at(-1);
  const colour = (palette, row) => `rgb(${scale.palettes.subarray(4 * (palette * 259 + row), 4 * (palette * 259 + row) + 3)})`;
  const keys = [['bare metal, below ' + scale.bare + ' µm', colour(0, 258)]];
  if (against || scale.low > scale.bare) keys.push(['thinner still', colour(+against, 256)]);
  if (against || (last?.max > scale.high)) keys.push(['thicker still', colour(+against, 257)]);
  find('keys').replaceChildren(...keys.map(([words, fill]) => {
    const key = element('span', `<i></i>${words}`);
    key.firstChild.style.background = fill;
    return key;
  }));
}

// --- figures

function showHistory() {
  const { history } = state;
  const { target, tolerance } = state.scale ?? {};
  find('figures').hidden = !history.length;
  find('history').hidden = history.length < 2;
  if (!history.length) return;
  const { mean, sd, min, max, coverage, within, volume, capture, rmse } = history.at(-1);
  const figures = [
    ['mean film', text(mean, 1, 'µm')], ['std deviation', text(sd, 2, 'µm')],
    ['thinnest', text(min, 1, 'µm')], ['thickest', text(max, 1, 'µm')],
    ['area painted', text(100 * coverage, 1, '%')], ['solids on it', text(volume, 1, 'cm³')],
  ];
  if (tolerance) figures.unshift(['within target', text(100 * within, 1, '%')]);
  if (target) figures.unshift(['target', `${target}${tolerance ? ` ± ${tolerance}` : ''}<small> µm</small>`]);
  if (Number.isFinite(capture)) figures.push(['share caught', text(100 * capture, 1, '%')]);
  if (Number.isFinite(rmse)) figures.push(['RMS of readings', text(rmse, 2, 'µm')]);
  find('figures').replaceChildren(...figures.map(([name, value]) => element('div', `<dt>${name}</dt><dd>${value}</dd>`)));
  if (history.length > 1) showCharts(history, target, tolerance);
}

// --- the probe

const canvas = find('part');
let hovered = null;
let pressed = null;

function showProbe() {
  const place = hovered ?? view.pinned;
  find('probe').hidden = !place;
  if (!place) return;
  const film = view.filmAt(place);
  const { scale } = state;
  const lines = [`<b>${film.toFixed(1)} µm</b>`];
  if (scale?.target) lines.push(`${signed(film - scale.target, 1)} µm from the target<br>`);
  lines.push(`x ${place.point.x.toFixed(3)}, y ${place.point.y.toFixed(3)}, z ${place.point.z.toFixed(3)} m`);
  const probe = find('probe');
  probe.innerHTML = lines.join('').replaceAll('-', '−');
  const box = canvas.getBoundingClientRect();
  const [x, y] = view.project(place.point);
  probe.style.left = `${Math.max(4, Math.min(x - box.left + 16, box.width - probe.offsetWidth - 4))}px`;
  probe.style.top = `${Math.max(4, Math.min(y - box.top + 16, box.height - probe.offsetHeight - 4))}px`;
}

canvas.onpointermove = (event) => {
  hovered = event.buttons ? null : view.pick(event.clientX, event.clientY);
  showProbe();
};
canvas.onpointerleave = () => { hovered = null; showProbe(); };
canvas.onpointerdown = ({ clientX, clientY }) => { pressed = [clientX, clientY]; };
canvas.onpointerup = ({ clientX, clientY }) => {
  if (!pressed || Math.hypot(clientX - pressed[0], clientY - pressed[1]) > 5) return;
  view.pinAt(view.pick(clientX, clientY));
  showProbe();
};
