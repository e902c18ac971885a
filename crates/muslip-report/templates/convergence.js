"use strict";
// Plays a filter's run frame by frame, and runs the filter again under other assumptions.
muslip.law = {
  /** mu(s) = 2 mup sp s / (sp² + s²), and its derivatives by mup and sp. */
  friction: (peak, critical, slip) => (2 * peak * critical * slip) / (critical * critical + slip * slip),
  gradient: (peak, critical, slip) => {
    const sum = critical * critical + slip * slip;
    return [(2 * critical * slip) / sum, (2 * peak * slip * (slip * slip - critical * critical)) / (sum * sum)];
  },
};

/** What a layer shows of a run, by its live name; `k` is the frame that is shown. */
muslip.live = (() => {
  const slips = (run) => Array.from({ length: 161 }, (_, i) => run.largestSlip * (i / 160) ** 2);
  const along = (run, of) => ({ x: run.frames.sample, y: of(run.frames) });
  const around = (run, value, std) => ({
    x: run.frames.sample,
    low: run.frames[value].map((v, i) => v - run.frames[std][i]),
    high: run.frames[value].map((v, i) => v + run.frames[std][i]),
  });
  const share = (values) => values.map((value) => (value / values[0]) ** 2);
  const sigma = (frames, k, slip) => {
    const [byPeak, bySlip] = muslip.law.gradient(frames.peak[k], frames.criticalSlip[k], slip);
    const [a, b] = [byPeak * frames.peakStd[k], bySlip * frames.criticalSlipStd[k]];
    return Math.sqrt(Math.max(0, a * a + 2 * frames.correlation[k] * a * b + b * b));
  };
  return {
    "measured": (run, k) => {
      const count = run.samples.filter((sample) => sample.number <= run.frames.sample[k]);
      return { x: count.map((sample) => sample.slip), y: count.map((sample) => sample.friction) };
    },
    "curve": (run, k) => {
      const x = slips(run);
      return { x, y: x.map((s) => muslip.law.friction(run.frames.peak[k], run.frames.criticalSlip[k], s)) };
    },
    "curve-band": (run, k) => {
      const x = slips(run);
      const y = x.map((s) => muslip.law.friction(run.frames.peak[k], run.frames.criticalSlip[k], s));
      const spread = x.map((s) => sigma(run.frames, k, s));
      return { x, low: y.map((v, i) => v - spread[i]), high: y.map((v, i) => v + spread[i]) };
    },
    "ellipse": (run, k) => {
      const { peak, peakStd, criticalSlip, criticalSlipStd, correlation } = run.frames;
      const rest = Math.sqrt(Math.max(0, 1 - correlation[k] ** 2));
      const angles = Array.from({ length: 121 }, (_, i) => (2 * Math.PI * i) / 120);
      return {
        x: angles.map((a) => criticalSlip[k] + criticalSlipStd[k] * Math.cos(a)),
        y: angles.map((a) => peak[k] + peakStd[k] * (correlation[k] * Math.cos(a) + rest * Math.sin(a))),
      };
    },
    "peak": (run, k) => ({ x: [run.frames.criticalSlip[k]], y: [run.frames.peak[k]] }),
    "way": (run, k) => ({ x: run.frames.criticalSlip.slice(0, k + 1), y: run.frames.peak.slice(0, k + 1) }),
    "peak-friction": (run) => along(run, (f) => f.peak),
    "peak-friction-band": (run) => around(run, "peak", "peakStd"),
    "critical-slip": (run) => along(run, (f) => f.criticalSlip),
    "critical-slip-band": (run) => around(run, "criticalSlip", "criticalSlipStd"),
    "innovation": (run) => along(run, (f) => f.innovation),
    "innovation-band": (run) => ({
      x: run.frames.sample,
      low: run.frames.innovationStd.map((std) => (std === null ? null : -2 * std)),
      high: run.frames.innovationStd.map((std) => (std === null ? null : 2 * std)),
    }),
    "nis": (run) => along(run, (f) => f.nis),
    "nis-mean": (run) => ({ x: [0], y: [run.meanNis] }),
    "peak-friction-variance": (run) => along(run, (f) => share(f.peakStd)),
    "critical-slip-variance": (run) => along(run, (f) => share(f.criticalSlipStd)),
    "correlation": (run) => along(run, (f) => f.correlation),
    "signal-before": (run) => along(run, (f) => f.before),
    "signal-after": (run) => along(run, (f) => f.after),
    "noise": (run) => along(run, (f) => f.noise),
  };
})();

/** A value with its sigma, with as many decimals as the latter justifies. */
muslip.plusMinus = (value, std) => {
  const decimals = std > 0 ? Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(2.5 * std)))) : 4;
  return `${value.toFixed(decimals)}\u00a0±\u00a0${std.toFixed(decimals)}`.replace("-", "\u2212");
};

/** A zoom that holds still while an ellipse shrinks to half its size: ends of an axis. What is true is in it, unless the ellipse would be a dot beside it. */
muslip.zoom = (centre, std, truth) => {
  const half = 2 ** Math.ceil(Math.log2(2.2 * Math.max(std, 1e-9)));
  const middle = Math.round(centre / (half / 2)) * (half / 2);
  const [low, high] = [middle - 1.3 * half, middle + 1.3 * half];
  if (truth === undefined || Math.abs(truth - centre) > 8 * half) return [low, high];
  return [Math.min(low, truth - 0.3 * half), Math.max(high, truth + 0.3 * half)];
};

muslip.Player = class {
  constructor(root, run) {
    this.root = root;
    this.ellipse = muslip.figures.get("player-ellipse");
    this.slider = root.querySelector(".position");
    this.playing = root.querySelector(".play");
    this.speed = root.querySelector(".speed");
    this.note = root.querySelector(".note");
    this.timer = null;
    this.show(run, run.frames.sample.length - 1);
    const go = (move) => () => { this.pause(); this.show(this.run, move(this.shown)); };
    this.playing.addEventListener("click", () => (this.timer === null ? this.play() : this.pause()));
    root.querySelector(".back").addEventListener("click", go((k) => k - 1));
    root.querySelector(".step").addEventListener("click", go((k) => k + 1));
    this.slider.addEventListener("input", go(() => Number(this.slider.value)));
  }
  get last() { return this.run.frames.sample.length - 1; }
  /** Shows a frame of a run; the whole run's plots are only drawn when the run is another one. */
  show(run, frame) {
    const another = run !== this.run;
    this.run = run;
    this.shown = Math.min(this.last, Math.max(0, frame));
    const moving = new Set(["measured", "curve", "curve-band", "ellipse", "peak", "way"]);
    const changes = {};
    for (const [name, of] of Object.entries(muslip.live)) {
      if (another || moving.has(name)) changes[name] = of(run, this.shown);
    }
    muslip.figures.forEach((figure) => figure.update(changes));
    const { peak, peakStd, criticalSlip, criticalSlipStd } = run.frames;
    const k = this.shown;
    const truth = this.ellipse.spec.layers.find((layer) => layer.ink === "truth");
    this.ellipse.zoom(
      muslip.zoom(criticalSlip[k], criticalSlipStd[k], truth?.x[0]),
      muslip.zoom(peak[k], peakStd[k], truth?.y[0]),
    );
    this.slider.max = this.last;
    this.slider.value = k;
    this.note.textContent = this.words(k);
    this.slider.setAttribute("aria-valuetext", this.note.textContent);
  }
  words(k) {
    const f = this.run.frames;
    const when = k === 0 ? "Before the first measurement" : `After measurement ${f.sample[k]} of ${f.sample[this.last]}`;
    const what = k === 0 ? "" : ` (${f.time[k] === null ? "" : `${f.time[k].toFixed(3)} s, `}slip ${f.slip[k].toFixed(3)}, `
      + `friction ${f.friction[k].toFixed(3)})`;
    return `${when}${what}: peak friction ${muslip.plusMinus(f.peak[k], f.peakStd[k])} at a slip of `
      + `${muslip.plusMinus(f.criticalSlip[k], f.criticalSlipStd[k])}, correlation ${f.correlation[k].toFixed(2)}.`
        .replace("-", "\u2212");
  }
  play() {
    if (this.shown === this.last) this.show(this.run, 0);
    this.playing.textContent = "Pause";
    const tick = () => {
      this.show(this.run, this.shown + 1);
      if (this.shown === this.last) this.pause();
      else this.timer = setTimeout(tick, this.pace());
    };
    this.timer = setTimeout(tick, this.pace());
  }
  /** Milliseconds a frame: a dozen seconds for a whole run, not faster than can be drawn. */
  pace() {
    return Math.max(25, Math.min(300, 12000 / this.last) / Number(this.speed.value));
  }
  pause() {
    clearTimeout(this.timer);
    this.timer = null;
    this.playing.textContent = "Play";
  }
};

/** Little-endian doubles out of base64. */
muslip.doubles = (text) => {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float64Array.from({ length: bytes.length / 8 }, (_, i) => view.getFloat64(8 * i, true));
};

muslip.convergence = (() => {
  const data = muslip.data("convergence");
  const [slip, friction, std] = ["slip", "friction", "std"].map((name) => muslip.doubles(data.samples[name]));
  const number = (index) => index * data.samples.stride + 1;
  // Few enough to be drawn for every frame.
  const stride = Math.max(1, Math.ceil(slip.length / 3000));
  const samples = [];
  for (let i = 0; i < slip.length; i += stride) {
    samples.push({ number: number(i), slip: slip[i], friction: friction[i] });
  }
  const host = { frames: data.frames, samples, largestSlip: data.largestSlip, meanNis: data.meanNis };
  return { data, host, number, measured: { slip, friction, std } };
})();
muslip.player = new muslip.Player(document.getElementById("player"), muslip.convergence.host);
