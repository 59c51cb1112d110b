"use strict";
// One time rules: that of the viewer's bar where there is one, else that of the bar of this page.
const data = JSON.parse(document.getElementById("data").textContent);
const COLOURS = ["#ffffff", "#F0A202", "#D1102A"];
const END = data.period * (data.frames - 1);
const at = (id) => document.getElementById(id);
let frame = -1;
let playing = true;
let time = 0;

function element(tag, parent, text) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

// --- the image plane of a run ---

class Panel {
  constructor(run) {
    this.run = run;
    const article = element("article", at("image"));
    const head = element("h2", article, run.law);
    head.style.color = run.colour;
    this.said = element("span", head);
    this.canvas = element("canvas", article);
    this.canvas.className = "plane";
    this.lanes = [];
    const list = element("ul", article);
    for (const row of run.rows) {
      const item = element("li", list);
      const lamp = element("span", item);
      const label = element("code", item, row.label.split("[")[0]);
      // a long one goes on in the next line here, not within a word
      label.append(document.createElement("wbr"), row.label.slice(label.textContent.length));
      label.title = row.label;
      const lane = element("canvas", item);
      lane.addEventListener("click", (event) => {
        seek((event.offsetX / lane.clientWidth) * END);
      });
      this.lanes.push({ row, lamp, lane });
    }
    const rest = [];
    if (run.more) rest.push(`${run.more} more that act`);
    if (run.quiet) rest.push(run.quiet === 1 ? "1 row that never acts" : `${run.quiet} rows that never act`);
    if (rest.length) element("li", list, `and ${rest.join(", ")}`).className = "rest";
  }

  fit() {
    const [hu, hv] = data.half;
    const dense = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(Math.round(this.canvas.clientWidth * dense), 100);
    this.canvas.height = Math.round((this.canvas.width * hv) / hu);
    this.scale = this.canvas.width / (2 * hu);
    this.still = document.createElement("canvas");
    this.still.width = this.canvas.width;
    this.still.height = this.canvas.height;
    this.drawStill(this.context(this.still));
    for (const { row, lane } of this.lanes) {
      lane.width = Math.max(lane.clientWidth * dense, 50);
      lane.height = 12 * dense;
      row.picture = this.drawLane(row, lane);
    }
  }

  // pixels from the image's centre, u to the right and v down, as everywhere
  context(canvas) {
    const c = canvas.getContext("2d", { willReadFrequently: true });
    c.setTransform(this.scale, 0, 0, this.scale, canvas.width / 2, canvas.height / 2);
    c.lineJoin = "round";
    return c;
  }

  drawStill(c) {
    const [hu, hv] = data.half;
    c.fillStyle = "#ffffff";
    c.fillRect(-hu, -hv, 2 * hu, 2 * hv);
    areas(c, data.forbidden, "#DCDCDC");
    lines(c, data.lines, "#222222", 1.2 / this.scale);
    const [w, h] = data.size;
    lines(c, [data.outline || box(w / 2, h / 2)], "#606060", 2 / this.scale);
    this.tracks(c, data.frames, "#BBBBBB", 1);
  }

  tracks(c, until, colour, width) {
    const pixels = this.run.pixels;
    for (let i = 0; i < pixels[0].length; i += 2) {
      const line = [];
      for (let k = 0; k < until; k++) if (pixels[k][i] !== null) line.push([pixels[k][i], pixels[k][i + 1]]);
      lines(c, [line], colour, width / this.scale);
    }
  }

  drawLane(row, lane) {
    const c = lane.getContext("2d");
    c.fillStyle = "#eeeeee";
    c.fillRect(0, 0, lane.width, lane.height);
    const step = lane.width / row.lights.length;
    // as long as a lamp stays as it is, it is one piece, without seams
    for (let k = 0, end = 0; k < row.lights.length; k = end) {
      while (end < row.lights.length && row.lights[end] === row.lights[k]) end++;
      if (row.lights[k] === "0") continue;
      c.fillStyle = COLOURS[row.lights[k]];
      c.fillRect(Math.floor(k * step), 0, Math.max(Math.ceil((end - k) * step), 2), lane.height);
    }
    return c.getImageData(0, 0, lane.width, lane.height);
  }

  draw(k) {
    const run = this.run;
    const c = this.context(this.canvas);
    c.save();
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.drawImage(this.still, 0, 0);
    c.restore();
    for (const one of data.moving) {
      c.save();
      c.translate(one.moved[k][0], one.moved[k][1]);
      areas(c, one.forbidden, "#C9C9C9");
      lines(c, one.lines, "#222222", 1.2 / this.scale);
      c.restore();
    }
    this.tracks(c, k + 1, run.colour, 2);
    const t = k * data.period;
    const goals = data.goals.filter((goal, g) => g === 0 || goal.from <= t + 1e-9);
    const size = 11 / this.scale;
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.font = `${1.6 * size}px sans-serif`;
    c.fillStyle = "#222222";
    for (const [u, v] of goals[goals.length - 1].pixels) c.fillText("★", u, v);
    const now = run.pixels[k];
    for (let i = 0; i < now.length; i += 2) {
      disc(c, run.pixels[0][i], run.pixels[0][i + 1], 0.5 * size, "#ffffff", "#888888", this.scale);
    }
    c.font = `${1.1 * size}px sans-serif`;
    for (let i = 0; i < now.length; i += 2) {
      if (now[i] === null) continue;
      const lit = Number(run.markers[i / 2][k]);
      if (lit) disc(c, now[i], now[i + 1], 1.25 * size, COLOURS[lit], COLOURS[lit], this.scale);
      disc(c, now[i], now[i + 1], 0.8 * size, run.colour, "#ffffff", this.scale);
      c.fillStyle = "#ffffff";
      c.fillText(String(i / 2 + 1), now[i], now[i + 1] + 0.06 * size);
    }
    const over = t > run.end + 1e-9 || k === data.frames - 1;
    const error = run.error[k] === null ? "" : `${run.error[k].toFixed(1)} px from the goal`;
    this.said.textContent = over ? `${run.status} at ${run.end.toFixed(2)} s` : error;
    this.said.title = run.reason;
    for (const { row, lamp, lane } of this.lanes) {
      const state = Number(row.lights[k]);
      lamp.className = ["lamp", "lamp acts", "lamp outside"][state];
      const l = lane.getContext("2d");
      l.putImageData(row.picture, 0, 0);
      l.fillStyle = "#222222";
      l.fillRect((k / Math.max(data.frames - 1, 1)) * lane.width - 1, 0, 2, lane.height);
    }
  }
}

function lines(c, all, colour, width) {
  c.strokeStyle = colour;
  c.lineWidth = width;
  c.beginPath();
  for (const line of all) line.forEach(([u, v], k) => (k ? c.lineTo(u, v) : c.moveTo(u, v)));
  c.stroke();
}

function areas(c, polygons, colour) {
  c.fillStyle = colour;
  c.beginPath();
  for (const polygon of polygons) {
    for (const ring of polygon) {
      ring.forEach(([u, v], k) => (k ? c.lineTo(u, v) : c.moveTo(u, v)));
      c.closePath();
    }
  }
  c.fill("evenodd");
}

function disc(c, u, v, radius, face, edge, scale) {
  c.beginPath();
  c.arc(u, v, radius, 0, 2 * Math.PI);
  c.fillStyle = face;
  c.fill();
  c.strokeStyle = edge;
  c.lineWidth = 1.2 / scale;
  c.stroke();
}

const box = (u, v) => [[-u, -v], [u, -v], [u, v], [-u, v], [-u, -v]];

// --- time ---

function hasWebGL() {
  const canvas = document.createElement("canvas");
  try {
    return !!(canvas.getContext("webgl2") || canvas.getContext("webgl"));
  } catch (error) {
    return false;
  }
}

let viewer = null;
let wanted = null;

function inViewer(what) {
  const inside = viewer && viewer.contentDocument;
  return inside ? inside.querySelector(what) : null;
}

// the viewer has a field for the time; it takes what is typed there
function seek(t) {
  time = Math.min(Math.max(t, 0), END);
  if (!viewer) {
    playing = false;
    return;
  }
  const slider = inViewer("[role=slider]");
  const field = slider && inViewer("input");
  if (!field) {
    wanted = time;
    return;
  }
  const set = Object.getOwnPropertyDescriptor(viewer.contentWindow.HTMLInputElement.prototype, "value").set;
  set.call(field, time.toFixed(3));
  field.dispatchEvent(new viewer.contentWindow.Event("input", { bubbles: true }));
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

// what keys do as long as no button or field has them
const KEYS = {
  " ": () => play(),
  ArrowLeft: () => seek((frame - 1 + 0.5) * data.period),
  ArrowRight: () => seek((frame + 1 + 0.5) * data.period),
  Home: () => seek(0),
  End: () => seek(END),
};

function pressed(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || !(event.key in KEYS)) return;
  event.preventDefault();
  event.stopPropagation();
  KEYS[event.key]();
}

document.addEventListener("keydown", (event) => {
  if (!event.target.matches("button, input")) pressed(event);
});

// the viewer has keys of its own, but its field for the time, where the focus is at the start, has no use for these
function listen() {
  viewer.contentDocument.addEventListener("keydown", (event) => {
    if (event.target === inViewer("input")) pressed(event);
  }, true);
}

let listening = false;

function now(since) {
  if (viewer) {
    const slider = inViewer("[role=slider]");
    if (slider && !listening) listen();
    listening = listening || slider !== null;
    if (slider && wanted !== null) {
      const t = wanted;
      wanted = null;
      seek(t);
    }
    return slider ? Number(slider.getAttribute("aria-valuenow")) : time;
  }
  if (playing) time = time + since > END + 0.5 ? 0 : time + since;
  at("bar").querySelector("input").value = Math.min(time, END);
  at("bar").querySelector("button").textContent = playing ? "⏸" : "▶";
  return time;
}

const panels = data.runs.map((run) => new Panel(run));
let last = performance.now();

function tick(stamp) {
  const t = now(Math.max(stamp - last, 0) / 1000);
  last = stamp;
  const k = Math.min(Math.max(Math.floor(t / data.period + 1e-6), 0), data.frames - 1);
  if (k !== frame) {
    frame = k;
    at("clock").textContent = `${(k * data.period).toFixed(2)} s of ${END.toFixed(2)} s`;
    for (const panel of panels) panel.draw(k);
    document.documentElement.dataset.frame = String(k);
  }
  requestAnimationFrame(tick);
}

if (hasWebGL()) {
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
const start = /[#&]t=([0-9.]+)/.exec(window.location.hash);
if (start) seek(Number(start[1]));
// also tells the sizes at the start
new ResizeObserver(() => {
  for (const panel of panels) panel.fit();
  frame = -1;
}).observe(at("image"));
for (const panel of panels) panel.fit();
requestAnimationFrame(tick);
