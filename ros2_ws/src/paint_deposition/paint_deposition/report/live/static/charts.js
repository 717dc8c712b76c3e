// Film over time, and what was measured beside what was predicted.

import { uPlot } from './libraries.js';

const COLOURS = { mean: '#0b63b0', band: '#0b63b022', target: '#2f7d32', other: '#b3541e', ink: '#5b6876' };
const HEIGHT = 190;

const axis = (label) => ({ label, labelSize: 20, size: label ? 44 : 36, stroke: COLOURS.ink, font: '12px system-ui', labelFont: '12px system-ui', grid: { stroke: '#e5e9ed' } });
const time = { ...axis('time [s]'), size: 30 };
const number = (digits, unit) => (_, value) => (value == null ? '–' : `${value.toFixed(digits)} ${unit}`);

class Chart {
  constructor(element, options) {
    this.element = element;
    this.chart = new uPlot({ width: element.clientWidth || 320, height: HEIGHT, cursor: { drag: { x: false, y: false } }, legend: { live: false }, ...options }, options.series.map(() => []), element);
    new ResizeObserver(() => {
      if (element.clientWidth) this.chart.setSize({ width: element.clientWidth, height: HEIGHT });
    }).observe(element);
  }

  show(...columns) { this.chart.setData(columns); }
}

// Mean film with one standard deviation to either side, the target, and the RMS of the residual
// where there are readings.
export function filmChart(element, rms) {
  const um = number(1, 'µm');
  const band = { stroke: '#0b63b066', points: { show: false }, value: um };
  const chart = new Chart(element, {
    scales: { x: { time: false } },
    axes: [time, axis('film [µm]')],
    bands: [{ series: [2, 3], fill: COLOURS.band }],
    series: [
      { label: 'time', value: number(1, 's') },
      { label: 'mean', stroke: COLOURS.mean, width: 2, value: um },
      { label: '+ 1 SD', ...band },
      { label: '− 1 SD', ...band },
      { label: 'target', stroke: COLOURS.target, dash: [6, 4], points: { show: false }, value: um },
      ...(rms ? [{ label: 'RMS of readings', stroke: COLOURS.other, width: 2, value: number(2, 'µm') }] : []),
    ],
  });
  return Object.assign(chart, { extra: rms });
}

// Shares of the area: painted and, of that, within the target where there is one.
export function sharesChart(element, within) {
  const percent = number(1, '%');
  const chart = new Chart(element, {
    scales: { x: { time: false }, y: { range: [0, 100] } },
    axes: [time, axis('area [%]')],
    series: [
      { label: 'time', value: number(1, 's') },
      { label: 'painted', stroke: COLOURS.mean, width: 2, value: percent },
      ...(within ? [{ label: 'of it within target', stroke: COLOURS.target, width: 2, value: percent }] : []),
    ],
  });
  return Object.assign(chart, { extra: within });
}

export function parityChart(element) {
  const um = number(1, 'µm');
  const points = (stroke) => ({ stroke, width: 0, paths: () => null, points: { show: true, size: 6, fill: stroke }, value: um });
  return new Chart(element, {
    scales: { x: { time: false } },
    axes: [{ ...axis('measured [µm]'), size: 30 }, axis('predicted [µm]')],
    series: [
      { label: 'measured', value: um },
      { label: 'equal', stroke: COLOURS.ink, dash: [4, 4], value: um },
      { label: 'predicted', ...points(COLOURS.mean) },
    ],
  });
}
