// Each canvas names its drawing.

const FIGURES = {
  timeline: drawTimeline,
  offsets: drawOffsets,
  histogram: drawHistogram,
  checks: drawChecks,
  position: drawPosition,
  waterfall: (canvas) => new Waterfall(canvas, document.querySelector('canvas[data-figure=epoch]')),
  epoch: () => {}, // drawn by the waterfall
};

for (const canvas of document.querySelectorAll('canvas[data-figure]')) FIGURES[canvas.dataset.figure](canvas);

function redraw() {
  for (const one of drawings) one.redraw();
}

redraw();
let width = document.documentElement.clientWidth;
window.addEventListener('resize', () => {
  if (width === document.documentElement.clientWidth) return; // only the height changed, as when a phone hides the bars of its browser
  width = document.documentElement.clientWidth;
  redraw();
});
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
