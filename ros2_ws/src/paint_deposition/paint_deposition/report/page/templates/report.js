'use strict';
(() => {
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
    modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d', 'tableRotation'],
    toImageButtonOptions: {format: 'png', scale: 2},
  };
  const flat = {...options, displayModeBar: 'hover'};
  let drawn = 0;

  const draw = (element, data, layout, config) => Plotly.newPlot(element, data, layout, config)
    .then(() => { root.dataset.drawn = ++drawn; element.dataset.drawn = ''; })
    .catch(error => {
      failed(element.id, error);
      element.innerHTML = '<p class="failed">This chart could not be drawn.</p>';
    });

  // The mesh is kept once for each part; traces only name its faces.
  const withGeometry = (trace, geometry) => {
    const {geometry: faces, views, passes, ...rest} = trace;
    return faces ? {...rest, ...geometry.vertices, ...geometry[faces]} : {...rest};
  };

  const flush = () => new Promise(done => setTimeout(done, 0));

  function partViewer() {
    const plot = document.getElementById('part');
    const titles = document.getElementById('part-titles');
    const viewSwitch = document.getElementById('part-views');
    const partSwitch = document.getElementById('part-experiments');
    const passBox = document.getElementById('part-passes');
    let current = content.scenes[content.first];
    let view = current.views[0].key;

    const visibility = () => current.data.map(trace =>
      trace.views.includes(view) && (!trace.passes || passBox.checked));

    const chosen = () => current.views.find(each => each.key === view);
    const bars = () => ({
      'coloraxis.showscale': view !== 'film', 'coloraxis2.showscale': view === 'film',
      [`coloraxis${view === 'film' ? '2' : ''}.colorbar.title.text`]: chosen().bar,
    });

    const buttons = (host, entries, chosen, pick) => {
      host.replaceChildren(...entries.map(([key, label]) => {
        const button = document.createElement('button');
        button.type = 'button';
        button.textContent = label;
        button.setAttribute('aria-pressed', key === chosen);
        button.addEventListener('click', () => pick(key));
        return button;
      }));
    };

    const label = () => {
      titles.replaceChildren(...chosen().titles.map(text => {
        const span = document.createElement('span');
        span.textContent = text;
        return span;
      }));
      buttons(viewSwitch, current.views.map(each => [each.key, each.label]), view, key => {
        view = key;
        refresh();
      });
      if (partSwitch) {
        buttons(partSwitch, content.scenes.map(each => [each.name, each.name]), current.name,
          name => { current = content.scenes.find(each => each.name === name); show(); });
      }
    };

    const refresh = () => {
      label();
      return Plotly.update(plot, {visible: visibility()}, bars());
    };

    const follow = () => {
      let busy = false;
      const follow = change => {
        if (busy || !plot.layout.scene2) return;
        const from = Object.keys(change).map(key => /^(scene2?)\.camera/.exec(key))
          .find(Boolean);
        if (!from) return;
        const other = from[1] === 'scene' ? 'scene2' : 'scene';
        busy = true;
        Plotly.relayout(plot, {[`${other}.camera`]: plot.layout[from[1]].camera})
          .finally(() => { busy = false; });
      };
      plot.on('plotly_relayout', follow);
      plot.on('plotly_relayouting', follow);
    };

    const show = () => {
      label();
      Plotly.purge(plot);
      const shown = visibility();
      const data = current.data.map((trace, k) =>
        ({...withGeometry(trace, current.geometry), visible: shown[k]}));
      const layout = structuredClone(current.layout);
      layout.coloraxis.showscale = view !== 'film';
      layout.coloraxis2.showscale = view === 'film';
      (view === 'film' ? layout.coloraxis2 : layout.coloraxis).colorbar.title.text = chosen().bar;
      return draw(plot, data, layout, {...options, displayModeBar: true}).then(follow);
    };

    passBox.addEventListener('change', refresh);
    return show();
  }

  async function start() {
    for (const figure of content.figures) {
      const element = document.getElementById(`figure-${figure.name}`);
      if (!element) continue;
      await draw(element, figure.data, figure.layout, flat);
      await flush();
    }
    await partViewer();
    for (const [index, scene] of content.places.entries()) {
      const element = document.getElementById(`places-${index}`);
      if (!scene || !element) continue;
      await flush();
      const geometry = content.scenes[index].geometry;
      await draw(element, scene.data.map(trace => withGeometry(trace, geometry)), scene.layout,
        options);
    }
    root.dataset.ready = '';
  }

  start().catch(error => failed('page', error));
})();
