"use strict";
// The time is that of the viewer's bar where there is one, else that of this page's own bar.
const at = (id) => document.getElementById(id);
const data = JSON.parse(at("data").textContent);
const END = data.period * (data.frames - 1);
const articles = [...document.querySelectorAll("article")];
let [frame, time, playing] = [-1, 0, true];
let [viewer, wanted, listening] = [null, null, false];

// --- what is drawn in a frame ---

function draw(k) {
  const t = k * data.period;
  at("clock").textContent = `${t.toFixed(2)} s of ${END.toFixed(2)} s`;
  const goal = data.goals.findLastIndex((one, g) => g === 0 || one.from <= t + 1e-9);
  articles.forEach((article, r) => {
    const run = data.runs[r];
    const all = (what) => [...article.querySelectorAll(what)];
    all(".moving").forEach((one, i) => one.setAttribute("transform", `translate(${data.moving[i].moved[k]})`));
    all(".goals").forEach((one, g) => (one.style.display = g === goal ? "" : "none"));
    all(".track").forEach((one, i) => {
      const points = run.pixels.slice(0, k + 1).filter((p) => p[2 * i] !== null);
      one.setAttribute("d", points.length ? "M" + points.map((p) => `${p[2 * i]},${p[2 * i + 1]}`).join("L") : "");
    });
    all(".marker").forEach((one, i) => {
      const [u, v] = run.pixels[k].slice(2 * i, 2 * i + 2);
      one.style.display = u === null ? "none" : "";
      if (u !== null) one.setAttribute("transform", `translate(${u} ${v})`);
      one.dataset.state = run.markers[i][k];
    });
    const error = run.error[k] === null ? "" : `${run.error[k].toFixed(1)} px from the goal`;
    const over = t > run.end + 1e-9 || k === data.frames - 1;
    article.querySelector("h2 span").textContent = over ? `${run.status} at ${run.end.toFixed(2)} s` : error;
    all(".state").forEach((one, i) => (one.dataset.state = run.rows[i].states[k]));
    for (const one of all(".now")) {
      one.setAttribute("x1", k + 0.5);
      one.setAttribute("x2", k + 0.5);
    }
  });
  document.documentElement.dataset.frame = String(k);
}

// --- time ---

function inViewer(what) {
  const inside = viewer && viewer.contentDocument;
  return inside ? inside.querySelector(what) : null;
}

// the viewer has a field for the time, which takes what is typed there
function seek(t) {
  time = Math.min(Math.max(t, 0), END);
  if (!viewer) {
    playing = false;
    return;
  }
  const field = inViewer("[role=slider]") && inViewer("input");
  wanted = field ? null : time;
  if (!field) return;
  const inside = viewer.contentWindow;
  Object.getOwnPropertyDescriptor(inside.HTMLInputElement.prototype, "value").set.call(field, time.toFixed(3));
  field.dispatchEvent(new inside.Event("input", { bubbles: true }));
}

function play() {
  if (!viewer) {
    playing = !playing;
    return;
  }
  let bar = inViewer("[role=slider]");
  while (bar && !bar.querySelector("button")) bar = bar.parentElement;
  if (bar) bar.querySelector("button").click();
}

const KEYS = {
  " ": play,
  ArrowLeft: () => seek((frame - 0.5) * data.period),
  ArrowRight: () => seek((frame + 1.5) * data.period),
  Home: () => seek(0),
  End: () => seek(END),
};

function pressed(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || !(event.key in KEYS)) return;
  event.preventDefault();
  event.stopPropagation();
  KEYS[event.key]();
}

function now(since) {
  if (viewer) {
    const slider = inViewer("[role=slider]");
    if (slider && !listening) {
      listening = true;
      // the viewer's field for the time has the focus at the start, and no use for these keys
      viewer.contentDocument.addEventListener("keydown", (event) => {
        if (event.target === inViewer("input")) pressed(event);
      }, true);
    }
    if (slider && wanted !== null) seek(wanted);
    return slider ? Number(slider.getAttribute("aria-valuenow")) : time;
  }
  if (playing) time = time + since > END + 0.5 ? 0 : time + since;
  at("bar").querySelector("input").value = Math.min(time, END);
  at("bar").querySelector("button").textContent = playing ? "⏸" : "▶";
  return time;
}

let last = performance.now();

function tick(stamp) {
  const t = now(Math.max(stamp - last, 0) / 1000);
  last = stamp;
  const k = Math.min(Math.max(Math.floor(t / data.period + 1e-6), 0), data.frames - 1);
  if (k !== frame) draw((frame = k));
  requestAnimationFrame(tick);
}

// --- the page ---

const canvas = document.createElement("canvas");
if (canvas.getContext("webgl2") || canvas.getContext("webgl")) {
  viewer = document.createElement("iframe");
  viewer.title = "arm, camera and target in space";
  viewer.srcdoc = JSON.parse(at("viewer").textContent);
  at("space").append(viewer);
} else {
  at("picture").hidden = at("bar").hidden = false;
  const slider = at("bar").querySelector("input");
  slider.max = END;
  slider.addEventListener("input", () => seek(Number(slider.value)));
  at("bar").querySelector("button").addEventListener("click", play);
}
for (const lane of document.querySelectorAll(".lane")) {
  lane.addEventListener("click", (event) => seek((event.offsetX / lane.clientWidth) * END));
}
document.addEventListener("keydown", (event) => {
  if (!event.target.matches("button, input")) pressed(event);
});
// symbols keep their size on the screen, whatever the width of the image
const sizes = new ResizeObserver((entries) => {
  for (const { target } of entries) target.style.setProperty("--px", (2 * data.half[0]) / target.clientWidth);
});
for (const plane of document.querySelectorAll(".plane")) sizes.observe(plane);
const start = /[#&]t=([0-9.]+)/.exec(window.location.hash);
if (start) seek(Number(start[1]));
requestAnimationFrame(tick);
