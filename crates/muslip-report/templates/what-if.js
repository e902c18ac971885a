"use strict";
// Runs the filter of the core crate, compiled to WebAssembly, under the reader's assumptions.
muslip.whatIf = (() => {
  const { data, host, number, measured } = muslip.convergence;
  const form = document.getElementById("what-if");
  const field = (name) => form.querySelector(`[name="${name}"]`);
  const shown = (name, text) => { document.getElementById(`${name}-shown`).textContent = text; };
  const bytes = Uint8Array.from(atob(document.getElementById("core").textContent), (letter) => letter.charCodeAt(0));
  const core = WebAssembly.instantiate(bytes, {}).then(({ instance }) => instance.exports);
  /** The columns of a frame that the core tells, in the order of its `value`. */
  const TOLD = ["peak", "peakStd", "criticalSlip", "criticalSlipStd", "correlation",
    "innovation", "innovationStd", "nis", "noise", "before", "after"];
  const ESTIMATE = 5;

  const asItWas = () => ({
    efficient: data.whatIf.efficient,
    noise: 1,
    peak: data.whatIf.peak,
    slip: data.whatIf.slip,
    spread: 1,
    pseudonoise: true,
  });
  const chosen = () => ({
    efficient: field("estimator").value === "1",
    noise: 10 ** Number(field("noise").value),
    peak: Number(field("peak").value),
    slip: Number(field("slip").value),
    spread: Number(field("spread").value),
    pseudonoise: field("pseudonoise").checked,
  });

  /** A run of the filter over the page's measurements; `null` where it does not take the start. */
  const run = (exports, assumed) => {
    const { peak, slip, spread } = assumed;
    if (exports.start(Number(assumed.efficient), peak, slip, spread * peak, spread * slip, Number(assumed.pseudonoise)) !== 1) {
      return null;
    }
    const frames = Object.fromEntries([...TOLD, "sample", "time", "slip", "friction"].map((name) => [name, []]));
    let next = 0;
    const record = (sample) => {
      TOLD.forEach((name, index) => frames[name].push(sample > 0 || index < ESTIMATE ? exports.value(index) : null));
      frames.sample.push(sample);
      for (const name of ["time", "slip", "friction"]) frames[name].push(data.frames[name][next]);
      next += 1;
    };
    record(0);
    let used = 0;
    let sum = 0;
    for (let i = 0; i < measured.slip.length; i++) {
      if (exports.update(measured.slip[i], measured.friction[i], assumed.noise * measured.std[i]) === 1) {
        used += 1;
        sum += exports.value(TOLD.indexOf("nis"));
      }
      if (number(i) >= data.frames.sample[next]) record(number(i));
    }
    return { ...host, frames, used, meanNis: used > 0 ? sum / used : null };
  };

  const describe = (name, { frames, meanNis }, used) => {
    const k = frames.sample.length - 1;
    const verdict = meanNis === null ? "no measurement used"
      : meanNis < data.nisLow ? "conservative" : meanNis > data.nisHigh ? "overconfident" : "consistent";
    return [
      name,
      muslip.plusMinus(frames.peak[k], frames.peakStd[k]),
      muslip.plusMinus(frames.criticalSlip[k], frames.criticalSlipStd[k]),
      meanNis === null ? "" : meanNis.toFixed(3),
      verdict,
      String(used),
    ];
  };

  const update = (exports) => {
    const assumed = chosen();
    shown("noise", `${assumed.noise.toPrecision(2)}×`);
    shown("peak", assumed.peak.toFixed(2));
    shown("slip", assumed.slip.toFixed(3));
    shown("spread", `${assumed.spread.toFixed(2)}×`);
    form.querySelectorAll(".article").forEach((element) => { element.hidden = assumed.efficient; });
    const result = run(exports, assumed);
    const place = document.getElementById("what-if-result");
    if (result === null) {
      place.textContent = "The filter refuses this start.";
      return;
    }
    const untouched = JSON.stringify(assumed) === JSON.stringify({ ...asItWas(), pseudonoise: assumed.pseudonoise })
      && (assumed.efficient || assumed.pseudonoise);
    const table = muslip.table(
      untouched ? "As in the command's run" : "Under these assumptions",
      ["run by", "peak friction", "critical slip", "mean NIS", "verdict", "measurements used"],
      [describe("the command", host, data.used), describe("this page", result, result.used)],
    );
    const scroll = document.createElement("div");
    scroll.className = "scroll";
    scroll.tabIndex = 0;
    scroll.setAttribute("role", "group");
    scroll.setAttribute("aria-label", "Result under these assumptions");
    scroll.append(table);
    place.replaceChildren(scroll);
    muslip.player.show(result, Math.min(muslip.player.shown, result.frames.sample.length - 1));
    api.result = result;
  };

  const api = { core, run, asItWas, result: null };
  core.then((exports) => {
    let due = false;
    const later = () => {
      if (due) return;
      due = true;
      requestAnimationFrame(() => { due = false; update(exports); });
    };
    form.addEventListener("input", later);
    field("reset").addEventListener("click", () => {
      const before = asItWas();
      field("estimator").value = String(Number(before.efficient));
      field("noise").value = 0;
      field("peak").value = before.peak;
      field("slip").value = before.slip;
      field("spread").value = 1;
      field("pseudonoise").checked = true;
      later();
    });
    later();
  });
  return api;
})();
