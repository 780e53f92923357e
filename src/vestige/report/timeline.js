// Lanes against time: verdicts, and the ratio of the statistic of each check to its threshold.

function laneFrame(context, width, height, lanes, tall) {
  const x = timeAxis();
  const toX = (value) => ((value - x.low) / (x.high - x.low || 1)) * (width - 2) + 1;
  context.textBaseline = 'alphabetic';
  context.textAlign = 'left';
  lanes.forEach((lane, place) => {
    context.fillStyle = colour('ink');
    context.fillText(lane.name, 1, place * tall + 13);
    context.strokeStyle = colour('line');
    context.lineWidth = 1;
    line(context, [[0, (place + 1) * tall - 2.5], [width, (place + 1) * tall - 2.5]]);
  });
  context.fillStyle = colour('soft');
  context.textAlign = 'center';
  context.textBaseline = 'top';
  const bottom = lanes.length * tall;
  for (const value of ticks(x.low, x.high, width / 80)) {
    const half = context.measureText(plain(value)).width / 2;
    context.fillText(plain(value), Math.min(Math.max(toX(value), half), width - half), bottom + 2);
  }
  context.fillText(x.label, width / 2, bottom + 17);
  return toX;
}

function drawTimeline(canvas) {
  const satellites = DATA.satellites.map((one) => ({
    name: one.name, bits: unpacked(one.statuses), begin: unpacked(one.stretches.begin), end: unpacked(one.stretches.end),
  }));
  const single = satellites.length === 1;
  const lanes = single ? DATA.statuses.map((name, place) => ({ name, place, of: satellites[0] })) : satellites.map((of) => ({ name: of.name, of }));
  const tall = single ? 34 : 32;
  drawing(canvas, lanes.length * tall + 34, (context, width, height) => {
    const toX = laneFrame(context, width, height, lanes, tall);
    lanes.forEach((lane, row) => {
      const base = (row + 1) * tall - 3;
      for (let i = 0; i < lane.of.bits.length; i += 1) {
        const places = single ? [lane.place] : DATA.gravity;
        for (const place of places) {
          if (!(lane.of.bits[i] & (1 << place))) continue;
          const alarm = DATA.alarms.includes(place);
          const high = single || alarm ? 14 : 6;
          context.fillStyle = colour(DATA.statuses[place]);
          const from = Math.floor(toX(lane.of.begin[i]));
          context.fillRect(from, base - high, Math.max(Math.ceil(toX(lane.of.end[i])) - from, 1), high);
        }
      }
    });
  });
}

const CAP = 1.5; // largest ratio of the axis; larger ratios are drawn at this height

function drawChecks(canvas) {
  const begin = unpacked(DATA.checks.stretches.begin);
  const end = unpacked(DATA.checks.stretches.end);
  const lanes = DATA.checks.lanes.map((lane) => ({ name: lane.name, ratio: unpacked(lane.ratio) }));
  const tall = 58;
  drawing(canvas, lanes.length * tall + 34, (context, width, height) => {
    const toX = laneFrame(context, width, height, lanes, tall);
    lanes.forEach((lane, row) => {
      const base = (row + 1) * tall - 3;
      const toY = (ratio) => base - (Math.min(ratio, CAP) / CAP) * (tall - 22);
      context.strokeStyle = colour('limit');
      context.setLineDash([3, 3]);
      line(context, [[0, toY(1)], [width, toY(1)]]);
      context.setLineDash([]);
      let alarms = 0;
      lane.ratio.forEach((ratio, i) => {
        if (!Number.isFinite(ratio)) return;
        const [from, to] = [toX(begin[i]), toX(end[i])];
        alarms += ratio > 1;
        context.fillStyle = colour(ratio > 1 ? 'alarm' : 'run');
        context.fillRect(from, toY(ratio), Math.max(to - from, 0.8), base - toY(ratio));
        if (ratio > 1) context.fillRect((from + to) / 2 - 1.5, base - tall + 19, 3, 5);
      });
      context.fillStyle = colour('soft');
      context.textAlign = 'right';
      context.textBaseline = 'alphabetic';
      context.fillText(alarms ? `above its threshold in ${alarms} of ${lane.ratio.length} marks` : 'below its threshold', width - 1, row * tall + 13);
    });
  });
}
