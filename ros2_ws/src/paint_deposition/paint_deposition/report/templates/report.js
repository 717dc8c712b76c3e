'use strict';
// Tables that sort, and sections that unfold.
(() => {
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
  document.documentElement.dataset.ready = '';
})();
