"""Look and behaviour of a report's page: a style sheet and a few lines of script, both inline."""

from __future__ import annotations

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #59626d; --paper: #ffffff;
  --back: #f4f6f8; --line: #d5d9de; --link: #0b5cad; --good: #0a6e4f; --bad: #b23a06;
  --warn: #7a5600; --good-back: #e3f4ee; --bad-back: #fbe9e1; --warn-back: #fbf1d8; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --soft: #a3acb8; --paper: #16191d;
  --back: #0e1013; --line: #343b44; --link: #7fb8f0; --good: #5fd1aa; --bad: #ff9a6b;
  --warn: #f0c75e; --good-back: #12291f; --bad-back: #33190d; --warn-back: #2e2509; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
main { max-width: 1360px; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: .4rem 0; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; }
h3 { font-size: 1.02rem; margin: 0 0 .2rem; }
p { margin: .3rem 0 .6rem; max-width: 80ch; }
a { color: var(--link); }
.soft, .note, figcaption { color: var(--soft); font-size: .87rem; }
.card { background: var(--paper); border: 1px solid var(--line); border-radius: 10px;
  padding: .9rem 1rem; margin: 0 0 1rem; min-width: 0; }
.verdict { border-left: 6px solid var(--line); margin: .5rem 0; padding: .55rem .8rem;
  border-radius: 6px; overflow-wrap: anywhere; max-width: none; }
.verdict.good { border-color: var(--good); background: var(--good-back); }
.verdict.bad { border-color: var(--bad); background: var(--bad-back); }
.verdict.warn { border-color: var(--warn); background: var(--warn-back); }
.badge { font-weight: 650; margin-right: .4em; }
.good .badge, td.good { color: var(--good); }
.bad .badge, td.bad { color: var(--bad); }
.warn .badge, td.warn { color: var(--warn); }
nav { display: flex; flex-wrap: wrap; gap: .2rem .9rem; margin: .8rem 0; font-size: .92rem; }
.charts { columns: 2 32rem; column-gap: 1rem; }
figure.card { break-inside: avoid; }
figure img { display: block; width: 100%; height: auto; }
.scroll { overflow: auto; max-height: 36rem; border: 1px solid var(--line); border-radius: 6px; }
table { border-collapse: separate; border-spacing: 0; font-size: .82rem; line-height: 1.3;
  font-variant-numeric: tabular-nums; width: 100%; }
th, td { padding: .28rem .55rem; text-align: right; border-bottom: 1px solid var(--line);
  white-space: nowrap; background: var(--paper); }
th { position: sticky; top: 0; z-index: 2; white-space: normal; vertical-align: bottom;
  background: var(--back); }
th.words, td.words { text-align: left; }
td.good, td.bad, td.warn { font-weight: 600; }
tbody tr:hover td { background: var(--back); }
th button { all: unset; cursor: pointer; font: inherit; font-weight: 650; }
th button:focus-visible, input:focus-visible, a:focus-visible, summary:focus-visible {
  outline: 2px solid var(--link); outline-offset: 2px; }
th[aria-sort="ascending"] button::after { content: " \\25B2"; }
th[aria-sort="descending"] button::after { content: " \\25BC"; }
.tools { display: flex; flex-wrap: wrap; gap: .5rem 1rem; align-items: center; margin: .5rem 0; }
input[type="search"] { font: inherit; font-size: .92rem; padding: .3rem .5rem; width: 20rem;
  max-width: 100%; border: 1px solid var(--line); border-radius: 6px; background: var(--paper);
  color: var(--ink); }
pre { overflow: auto; max-height: 24rem; font-size: .8rem; line-height: 1.4; margin: .4rem 0; }
summary { cursor: pointer; font-weight: 600; }
@media (max-width: 600px) { main { padding: .6rem; } .card { padding: .7rem; }
  h1 { font-size: 1.35rem; } th, td { padding: .25rem .4rem; }
  td.words { white-space: normal; }
  td:nth-child(2), th:nth-child(2) { position: sticky; left: 0; z-index: 1; min-width: 9rem;
    max-width: 10rem; border-right: 1px solid var(--line); } th:nth-child(2) { z-index: 3; } }
@media print { .scroll { max-height: none; overflow: visible; } .tools, nav { display: none; } }
"""

SCRIPT = """
'use strict';
const number = cell => cell.dataset.value === undefined ? NaN : Number(cell.dataset.value);
function order(a, b, k, up) {
  const x = number(a.cells[k]), y = number(b.cells[k]);
  if (isNaN(x) && isNaN(y) && a.cells[k].dataset.value === undefined)
    return up * a.cells[k].textContent.localeCompare(b.cells[k].textContent, 'en', {numeric: true});
  if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
  return x === y ? 0 : up * (x < y ? -1 : 1);
}
document.querySelectorAll('th button').forEach(button => button.addEventListener('click', () => {
  const head = button.parentElement, body = head.closest('table').tBodies[0];
  const up = head.ariaSort === 'ascending' ? -1 : 1;
  head.parentElement.querySelectorAll('th').forEach(other => other.removeAttribute('aria-sort'));
  head.ariaSort = up > 0 ? 'ascending' : 'descending';
  const rows = [...body.rows].sort((a, b) => order(a, b, head.cellIndex, up));
  body.append(...rows);
}));
const filter = document.getElementById('filter');
filter.addEventListener('input', () => {
  const wanted = filter.value.toLowerCase().split(/\\s+/);
  document.querySelectorAll('tbody tr').forEach(row => {
    const text = row.textContent.toLowerCase();
    row.hidden = !wanted.every(word => text.includes(word));
  });
});
"""

SWAP = """<style>:root { --ink: %(ink)s; --paper: #ffffff; --grid: %(grid)s; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e8eb; --paper: #16191d; --grid: #3a4048; } }</style>"""
"""What lets a drawing follow the reader's choice of light or dark."""
