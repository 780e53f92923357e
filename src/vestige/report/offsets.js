// Range offsets of both detectors, against time and as a histogram, and the error of the position fixes.

const hidden = new Set();

function spread(arrays) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of arrays) {
    for (const value of values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [-1, 1];
}

function drawOffsets(canvas) {
  const satellites = DATA.satellites.map((one) => ({
    time: unpacked(one.time_s),
    status: unpacked(one.status),
    offset: Object.fromEntries(DATA.detectors.map((name) => [name, unpacked(one.offset_m[name])])),
    spoofing_signals: (one.spoofing_signals || []).map((attack) => unpacked(attack.place_m)),
  }));
  const [first, last] = [DATA.offsets_m[0], DATA.offsets_m.at(-1)];
  const near = satellites.flatMap((one) => one.spoofing_signals).map((place) => place.filter((at) => at >= first && at <= last));
  const [low, high] = spread([[DATA.limit_m, -DATA.limit_m], ...near, ...satellites.flatMap((one) => Object.values(one.offset))]);
  const margin = 0.06 * (high - low);
  const y = { low: low - 2 * margin, high: high + margin, label: 'range offset (m)' };
  const sizes = [2, 4]; // the second detector is drawn first, larger and fainter: neither hides the other
  const one = drawing(canvas, (width) => (width < 500 ? 260 : 340), (context, width, height) => {
    const { box, toX, toY } = frame(context, width, height, timeAxis(), y);
    context.strokeStyle = colour('limit');
    context.lineWidth = 1.2;
    context.setLineDash([6, 4]);
    for (const limit of [DATA.limit_m, -DATA.limit_m]) line(context, [[box.left, toY(limit)], [box.right, toY(limit)]]);
    context.setLineDash([]);
    inside(context, box, () => {
      context.strokeStyle = colour('spoofer');
      context.lineWidth = 1;
      for (const satellite of satellites) {
        for (const place of satellite.spoofing_signals) {
          const points = [];
          place.forEach((at, i) => Number.isFinite(at) && points.push([toX(satellite.time[i]), toY(at)]));
          if (points.length) line(context, points);
        }
      }
      DATA.detectors.map((name, place) => [name, sizes[place % 2]]).reverse().forEach(([name, size]) => {
        if (hidden.has(name)) return;
        context.fillStyle = colour(name);
        context.globalAlpha = size > 2 ? 0.55 : 1;
        for (const satellite of satellites) {
          satellite.offset[name].forEach((offset, i) => {
            if (Number.isFinite(offset)) context.fillRect(toX(satellite.time[i]) - size / 2, toY(offset) - size / 2, size, size);
          });
        }
      });
      context.globalAlpha = 1;
      context.fillStyle = colour('not detected');
      const missed = DATA.statuses.indexOf('not detected');
      for (const satellite of satellites) {
        satellite.status.forEach((status, i) => {
          if (status === missed) context.fillRect(toX(satellite.time[i]) - 0.75, box.bottom - 10, 1.5, 10);
        });
      }
    });
  });
  document.querySelectorAll('input[data-detector]').forEach((box) => {
    box.addEventListener('change', () => {
      if (box.checked) hidden.delete(box.dataset.detector);
      else hidden.add(box.dataset.detector);
      one.redraw();
      drawings.find((other) => other.canvas.dataset.figure === 'histogram')?.redraw();
    });
  });
}

function drawHistogram(canvas) {
  const { edges_m: edges, counts } = DATA.histogram;
  const largest = Math.max(...Object.values(counts).flat());
  const powers = Math.max(1, Math.ceil(Math.log10(largest)));
  const y = {
    low: -0.3, high: powers, label: 'epochs', ticks: Array.from({ length: powers + 1 }, (_, i) => i),
    text: (power) => (power < 5 ? String(10 ** power) : `1e${power}`),
  };
  drawing(canvas, (width) => (width < 500 ? 220 : 260), (context, width, height) => {
    const { box, toX, toY } = frame(context, width, height, { low: edges[0], high: edges.at(-1), label: 'range offset (m)' }, y, 52);
    DATA.detectors.slice().reverse().forEach((name, place) => {
      if (hidden.has(name)) return;
      const points = [[toX(edges[0]), box.bottom]];
      counts[name].forEach((count, i) => {
        const at = count ? toY(Math.log10(count)) : box.bottom;
        points.push([toX(edges[i]), at], [toX(edges[i + 1]), at]);
      });
      points.push([toX(edges.at(-1)), box.bottom]);
      context.strokeStyle = colour(name);
      context.lineWidth = place ? 1.5 : 3;
      line(context, points);
    });
  });
}

function drawPosition(canvas) {
  const { axes, fixes } = DATA.position;
  const loaded = Object.values(fixes).map((fix) => ({ time: unpacked(fix.time_s), error: fix.error_m.map(unpacked) }));
  const panel = 150;
  drawing(canvas, axes.length * panel, (context, width) => {
    axes.forEach((axis, place) => {
      context.save();
      context.translate(0, place * panel);
      const [low, high] = spread(loaded.map((fix) => fix.error[place]));
      const margin = 0.08 * (high - low);
      const y = { low: low - margin, high: high + margin, label: `${axis} (m)` };
      const { box, toX, toY } = frame(context, width, panel, { ...timeAxis(), label: place + 1 === axes.length ? 'time (s)' : '' }, y);
      inside(context, box, () => loaded.forEach((fix, which) => {
        context.fillStyle = colour(which ? 'early' : 'run');
        const size = which ? 4 : 2;
        fix.error[place].forEach((error, i) => context.fillRect(toX(fix.time[i]) - size / 2, toY(error) - size / 2, size, size));
      }));
      context.restore();
    });
  });
}
