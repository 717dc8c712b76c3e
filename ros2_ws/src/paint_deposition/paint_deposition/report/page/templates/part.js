'use strict';
// The part in 3D, a section along any line, and the gun along its path.
const partViewer = async () => {
  const {content, options, flat, make, rest, draw, download} = page;
  const at = id => document.getElementById(id);
  const panes = at('part'), viewSwitch = at('part-views'), partSwitch = at('part-experiments');
  const passBox = at('part-passes'), sectionPlot = at('section'), lines = at('section-lines');
  const angle = at('section-angle'), offset = at('section-offset'), way = at('way'), picked = at('picked');
  const NEAR_M = 0.015, INK = '#1f2933', MARK = '#d1701f';
  let scene = content.scenes[content.first], view = scene.views[0].key, plots = [];

  // Arrays come as plotly's typed arrays, in base64.
  const decoded = new Map();
  const values = array => {
    if (Array.isArray(array)) return array;
    if (!decoded.has(array)) {
      const bytes = Uint8Array.from(atob(array.bdata), letter => letter.charCodeAt(0));
      decoded.set(array, new (array.dtype === 'f4' ? Float32Array : Int32Array)(bytes.buffer));
    }
    return decoded.get(array);
  };
  const xyz = (of, k) => [values(of.x)[k], values(of.y)[k], values(of.z)[k]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  const buttons = (host, entries, chosen, pick) => {
    host.replaceChildren();
    for (const [key, label] of entries) {
      const button = make('button', host, '', label);
      button.type = 'button';
      button.setAttribute('aria-pressed', key === chosen);
      button.addEventListener('click', () => pick(key));
    }
  };

  // One change after the other: a plot that is being drawn takes no second one. Of changes that wait
  // only one of each kind is done, with the values of that moment.
  let last = Promise.resolve();
  const waiting = new Set();
  const inTurn = work => {
    if (waiting.has(work)) return;
    waiting.add(work);
    last = last.then(() => { waiting.delete(work); return work(); })
      .catch(error => page.failed('part', error));
  };

  const chosen = () => scene.views.find(each => each.key === view);
  const shown = trace => !trace.views || trace.views.includes(view)
    && (!trace.passes || passBox.checked);
  const bars = () => ({
    'coloraxis.showscale': view !== 'film', 'coloraxis2.showscale': view === 'film',
    [`coloraxis${view === 'film' ? '2' : ''}.colorbar.title.text`]: chosen().bar,
  });

  const label = () => {
    chosen().titles.forEach((text, k) => { panes.children[k].firstChild.textContent = text; });
    buttons(viewSwitch, scene.views.map(each => [each.key, each.label]), view, key => {
      view = key;
      inTurn(refresh);
    });
    if (partSwitch) {
      buttons(partSwitch, content.scenes.map(each => [each.name, each.name]), scene.name,
        name => { scene = content.scenes.find(each => each.name === name); inTurn(show); });
    }
  };
  const refresh = () => {
    if (plots.length !== scene.panes.length) return show();
    label();
    return Promise.all(plots.map((plot, k) =>
      Plotly.update(plot, {visible: allTraces(k).map(shown)}, bars())));
  };

  // The section and the gun are the last two traces of each pane.
  const added = () => [
    {type: 'scatter3d', mode: 'lines', x: [], y: [], z: [], hoverinfo: 'skip',
      line: {color: MARK, width: 5}},
    {type: 'scatter3d', mode: 'lines+markers', x: [], y: [], z: [], hoverinfo: 'skip',
      line: {color: MARK, width: 6}, marker: {color: MARK, size: [7, 0]}},
  ];
  const allTraces = k => [...scene.panes[k], ...added()];
  const withGeometry = trace => {
    const {geometry, views, passes, ...other} = trace;
    return geometry ? {...other, ...scene.geometry.vertices, ...scene.geometry[geometry]} : other;
  };

  const turnTogether = () => {
    let busy = false;
    for (const plot of plots) {
      const follow = change => {
        if (busy || !Object.keys(change).some(key => key.startsWith('scene.camera'))) return;
        busy = true;
        Promise.all(plots.filter(other => other !== plot).map(other =>
          Plotly.relayout(other, {'scene.camera': plot.layout.scene.camera})))
          .finally(() => { busy = false; });
      };
      plot.on('plotly_relayout', follow);
      plot.on('plotly_relayouting', follow);
    }
  };

  // A click notes the place as a measuring point, in the columns that a list of points has.
  const note = event => {
    const {x, y, z} = event.points[0], head = 'point,x_m,y_m,z_m';
    const lines = picked.value.trim() ? picked.value.trim().split('\n') : [head];
    lines.push([`P${lines.length}`, ...[x, y, z].map(value => value.toFixed(4))].join(','));
    picked.value = lines.join('\n') + '\n';
  };

  const show = async () => {
    plots.forEach(plot => Plotly.purge(plot));
    panes.replaceChildren();
    plots = scene.panes.map((_, k) => {
      const panel = make('figure', panes);
      make('figcaption', panel);
      const plot = make('div', panel, 'chart scene');
      plot.id = `part-${k}`;
      return plot;
    });
    label();
    for (const [k, plot] of plots.entries()) {
      const layout = structuredClone(scene.layout);
      layout.coloraxis.showscale = view !== 'film';
      layout.coloraxis2.showscale = view === 'film';
      (view === 'film' ? layout.coloraxis2 : layout.coloraxis).colorbar.title.text = chosen().bar;
      const data = allTraces(k).map(trace => ({...withGeometry(trace), visible: shown(trace)}));
      await draw(plot, data, layout, options);
      plot.on('plotly_click', note);
      await rest();
    }
    turnTogether();
    way.max = values(scene.way.x).length - 1;
    way.value = Math.min(way.value, way.max);
    const through = line => {
      angle.value = line.angle;
      setOffsetRange();
      offset.value = 1000 * line.offset;
      return drawSection();
    };
    const known = scene.readings.lines;
    buttons(lines, known.map((line, k) => [k, line.label]), null, k => inTurn(() => through(known[k])));
    await through(known[0] || {angle: 0, offset: 0});
    await moveGun();
  };

  // Directions of the section's line and of what lies across it, in the plane that the gun faces.
  const directions = () => {
    const turn = angle.value * Math.PI / 180;
    const mixed = (a, b) => values(scene.plane.right).map(
      (right, k) => a * right + b * values(scene.plane.up)[k]);
    return [mixed(Math.cos(turn), Math.sin(turn)), mixed(-Math.sin(turn), Math.cos(turn))];
  };
  const distances = direction => {
    const {x, y, z} = scene.geometry.vertices, centre = dot(values(scene.plane.centre), direction);
    return values(x).map((_, k) =>
      dot([values(x)[k], values(y)[k], values(z)[k]], direction) - centre);
  };
  const setOffsetRange = () => {
    const across = distances(directions()[1]);
    offset.min = Math.ceil(1000 * Math.min(...across));
    offset.max = Math.floor(1000 * Math.max(...across));
  };

  // Where a plane cuts the painted side: films along it, and the cut itself for the 3D view.
  const cut = (films, place) => {
    const [along, across] = directions();
    const far = distances(across).map(value => value - place), way = distances(along);
    const {i, j, k} = scene.geometry.all, toward = values(scene.plane.toward);
    const found = {at: [], films: films.map(() => []), x: [], y: [], z: []};
    const put = (from, to) => {
      const share = far[from] / (far[from] - far[to]);
      const between = array => array[from] + share * (array[to] - array[from]);
      found.at.push(1000 * between(way));
      films.forEach((film, n) => found.films[n].push(between(film)));
      for (const name of 'xyz') found[name].push(between(values(scene.geometry.vertices[name])));
    };
    for (let face = 0; face < values(i).length; ++face) {
      const corners = [values(i)[face], values(j)[face], values(k)[face]];
      const edges = [[0, 1], [1, 2], [2, 0]].map(pair => pair.map(n => corners[n]))
        .filter(([a, b]) => (far[a] < 0) !== (far[b] < 0));
      if (edges.length !== 2) continue;
      const [a, b, c] = corners.map(n => xyz(scene.geometry.vertices, n));
      const [u, v] = [b, c].map(corner => corner.map((value, n) => value - a[n]));
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0]];
      if (dot(normal, toward) <= 0) continue;
      for (const [from, to] of edges) put(from, to);
      for (const list of [found.at, ...found.films, found.x, found.y, found.z]) list.push(null);
    }
    return found;
  };

  const drawSection = async () => {
    const place = offset.value / 1000;
    const films = scene.panes.map(pane =>
      values(pane.find(trace => trace.views && trace.views[0] === 'film').intensity));
    const found = cut(films, place), [along, across] = directions();
    const centre = values(scene.plane.centre), readings = scene.readings;
    const near = [...values(readings.measured).keys()].filter(k =>
      Math.abs(dot(xyz(readings, k), across) - dot(centre, across) - place) < NEAR_M);
    const bold = films.length - 1;
    const data = found.films.map((film, k) => ({
      type: 'scatter', mode: 'lines', x: found.at, y: film, hoverinfo: k === bold ? 'x+y' : 'skip',
      line: scene.lines[k],
    })).reverse();
    data.push({
      type: 'scatter', mode: 'markers', marker: {color: INK, size: 6},
      x: near.map(k => 1000 * (dot(xyz(readings, k), along) - dot(centre, along))),
      y: near.map(k => values(readings.measured)[k]),
      hovertemplate: 'measured %{y:.2f} µm<extra></extra>',
    });
    at('section-told').textContent = `${angle.value}° from level, ${offset.value} mm from the `
      + `centre of the part, ${near.length} readings within 15 mm`;
    if ('drawn' in sectionPlot.dataset) await Plotly.react(sectionPlot, data, content.section);
    else await draw(sectionPlot, data, content.section, flat);
    await mark(2, {x: [found.x], y: [found.y], z: [found.z]});
  };
  const mark = (fromEnd, change) => Promise.all(plots.map((plot, k) =>
    Plotly.restyle(plot, change, [allTraces(k).length - fromEnd])));

  const moveGun = () => {
    const k = Number(way.value), path = scene.way, reach = scene.reach_m;
    const tcp = xyz(path, k);
    const ends = ['x', 'y', 'z'].map((name, n) =>
      [[tcp[n], tcp[n] + reach * values(path[`a${name}`])[k]]]);
    const gun = values(path.on)[k]
      ? `pass ${values(path.pass)[k]}, gun on` : 'gun off';
    at('way-told').textContent = `${values(path.time_s)[k].toFixed(2)} s, ${gun}, `
      + `${values(path.speed)[k].toFixed(2)} m/s`;
    return mark(1, {x: ends[0], y: ends[1], z: ends[2]});
  };

  for (const slider of [angle, offset]) {
    slider.addEventListener('input', () => {
      if (slider === angle) setOffsetRange();
      inTurn(drawSection);
    });
  }
  way.addEventListener('input', () => inTurn(moveGun));
  passBox.addEventListener('change', () => inTurn(refresh));
  at('picked-csv').addEventListener('click', () => download('points.csv', picked.value));
  at('film-csv').addEventListener('click', () => {
    const {x, y, z} = scene.geometry.vertices;
    const films = scene.panes.map(pane =>
      values(pane.find(trace => trace.views && trace.views[0] === 'film').intensity));
    const rows = [...values(x).keys()].map(k =>
      [...xyz({x, y, z}, k).map(value => value.toFixed(5)), ...films.map(f => f[k].toFixed(3))]);
    download(`film_${scene.name}.csv`, [['x_m', 'y_m', 'z_m', ...scene.films], ...rows].join('\n') + '\n');
  });
  inTurn(show);
  await last;
};

(async () => {
  for (const figure of page.content.figures) await page.drawGroup(figure);
  await partViewer();
  for (const [index, scene] of page.content.places.entries()) {
    const element = document.getElementById(`places-${index}`);
    if (!scene || !element) continue;
    await page.rest();
    const geometry = page.content.scenes[index].geometry;
    const data = scene.data.map(({geometry: faces, views, ...trace}) =>
      faces ? {...trace, ...geometry.vertices, ...geometry[faces]} : trace);
    await page.draw(element, data, scene.layout, page.options);
  }
  page.root.dataset.ready = '';
})().catch(error => page.failed('page', error));
