"use strict";
// Draws the page's figures with uPlot from the descriptions in the page's data.
const muslip = {};

muslip.data = (id) => {
  const element = document.getElementById(id);
  return element === null ? null : JSON.parse(element.textContent);
};

muslip.Figure = (() => {
  const root = getComputedStyle(document.documentElement);
  const ink = (name) => root.getPropertyValue(`--${name}`).trim();
  /** An ink given as #rrggbb, made see-through. */
  const tint = (name, alpha) => {
    const code = parseInt(ink(name).slice(1), 16);
    return `rgba(${code >> 16}, ${(code >> 8) & 255}, ${code & 255}, ${alpha})`;
  };
  /** An empty path that uPlot strokes and fills in turn. */
  const traced = (draw, parts) => {
    const path = new Path2D();
    draw(path);
    return { stroke: parts.stroke ? path : null, fill: parts.fill ? path : null, clip: null, flags: 3 };
  };
  const polyline = (u, path, xs, ys) => {
    let pen = false;
    for (let i = 0; i < xs.length; i++) {
      const x = u.valToPos(xs[i], "x", true);
      const y = u.valToPos(ys[i], "y", true);
      const sound = xs[i] !== null && ys[i] !== null && Number.isFinite(x) && Number.isFinite(y);
      if (sound) pen ? path.lineTo(x, y) : path.moveTo(x, y);
      pen = sound;
    }
  };
  /** More points than these are painted as squares, in which a browser does not lag. */
  const MANY = 5000;
  const circles = (u, path, xs, ys, radius) => {
    const size = radius * devicePixelRatio;
    const isMany = xs.length > MANY;
    for (let i = 0; i < xs.length; i++) {
      const x = u.valToPos(xs[i], "x", true);
      const y = u.valToPos(ys[i], "y", true);
      if (xs[i] === null || ys[i] === null || !Number.isFinite(x + y)) continue;
      if (isMany) {
        path.rect(x - size / 2, y - size / 2, size, size);
        continue;
      }
      path.moveTo(x + size, y);
      path.arc(x, y, size, 0, 2 * Math.PI);
    }
  };
  /** The colour of a cell's value: second ink below nought, estimate's above, paper at nought. */
  const cellColour = (value, limit) => tint(value < 0 ? "second" : "estimate", Math.min(1, Math.abs(value) / limit));
  const cells = (u, layer) => {
    const { ctx } = u;
    const { left, top, width, height } = u.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    layer.value.forEach((value, index) => {
      if (value === null) return;
      const column = index % (layer.x.length - 1);
      const row = Math.floor(index / (layer.x.length - 1));
      const x0 = u.valToPos(layer.x[column], "x", true);
      const x1 = u.valToPos(layer.x[column + 1], "x", true);
      const y0 = u.valToPos(layer.y[row], "y", true);
      const y1 = u.valToPos(layer.y[row + 1], "y", true);
      ctx.fillStyle = cellColour(value, layer.limit);
      ctx.fillRect(x0, y1, x1 - x0, y0 - y1);
      ctx.strokeStyle = ink("grid");
      ctx.lineWidth = devicePixelRatio;
      ctx.strokeRect(x0, y1, x1 - x0, y0 - y1);
    });
    ctx.restore();
  };
  const radius = (layer) => (layer.x.length > 200 ? 2 : 3);

  /** How each shape becomes a series of uPlot: its looks, its data, its path. */
  const shapes = {
    points: {
      look: (l) => ({ width: 0, fill: () => tint(l.ink, l.x.length > 200 ? 0.55 : 0.85) }),
      path: (u, l) => traced((path) => circles(u, path, l.x, l.y, radius(l)), { fill: true }),
    },
    line: {
      look: (l) => ({ width: 2, stroke: () => ink(l.ink) }),
      path: (u, l) => traced((path) => polyline(u, path, l.x, l.y), { stroke: true }),
    },
    dashes: {
      look: (l) => ({ width: 2, stroke: () => ink(l.ink), dash: [7, 5] }),
      path: (u, l) => traced((path) => polyline(u, path, l.x, l.y), { stroke: true }),
    },
    level: {
      look: (l) => ({ width: 1.5, stroke: () => ink(l.ink), dash: [7, 5] }),
      path: (u, l) => {
        const { min, max } = u.scales.x;
        return traced((path) => polyline(u, path, [min, max], [l.y[0], l.y[0]]), { stroke: true });
      },
    },
    band: {
      look: (l) => ({ width: 0, fill: () => tint(l.ink, 0.2) }),
      path: (u, l) => traced((path) => {
        const kept = l.x.map((_, i) => i).filter((i) => l.low[i] !== null && l.high[i] !== null);
        const back = [...kept].reverse();
        polyline(u, path, [...kept, ...back].map((i) => l.x[i]),
          [...kept.map((i) => l.low[i]), ...back.map((i) => l.high[i])]);
        path.closePath();
      }, { fill: true }),
    },
    outline: {
      look: (l) => ({ width: 1.5, stroke: () => ink(l.ink), fill: () => tint(l.ink, 0.18) }),
      path: (u, l) => traced((path) => polyline(u, path, l.x, l.y), { stroke: true, fill: true }),
    },
    marker: {
      look: (l) => ({ width: 2, stroke: () => ink(l.ink), fill: () => ink("paper") }),
      path: (u, l) => traced((path) => circles(u, path, l.x, l.y, 5), { stroke: true, fill: true }),
    },
    cells: {
      look: () => ({ width: 0 }),
      path: (u, l) => { cells(u, l); return null; },
    },
  };

  /** A number as a tick shows it, with the minus sign of print. */
  const number = (value, decimals) => value.toFixed(decimals).replace("-", "\u2212");
  const linearLabels = (u, splits) => {
    const step = splits.length > 1 ? Math.abs(splits[1] - splits[0]) : 1;
    // As many as the step itself has: 0.25 has two.
    let decimals = 0;
    while (decimals < 9 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6 * step * 10 ** decimals) decimals += 1;
    return splits.map((value) => (Math.abs(value) >= 1e6 ? value.toExponential() : number(value, decimals)));
  };
  const logSplits = (u, axis, min, max) => {
    const [low, high] = [Math.floor(Math.log10(min)), Math.ceil(Math.log10(max))];
    const multiples = high - low < 3 ? [1, 2, 5] : [1];
    const splits = [];
    for (let decade = low; decade <= high; decade++) {
      for (const multiple of multiples) splits.push(multiple * 10 ** decade);
    }
    return splits.filter((value) => value >= min * 0.999 && value <= max * 1.001);
  };
  const SUPERSCRIPTS = { "-": "\u207b", 0: "\u2070", 1: "\u00b9", 2: "\u00b2", 3: "\u00b3", 4: "\u2074", 5: "\u2075", 6: "\u2076", 7: "\u2077", 8: "\u2078", 9: "\u2079" };
  const power = (exponent) => `10${String(exponent).replace(/./g, (letter) => SUPERSCRIPTS[letter])}`;
  const logLabels = (u, splits) => {
    // Short numbers as they are; where there are others, every power of ten is one.
    const short = splits.every((v) => v >= 9e-4 && v < 2e5);
    return splits.map((v) => {
      const exponent = Math.round(Math.log10(v));
      return short || Math.abs(v / 10 ** exponent - 1) > 1e-9 ? String(Number(v.toPrecision(3))) : power(exponent);
    });
  };

  const FONT = "12px system-ui, -apple-system, \"Segoe UI\", Roboto, \"DejaVu Sans\", sans-serif";
  const scale = (axis) => ({
    time: false,
    auto: false,
    distr: axis.log ? 3 : 1,
    min: axis.low,
    max: axis.high,
    range: (u, min, max) => [min ?? axis.low, max ?? axis.high],
  });
  const axisLook = (axis, upright) => ({
    stroke: () => ink("muted"),
    font: FONT,
    grid: { stroke: () => ink("grid"), width: 1 },
    ticks: { stroke: () => ink("frame"), width: 1, size: 4 },
    border: { show: true, stroke: () => ink("frame"), width: 1 },
    gap: 4,
    size: upright ? (u, labels) => 14 + 7.2 * Math.max(1, ...(labels ?? []).map((label) => label.length)) : 26,
    space: upright ? 34 : 72,
    values: axis.log ? logLabels : linearLabels,
    ...(axis.log ? { splits: logSplits, filter: (u, splits) => splits } : {}),
  });

  class Figure {
    constructor(element, spec) {
      this.element = element;
      this.spec = spec;
      this.place = element.querySelector(".canvas");
      this.readout = element.querySelector(".readout");
      this.plot = new uPlot(this.options(), this.series(), this.place);
      this.observe();
      const details = element.querySelector("details.data");
      details?.addEventListener("toggle", () => details.open && this.tables(details.querySelector("div")));
    }
    size() {
      const width = Math.max(240, this.place.clientWidth);
      return { width, height: Math.round(Math.min(380, Math.max(230, 0.56 * width))) };
    }
    options() {
      const { x, y, layers } = this.spec;
      const facets = [{ scale: "x", auto: false }, { scale: "y", auto: false }];
      return {
        ...this.size(),
        mode: 2,
        legend: { show: false },
        padding: [8, 20, 0, 0],
        scales: { x: scale(x), y: scale(y) },
        axes: [axisLook(x, false), axisLook(y, true)],
        series: [{}, ...layers.map((layer) => ({
          facets,
          points: { show: false },
          ...shapes[layer.shape].look(layer),
          paths: (u) => shapes[layer.shape].path(u, layer),
        }))],
        cursor: {
          points: { show: false },
          dataIdx: () => null,
          drag: { x: true, y: true, uni: 20 },
          bind: { dblclick: () => () => { this.whole(); } },
        },
        hooks: { draw: [(u) => this.captions(u)], setCursor: [(u) => this.tell(u)] },
      };
    }
    series() {
      return [null, ...this.spec.layers.map((layer) => (layer.shape === "cells" ? [[0], [0]] : [layer.x, layer.y ?? layer.low]))];
    }
    /** Shows the whole range again. */
    whole() {
      this.plot.batch(() => {
        for (const [key, axis] of [["x", this.spec.x], ["y", this.spec.y]]) {
          this.plot.setScale(key, { min: axis.low, max: axis.high });
        }
      });
    }
    captions(u) {
      const { ctx } = u;
      const dot = 6 * devicePixelRatio;
      const markers = this.spec.layers.filter((l) => l.shape === "marker").map((layer) => {
        const [x, y] = [u.valToPos(layer.x[0], "x", true), u.valToPos(layer.y[0], "y", true)];
        return { layer, x, y, from: x - dot, to: x + dot, top: y - dot, bottom: y + dot };
      });
      const taken = [...markers];
      for (const { layer, x, y } of markers.filter((marker) => marker.layer.caption)) {
        const right = x < u.bbox.left + 0.6 * u.bbox.width;
        ctx.font = FONT.replace("12px", `${12 * devicePixelRatio}px`);
        ctx.fillStyle = ink(layer.ink);
        ctx.textAlign = right ? "left" : "right";
        ctx.textBaseline = "bottom";
        const width = ctx.measureText(layer.caption).width;
        const from = x + (right ? 9 * devicePixelRatio : -9 * devicePixelRatio - width);
        const box = { from, to: from + width, bottom: y - 5 * devicePixelRatio, top: y - 19 * devicePixelRatio };
        // A caption that would lie over a marker or another caption is left to the table.
        if (taken.some((other) => box.from < other.to && other.from < box.to && box.top < other.bottom && other.top < box.bottom)) continue;
        taken.push(box);
        ctx.fillText(layer.caption, x + (right ? 9 : -9) * devicePixelRatio, y - 5 * devicePixelRatio);
      }
    }
    tell(u) {
      const { left, top } = u.cursor;
      const [x, y] = [u.posToVal(left, "x"), u.posToVal(top, "y")];
      const inside = left >= 0 && top >= 0;
      this.readout.textContent = inside ? `${x.toPrecision(4)}, ${y.toPrecision(4)}` : "";
    }
    observe() {
      let width = this.place.clientWidth;
      new ResizeObserver(() => {
        if (this.place.clientWidth === width) return;
        width = this.place.clientWidth;
        this.plot.setSize(this.size());
      }).observe(this.place);
    }
    /** Replaces the data of layers: a map from a layer's live name to what changes in it. */
    update(changes) {
      let touched = false;
      for (const layer of this.spec.layers) {
        const change = layer.live && changes[layer.live];
        if (!change) continue;
        Object.assign(layer, change);
        touched = true;
      }
      if (!touched) return;
      this.plot.setData(this.series(), false);
      this.plot.redraw();
      const data = this.element.querySelector("details.data[open] div");
      if (data) this.tables(data);
    }
    zoom(x, y) {
      Object.assign(this.spec.x, { low: x[0], high: x[1] });
      Object.assign(this.spec.y, { low: y[0], high: y[1] });
      this.whole();
    }
    redraw() {
      this.plot.redraw(true, true);
    }
    /** The data behind the plot. */
    tables(place) {
      place.replaceChildren(...this.spec.layers.filter((layer) => layer.shape !== "level" || layer.label).map((layer) => {
        const [head, rows] = muslip.rows(this.spec, layer);
        return muslip.table(layer.label || layer.caption || "reference", head, rows);
      }));
    }
  }
  return Figure;
})();

/** Head and rows of a layer as numbers. */
muslip.rows = ({ x, y }, layer) => {
  if (layer.shape === "cells") {
    const columns = layer.x.length - 1;
    return [
      [`${x.label} from`, "to", `${y.label} from`, "to", layer.label],
      layer.value.flatMap((value, i) => (value === null ? [] : [[
        layer.x[i % columns], layer.x[(i % columns) + 1],
        layer.y[Math.floor(i / columns)], layer.y[Math.floor(i / columns) + 1], value,
      ]])),
    ];
  }
  if (layer.shape === "band") {
    return [[x.label, `${y.label}, low`, `${y.label}, high`], Array.from(layer.x, (at, i) => [at, layer.low[i], layer.high[i]])];
  }
  if (layer.shape === "level") return [[y.label], [[layer.y[0]]]];
  return [[x.label, y.label], Array.from(layer.x, (at, i) => [at, layer.y[i]])];
};

/** A table element; at most 1,000 rows, evenly chosen. */
muslip.table = (name, head, rows) => {
  const MOST = 1000;
  const stride = Math.max(1, Math.ceil(rows.length / MOST));
  const cell = (kind, value) => {
    const element = document.createElement(kind);
    const text = typeof value === "number" ? String(Number(value.toPrecision(6))) : (value ?? "");
    element.textContent = String(text).replace("-", "\u2212");
    if (kind === "th") element.scope = "col";
    return element;
  };
  const line = (kind, values) => {
    const row = document.createElement("tr");
    row.append(...values.map((value) => cell(kind, value)));
    return row;
  };
  const table = document.createElement("table");
  const shown = rows.filter((_, index) => index % stride === 0);
  table.createCaption().textContent = stride > 1 ? `${name} (every ${stride}th of ${rows.length} rows)` : name;
  table.createTHead().append(line("th", head));
  table.createTBody().append(...shown.map((row) => line("td", row)));
  return table;
};

muslip.figures = new Map();
for (const spec of muslip.data("figures") ?? []) {
  const element = document.getElementById(spec.id);
  muslip.figures.set(spec.id, new muslip.Figure(element, spec));
}
muslip.redraw = () => muslip.figures.forEach((figure) => figure.redraw());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", muslip.redraw);
// Paper is white, whatever the screen is.
for (const [event, on] of [["beforeprint", true], ["afterprint", false]]) {
  addEventListener(event, () => {
    document.documentElement.classList.toggle("print", on);
    muslip.redraw();
  });
}
