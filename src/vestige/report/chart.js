// Common parts of all drawings: arrays from base64, a canvas as sharp as the screen, axes, colours of the theme.

const DATA = JSON.parse(document.getElementById('data').textContent);

const ARRAYS = {
  uint8: Uint8Array, uint16: Uint16Array, int8: Int8Array, float32: Float32Array, float64: Float64Array,
};

function unpacked(packed) {
  const text = atob(packed.base64);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  return new ARRAYS[packed.type](bytes.buffer);
}

// Values between 0 and top that were packed as whole numbers; the largest number is NaN.
function rescaled(packed, top) {
  const steps = unpacked(packed);
  const nothing = packed.type === 'uint8' ? 0xff : 0xffff;
  return Float32Array.from(steps, (step) => (step === nothing ? NaN : (step * top) / (nothing - 1)));
}

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name.replaceAll(' ', '-')}`).trim();
}

// Each drawing is a function of (context, width, height) in CSS pixels; it is called again when its width or the theme changes.
const drawings = [];

function drawing(canvas, height, draw) {
  const one = {
    canvas,
    redraw() {
      const width = canvas.clientWidth;
      const tall = typeof height === 'function' ? height(width) : height;
      const sharp = window.devicePixelRatio || 1;
      canvas.width = Math.max(1, Math.round(width * sharp));
      canvas.height = Math.round(tall * sharp);
      canvas.style.height = `${tall}px`;
      const context = canvas.getContext('2d');
      context.setTransform(sharp, 0, 0, sharp, 0, 0);
      context.clearRect(0, 0, width, tall);
      context.font = '12px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
      draw(context, width, tall);
    },
  };
  drawings.push(one);
  return one;
}

// About `count` round numbers between two limits.
function ticks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((candidate) => candidate >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k += 1) found.push(Number((k * step).toPrecision(12)));
  return found;
}

function signed(value, digits = 1) {
  if (!Number.isFinite(value)) return '–';
  return `${value < 0 ? '−' : '+'}${Math.abs(value).toFixed(digits)}`;
}

function plain(value) {
  return String(value).replace('-', '−');
}

// Draw a frame with axes: `x` and `y` are {low, high, label, ticks?, text?}. Return functions from values to pixels.
function frame(context, width, height, x, y, left = 46) {
  const box = { left, right: width - 8, top: 10, bottom: height - 34 };
  const toX = (value) => box.left + ((value - x.low) / (x.high - x.low || 1)) * (box.right - box.left);
  const toY = (value) => box.bottom - ((value - y.low) / (y.high - y.low || 1)) * (box.bottom - box.top);
  context.strokeStyle = colour('line');
  context.fillStyle = colour('soft');
  context.lineWidth = 1;
  context.textBaseline = 'middle';
  context.textAlign = 'right';
  for (const value of y.ticks || ticks(y.low, y.high, (box.bottom - box.top) / 45)) {
    line(context, [[box.left, toY(value)], [box.right, toY(value)]]);
    context.fillText(y.text ? y.text(value) : plain(value), box.left - 5, toY(value));
  }
  context.textAlign = 'center';
  context.textBaseline = 'top';
  for (const value of x.ticks || ticks(x.low, x.high, (box.right - box.left) / 70)) {
    line(context, [[toX(value), box.bottom], [toX(value), box.bottom + 4]]);
    context.fillText(plain(value), Math.min(toX(value), width - 8 - context.measureText(plain(value)).width / 2), box.bottom + 6);
  }
  context.fillText(x.label, (box.left + box.right) / 2, box.bottom + 20);
  context.save();
  context.translate(8, (box.top + box.bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.textBaseline = 'middle';
  context.fillText(y.label, 0, 0);
  context.restore();
  return { box, toX, toY };
}

function line(context, points) {
  context.beginPath();
  points.forEach(([x, y], place) => (place ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function inside(context, box, draw) {
  context.save();
  context.beginPath();
  context.rect(box.left, box.top - 1, box.right - box.left, box.bottom - box.top + 2);
  context.clip();
  draw();
  context.restore();
}

function timeAxis() {
  const [low, high] = DATA.span_s;
  return { low, high, label: 'time (s)' };
}

// Ten colours of cividis: even steps of brightness, which look the same with every kind of colour vision.
const CIVIDIS = [
  [0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105],
  [225, 204, 85], [254, 232, 56],
];

function cividis(share) {
  const place = Math.min(Math.max(share, 0), 1) * (CIVIDIS.length - 1);
  const [low, high] = [CIVIDIS[Math.floor(place)], CIVIDIS[Math.ceil(place)]];
  const mixed = low.map((part, i) => Math.round(part + (high[i] - part) * (place % 1)));
  return `rgb(${mixed.join(',')})`;
}
