"use strict";
// One clock for everything: slider, keys, cursors in all panels, the numbers, the arms.

(async () => {
  await new Promise(done => requestAnimationFrame(() => setTimeout(done)));   // text and traces first
  const head = JSON.parse(document.getElementById("head").textContent);
  const slider = document.getElementById("time"), now = document.getElementById("now"), playButton = document.getElementById("play");
  const end = Math.max(...head.runs.map(run => run.time[run.time.length - 1]));
  const state = { time: 0, playing: false, speed: 1, before: 0 };
  const parts = [];

  for (const [number, run] of head.runs.entries()) {
    const root = document.getElementById(`run-${number}`), find = query => root.querySelector(query);
    const arrays = await readArrays(document.getElementById(`data-${number}`).textContent, run.arrays);
    let view = { gl: null, paint() {}, draw() {} };
    try { view = new TubeView(find("canvas.arm"), run, arrays); } catch (error) { console.warn(String(error)); }
    if (!view.gl) find(".view").classList.add("still");
    const choose = name => {
      const field = run.fields[name];
      view.paint(field);
      find(".scale").style.background = gradient(field.map, "to right");
      find(".low").textContent = +field.low.toPrecision(2);
      find(".high").textContent = `${+field.high.toPrecision(3)} ${field.unit}`;
    };
    find("select.field").addEventListener("change", event => choose(event.target.value));
    choose(find("select.field").value);
    for (const box of root.querySelectorAll("input[data-layer]")) {
      const show = () => {
        if (view.gl) view.show(box.dataset.layer, box.checked);
        if (box.dataset.layer === "arm") find(".colour").hidden = !box.checked;   // only the skin has colours to choose
      };
      box.addEventListener("change", show);
      show();
    }
    for (const canvas of root.querySelectorAll("canvas.kymograph")) {
      const field = run.fields[canvas.dataset.field] || run.kymographs[canvas.dataset.field];
      drawKymograph(canvas, arrays[canvas.dataset.array], field);
      const figure = canvas.closest("figure");
      figure.style.setProperty("--map", gradient(field.map, "to top"));
      figure.querySelector(".top").textContent = `${+field.high.toPrecision(2)} ${field.unit}`;
      figure.querySelector(".bottom").textContent = +field.low.toPrecision(2);
    }
    parts.push({ run, root, view, reading: find(".reading"), last: run.time[run.time.length - 1] });
  }

  function read(run, time) {
    const words = Object.entries(run.series).map(([name, values]) => {
      let i = 0;
      while (i < run.time.length - 2 && run.time[i + 1] <= time) i++;
      const share = Math.max(0, Math.min(1, (time - run.time[i]) / (run.time[i + 1] - run.time[i])));
      const value = values[i] + share * (values[i + 1] - values[i]);
      return `${name} ${value.toFixed(2).replace("-", "\u2212")}`;
    });
    const phase = run.phases.filter(item => item.begin <= time + 1e-9).pop();
    return [phase ? phase.name : "", ...words].join("     ");
  }

  function set(time) {
    state.time = Math.max(0, Math.min(end, time));
    slider.value = state.time;
    now.textContent = `${state.time.toFixed(2)} s`;
    for (const { run, root, view, reading, last } of parts) {
      reading.textContent = read(run, Math.min(state.time, last));
      for (const cursor of root.querySelectorAll(".panel > i")) {
        cursor.style.left = `${+cursor.dataset.left + (+cursor.dataset.width * Math.min(state.time, last)) / last}%`;
      }
      view.stale = true;
    }
  }

  function play(on) {
    Object.assign(state, { playing: on, before: performance.now() });
    playButton.textContent = on ? "Pause" : "Play";
    playButton.setAttribute("aria-pressed", on);
    if (on && state.time >= end) set(0);
  }

  for (const part of parts) {
    for (const panel of part.root.querySelectorAll(".panel")) {
      const cursor = panel.querySelector("i");
      const follow = event => {
        const box = panel.getBoundingClientRect(), across = (100 * (event.clientX - box.left)) / box.width;
        set(((across - cursor.dataset.left) / cursor.dataset.width) * part.last);
        if (panel.dataset.arm) part.view.mark = 1 - (event.clientY - box.top) / box.height;
      };
      panel.addEventListener("pointerdown", event => { panel.setPointerCapture(event.pointerId); follow(event); });
      panel.addEventListener("pointermove", event => { if (event.buttons) follow(event); });
    }
  }

  slider.max = end;
  slider.step = end / 2000;
  slider.addEventListener("input", () => set(+slider.value));
  playButton.addEventListener("click", () => play(!state.playing));
  document.getElementById("speed").addEventListener("change", event => { state.speed = +event.target.value; });
  for (const button of document.querySelectorAll("button.copy")) {
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(document.getElementById(button.dataset.from).textContent);
      button.textContent = "copied";
    });
  }
  addEventListener("keydown", event => {
    if (event.target.matches("select, button") || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = { ArrowRight: 0.02, ArrowLeft: -0.02, PageUp: 0.2, PageDown: -0.2 }[event.key];
    if (event.key === " ") play(!state.playing);
    else if (event.key === "Home") set(0);
    else if (event.key === "End") set(end);
    else if (step) set(state.time + step);
    else return;
    event.preventDefault();
  });

  function loop() {
    if (state.playing) {
      const instant = performance.now(), time = state.time + (state.speed * (instant - state.before)) / 1000;
      state.before = instant;
      set(time);
      if (time >= end) play(false);
    }
    for (const { view, last } of parts) if (view.stale) view.draw(Math.min(state.time, last));
    requestAnimationFrame(loop);
  }

  window.report = { set, play, state, parts };
  set(head.first);
  loop();
  document.body.dataset.ready = "yes";
  performance.mark("ready");
})();
