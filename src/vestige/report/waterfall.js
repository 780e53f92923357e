// The correlators: all epochs as a map, and a chosen epoch as a curve.
// The slider, the pointer or the keys choose the epoch.

class Waterfall {
  constructor(map, curve) {
    this.slider = document.getElementById('epoch');
    this.readout = document.getElementById('readout');
    this.choice = document.getElementById('satellite');
    this.loaded = new Map();
    this.load(0);
    this.map = drawing(map, (width) => (width < 500 ? 240 : 300), (...where) => this.drawMap(...where));
    this.curve = drawing(curve, (width) => (width < 500 ? 260 : 300), (...where) => this.drawCurve(...where));
    this.slider.addEventListener('input', () => this.show());
    this.choice?.addEventListener('change', () => {
      const time = this.of.time[this.row];
      this.load(Number(this.choice.value));
      this.slider.value = this.nearest(time);
      this.show();
    });
    document.getElementById('alarm-before').addEventListener('click', () => this.step(-1));
    document.getElementById('alarm-after').addEventListener('click', () => this.step(1));
    const drag = (event) => {
      const { box, low, high } = this.place;
      const share = (event.offsetX - box.left) / (box.right - box.left);
      this.slider.value = this.nearest(low + Math.min(Math.max(share, 0), 1) * (high - low));
      this.show();
    };
    map.addEventListener('pointerdown', (event) => {
      map.setPointerCapture(event.pointerId);
      drag(event);
    });
    map.addEventListener('pointermove', (event) => map.hasPointerCapture(event.pointerId) && drag(event));
    this.readoutOf();
  }

  get row() {
    return Number(this.slider.value);
  }

  load(place) {
    if (!this.loaded.has(place)) {
      const one = DATA.satellites[place];
      const each = (packed) => Object.fromEntries(Object.entries(packed).map(([name, values]) => [name, unpacked(values)]));
      this.loaded.set(place, {
        name: one.name,
        begin: unpacked(one.stretches.begin),
        end: unpacked(one.stretches.end),
        bits: unpacked(one.statuses),
        heat: rescaled(one.heat, DATA.top_sigma),
        time: unpacked(one.time_s),
        taps: rescaled(one.taps, DATA.top_sigma),
        status: unpacked(one.status),
        offset: each(one.offset_m),
        magnitude: each(one.magnitude),
        true: one.true_m ? unpacked(one.true_m) : null,
        spoofing_signals: (one.spoofing_signals || []).map((attack) => ({
          name: attack.name, place: unpacked(attack.place_m), power: unpacked(attack.power_db),
        })),
      });
    }
    this.of = this.loaded.get(place);
    this.slider.max = this.of.time.length - 1;
  }

  nearest(time) {
    const times = this.of.time;
    let [low, high] = [0, times.length - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low > 0 && time - times[low - 1] < times[low] - time ? low - 1 : low;
  }

  isAlarm(row) {
    return DATA.alarms.includes(this.of.status[row]);
  }

  step(way) {
    for (let row = this.row + way; row >= 0 && row < this.of.time.length; row += way) {
      if (this.isAlarm(row)) {
        this.slider.value = row;
        this.show();
        return;
      }
    }
  }

  show() {
    this.readoutOf();
    this.map.redraw();
    this.curve.redraw();
  }

  readoutOf() {
    const { of, row } = this;
    const found = DATA.detectors.map((name) => {
      const offset = of.offset[name][row];
      return Number.isFinite(offset) ? `${name} ${signed(offset)} m at ${of.magnitude[name][row].toFixed(1)} σ` : `${name}: nothing`;
    });
    const attack = of.spoofing_signals.filter((one) => Number.isFinite(one.power[row])).map((one) => `${one.name} ${signed(one.power[row])} dB`);
    const text = [`${of.name}, T = ${plain(of.time[row])} s: ${DATA.statuses[of.status[row]]}`, ...found, ...attack].join(' · ');
    this.readout.textContent = text;
    this.slider.setAttribute('aria-valuetext', text);
  }

  drawMap(context, width, height) {
    const offsets = DATA.offsets_m;
    const half = (offsets[1] - offsets[0]) / 2;
    const x = timeAxis();
    const y = { low: offsets[0] - half, high: offsets.at(-1) + half, label: 'correlator offset (m)' };
    const { box, toX, toY } = frame(context, width, height, x, y);
    this.place = { box, low: x.low, high: x.high };
    const { of } = this;
    inside(context, box, () => {
      for (let i = 0; i < of.begin.length; i += 1) {
        const from = Math.floor(toX(of.begin[i]));
        const wide = Math.max(1, Math.ceil(toX(of.end[i])) - from);
        for (let tap = 0; tap < offsets.length; tap += 1) {
          const magnitude = of.heat[i * offsets.length + tap];
          if (Number.isNaN(magnitude)) continue;
          context.fillStyle = cividis(magnitude / DATA.top_sigma);
          const top = Math.floor(toY(offsets[tap] + half));
          context.fillRect(from, top, wide, Math.ceil(toY(offsets[tap] - half)) - top);
        }
      }
    });
    context.fillStyle = colour('alarm');
    const alarms = DATA.alarms.reduce((bits, place) => bits | (1 << place), 0);
    of.bits.forEach((bits, i) => {
      if (bits & alarms) context.fillRect((toX(of.begin[i]) + toX(of.end[i])) / 2 - 0.75, 0, 1.5, 8);
    });
    const at = toX(of.time[this.row]);
    for (const [ink, wide] of [[colour('paper'), 4], ['#e6007e', 2]]) {
      context.strokeStyle = ink;
      context.lineWidth = wide;
      line(context, [[at, box.top - 4], [at, box.bottom + 4]]);
    }
  }

  drawCurve(context, width, height) {
    const { of, row } = this;
    const offsets = DATA.offsets_m;
    const half = (offsets[1] - offsets[0]) / 2;
    const x = { low: offsets[0] - half, high: offsets.at(-1) + half, label: 'correlator offset (m)' };
    const y = { low: 0, high: DATA.top_sigma * 1.12, label: 'magnitude (σ)' };
    const { box, toX, toY } = frame(context, width, height, x, y);
    const upright = (at, name, text) => {
      if (!Number.isFinite(at) || at < x.low || at > x.high) return;
      context.strokeStyle = colour(name);
      context.fillStyle = colour(name);
      context.lineWidth = 2;
      const beside = name === 'true' ? box.top : box.top + 14;
      line(context, [[toX(at), box.bottom], [toX(at), beside + 15]]);
      const wide = context.measureText(text).width / 2;
      context.textAlign = 'center';
      context.textBaseline = 'top';
      context.fillText(text, Math.min(Math.max(toX(at), box.left + wide), box.right - wide), beside);
    };
    for (const attack of of.spoofing_signals) upright(attack.place[row], 'spoofer', attack.name);
    if (of.true) upright(of.true[row], 'true', 'true signal');
    context.strokeStyle = colour('limit');
    context.lineWidth = 1.5;
    context.setLineDash([6, 4]);
    line(context, [[box.left, toY(DATA.threshold_sigma)], [box.right, toY(DATA.threshold_sigma)]]);
    context.setLineDash([]);
    const points = offsets.map((offset, tap) => [toX(offset), toY(of.taps[row * offsets.length + tap])]);
    context.strokeStyle = colour('ink');
    context.fillStyle = colour('ink');
    context.lineWidth = 2;
    const known = points.filter(([, at]) => Number.isFinite(at));
    line(context, known);
    for (const [atX, atY] of known) {
      context.beginPath();
      context.arc(atX, atY, 3.2, 0, 2 * Math.PI);
      context.fill();
    }
    DATA.detectors.forEach((name, place) => {
      const offset = of.offset[name][row];
      if (!Number.isFinite(offset)) return;
      const [atX, atY, way] = [toX(offset), toY(of.magnitude[name][row]), place ? 1 : -1];
      context.fillStyle = colour(name);
      context.beginPath();
      context.moveTo(atX, atY + way * 6);
      context.lineTo(atX - 7, atY + way * 18);
      context.lineTo(atX + 7, atY + way * 18);
      context.fill();
      context.textAlign = 'center';
      context.textBaseline = 'middle';
      context.fillText(name, atX, atY + way * 26);
    });
    if (!known.length) {
      context.textAlign = 'center';
      context.fillStyle = colour('soft');
      context.fillText('nothing was correlated', (box.left + box.right) / 2, (box.top + box.bottom) / 2);
    }
  }
}
