// The film over time, in two charts.

import { uPlot } from './libraries.js';

const BLUE = '#0b63b0';
const GREEN = '#2f7d32';
const HEIGHT = 190;

class Chart {
  constructor(id, label, options) {
    this.element = document.getElementById(id);
    const words = { stroke: '#5b6876', font: '12px system-ui', labelFont: '12px system-ui', labelSize: 20, grid: { stroke: '#e5e9ed' } };
    this.options = {
      height: HEIGHT, cursor: { drag: { x: false, y: false } }, legend: { live: false },
      axes: [{ ...words, label: 'time [s]', size: 30 }, { ...words, label, size: 44 }],
      ...options, scales: { x: { time: false }, ...options.scales },
    };
    new ResizeObserver(() => {
      if (this.element.clientWidth) this.plot?.setSize({ width: this.element.clientWidth, height: HEIGHT });
    }).observe(this.element);
  }

  // Series `of` rows; one without any value, as the target where there is none, is left out.
  show(rows, series) {
    const values = (of) => rows.map((row) => (Number.isFinite(of(row)) ? of(row) : null));
    const columns = series.map((one) => [one, values(one.of)]).filter(([, column]) => column.some((value) => value !== null));
    const labels = columns.map(([{ label }]) => label).join();
    if (labels !== this.labels) {
      this.plot?.destroy();
      const lines = columns.map(([one]) => ({ points: { show: false }, ...one }));
      this.plot = new uPlot({ ...this.options, width: this.element.clientWidth || 320, series: [{ label: 'time' }, ...lines] }, [], this.element);
      this.labels = labels;
    }
    this.plot.setData([values(({ time }) => time), ...columns.map(([, column]) => column)]);
  }
}

const film = new Chart('film', 'film [µm]', { bands: [{ series: [2, 3], fill: `${BLUE}22` }] });
const shares = new Chart('shares', 'area [%]', { scales: { y: { range: [0, 100] } } });

// Mean film with one standard deviation to either side, the target, and the RMS of the residual
// where there are readings; the shares of the area that are painted and, of that, within target.
// Without a tolerance next to nothing is just on the target.
export function showCharts(history, target, tolerance) {
  film.show(history, [
    { label: 'mean', of: ({ mean }) => mean, stroke: BLUE, width: 2 },
    { label: '+ 1 SD', of: ({ mean, sd }) => mean + sd, stroke: `${BLUE}66` },
    { label: '− 1 SD', of: ({ mean, sd }) => mean - sd, stroke: `${BLUE}66` },
    { label: 'target', of: () => target || NaN, stroke: GREEN, dash: [6, 4] },
    { label: 'RMS of readings', of: ({ rmse }) => rmse, stroke: '#b3541e', width: 2 },
  ]);
  shares.show(history, [
    { label: 'painted', of: ({ coverage }) => 100 * coverage, stroke: BLUE, width: 2 },
    { label: 'of it within target', of: ({ within }) => (tolerance ? 100 * within : NaN), stroke: GREEN, width: 2 },
  ]);
}
