
"use strict";
for (const animation of document.querySelectorAll(".animation")) {
  const frames = [...animation.querySelectorAll(".frame")];
  const controls = animation.querySelector(".controls");
  const play = controls.querySelector(".play");
  const slider = controls.querySelector("input");
  const last = frames.length - 1;
  let shown = last;
  let timer = null;

  function show(index) {
    frames[shown].hidden = true;
    shown = Math.min(last, Math.max(0, index));
    frames[shown].hidden = false;
    slider.value = shown;
  }
  function pause() {
    clearInterval(timer);
    timer = null;
    play.textContent = "Play";
  }
  function start() {
    if (shown === last) show(0);
    play.textContent = "Pause";
    timer = setInterval(() => {
      show(shown + 1);
      if (shown === last) pause();
    }, 350);
  }

  play.addEventListener("click", () => (timer === null ? start() : pause()));
  controls.querySelector(".back").addEventListener("click", () => { pause(); show(shown - 1); });
  controls.querySelector(".step").addEventListener("click", () => { pause(); show(shown + 1); });
  slider.addEventListener("input", () => { pause(); show(Number(slider.value)); });
  show(0);
  controls.hidden = false;
}
