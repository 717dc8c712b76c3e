'use strict';
// What the page shows: charts in groups, tables that sort.
(async () => {
  const root = document.documentElement;
  const errors = [];
  const failed = (what, error) => {
    errors.push(`${what}: ${error && error.message || error}`);
    root.dataset.errors = errors.join('\n');
  };
  window.addEventListener('error', event => failed('page', event.message));
  window.addEventListener('unhandledrejection', event => failed('page', event.reason));

  const content = JSON.parse(document.getElementById('content').textContent);
  const options = {
    displaylogo: false, responsive: true,
    modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'],
    toImageButtonOptions: {format: 'png', scale: 2},
  };
  // Quiet charts on the page's own background and in its font, with thin grids and outward ticks.
  const [ink, muted, edge, clear] = ['#1f2933', '#616e7c', '#9aa5b1', 'rgba(0,0,0,0)'];
  const axis = {
    title: {font: {size: 12, color: muted}, standoff: 6}, gridcolor: '#e4e7eb',
    zeroline: false, zerolinecolor: muted, zerolinewidth: 1, linecolor: edge, showline: true,
    ticks: 'outside', ticklen: 4, tickcolor: edge, tickfont: {size: 11, color: muted},
    automargin: true,
  };
  const template = {layout: {
    font: {family: 'Inter, "Segoe UI", "Helvetica Neue", Arial, sans-serif', size: 12, color: ink},
    paper_bgcolor: clear, plot_bgcolor: clear, margin: {l: 48, r: 12, t: 8, b: 44},
    showlegend: false, modebar: {bgcolor: clear, color: edge, activecolor: '#00708c'},
    xaxis: axis, yaxis: axis,
  }};
  // A finger has no place to rest on: the tools would hide the chart.
  const pointer = matchMedia('(hover: hover)').matches;
  const flat = {...options, displayModeBar: pointer && 'hover'};
  let drawn = 0;

  const make = (kind, parent, className = '', text = '') => {
    const element = document.createElement(kind);
    element.className = className;
    element.textContent = text;
    return parent.appendChild(element);
  };
  const rest = () => new Promise(done => setTimeout(done, 0));

  // Paper is narrower than the screen: drawings scale with their place instead of being cut.
  const scalable = element => {
    for (const svg of element.querySelectorAll('svg.main-svg')) {
      svg.setAttribute('viewBox', `0 0 ${svg.getAttribute('width')} ${svg.getAttribute('height')}`);
    }
    const box = element.querySelector('.svg-container');
    if (box) box.style.aspectRatio = `${element.clientWidth} / ${element.clientHeight}`;
  };

  const draw = (element, {data, layout}) => Plotly
    .newPlot(element, data, {...layout, template}, flat)
    .then(() => {
      root.dataset.drawn = ++drawn;
      element.dataset.drawn = '';
      scalable(element);
      element.on('plotly_afterplot', () => scalable(element));
    })
    .catch(error => {
      failed(element.id, error);
      element.innerHTML = '<p class="failed">This chart could not be drawn.</p>';
    });

  async function drawGroup(figure) {
    const host = document.getElementById(`figure-${figure.name}`);
    if (!host) return;
    if (figure.legend.length) {
      const legend = make('p', host, 'legend');
      for (const [words, colour, kind] of figure.legend) {
        make('i', make('span', legend), kind).style.color = colour;
        legend.lastChild.append(words);
      }
    }
    const charts = make('div', host, 'charts');
    for (const chart of figure.charts) {
      const panel = make('figure', charts);
      if (chart.title) make('figcaption', panel, '', chart.title);
      await draw(make('div', panel, 'chart'), chart);
      await rest();
    }
  }

  // A click on a heading sorts its table, a second click the other way round.
  const key = cell => {
    const text = cell.dataset.sort ?? cell.textContent.trim().replace('−', '-');
    return text !== '' && isFinite(text) ? Number(text) : text;
  };
  document.addEventListener('click', event => {
    const heading = event.target.closest('table.sortable th');
    if (!heading) return;
    const up = heading.getAttribute('aria-sort') !== 'ascending';
    for (const other of heading.parentNode.cells) other.removeAttribute('aria-sort');
    heading.setAttribute('aria-sort', up ? 'ascending' : 'descending');
    const body = heading.closest('table').tBodies[0], column = heading.cellIndex;
    const order = (a, b) => {
      const [first, second] = [key(a.cells[column]), key(b.cells[column])];
      const both = typeof first === 'number' && typeof second === 'number';
      return (both ? first - second : String(first).localeCompare(String(second))) * (up ? 1 : -1);
    };
    body.append(...[...body.rows].sort(order));
  });

  for (const figure of content) await drawGroup(figure);

  // A telephone shows what the page is read for; the rest unfolds, also where a link leads to it.
  const folds = [...document.querySelectorAll('.fold')];
  const unfold = () => {
    const goal = document.getElementById(location.hash.slice(1));
    const fold = goal && goal.closest('.fold');
    if (fold) fold.open = true;
  };
  if (matchMedia('(max-width: 600px)').matches) for (const fold of folds) fold.open = false;
  addEventListener('hashchange', unfold);
  unfold();
  root.dataset.ready = '';
})();
