// Copyright 2026 The manifold_mpc_ros authors
// SPDX-License-Identifier: Apache-2.0
// Draws the figures of each run and turns its body when the time slider moves.
'use strict';

const CONFIG = {responsive: true, displaylogo: false, modeBarButtonsToRemove: ['select2d', 'lasso2d']};
const PLAY_S = 12;
const MOST_SCENES = 8;

// Index of the last element of an ascending list that is not above t.
function before(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

// The attitude (w, x, y, z) between two attitudes along the shorter arc.
function slerp(a, b, part) {
  let dot = a.reduce((sum, value, i) => sum + value * b[i], 0);
  const sign = dot < 0 ? -1 : 1;
  dot = Math.min(1, Math.abs(dot));
  const angle = Math.acos(dot);
  const [p, q] = angle < 1e-6
    ? [1 - part, part]
    : [Math.sin((1 - part) * angle) / Math.sin(angle), Math.sin(part * angle) / Math.sin(angle)];
  const mixed = a.map((value, i) => p * value + sign * q * b[i]);
  const norm = Math.hypot(...mixed);
  return mixed.map((value) => value / norm);
}

// Body components to inertial ones.
function rotate([w, x, y, z], v) {
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [
    v[0] + w * t[0] + y * t[2] - z * t[1],
    v[1] + w * t[1] + z * t[0] - x * t[2],
    v[2] + w * t[2] + x * t[1] - y * t[0]];
}

function columns(points) {
  return [0, 1, 2].map((axis) => points.map((point) => point[axis]));
}

class Run {
  constructor(section, data) {
    this.data = data;
    this.scene = section.querySelector('.scene');
    this.histories = section.querySelector('.histories');
    this.slider = section.querySelector('input');
    this.button = section.querySelector('button');
    this.fields = Object.fromEntries(
      [...section.querySelectorAll('[data-field]')].map((each) => [each.dataset.field, each]));
    this.playing = false;
    // report.html#t=4.5 opens at 4.5 s.
    this.slider.value = Number(new URLSearchParams(location.hash.slice(1)).get('t')) || 0;
    this.slider.addEventListener('input', () => { this.stop(); this.show(Number(this.slider.value)); });
    this.button.addEventListener('click', () => (this.playing ? this.stop() : this.play()));
  }

  async drawHistories() {
    await Plotly.newPlot(this.histories, this.data.histories.data, this.data.histories.layout, CONFIG);
    this.histories.on('plotly_click', (event) => { this.stop(); this.show(event.points[0].x); });
  }

  async drawScene() {
    await Plotly.newPlot(this.scene, this.data.scene.data, this.data.scene.layout, {...CONFIG, displayModeBar: false});
    this.drawn = true;
    await this.show(Number(this.slider.value));
  }

  removeScene() {
    this.stop();
    this.drawn = false;
    Plotly.purge(this.scene);
  }

  attitude(time) {
    const {time_s: times, attitude_wxyz: attitudes} = this.data;
    const index = before(times, time);
    const next = Math.min(index + 1, times.length - 1);
    const span = times[next] - times[index];
    const part = span > 0 ? Math.min(1, Math.max(0, (time - times[index]) / span)) : 0;
    return slerp(attitudes[index], attitudes[next], part);
  }

  // Draw the latest time asked for, one drawing at a time.
  async show(time) {
    this.wanted = time;
    if (this.busy) return;
    this.busy = true;
    while (this.wanted !== null) {
      const shown = this.wanted;
      this.wanted = null;
      await this.drawAt(shown);
    }
    this.busy = false;
  }

  async drawAt(time) {
    const {data} = this;
    const attitude = this.attitude(time);
    const {traces} = data;
    const update = {x: [], y: [], z: []};
    const indices = [];
    const move = (trace, points) => {
      const [x, y, z] = columns(points);
      update.x.push(x); update.y.push(y); update.z.push(z);
      indices.push(trace);
    };
    move(traces.body, data.corners.map((corner) => rotate(attitude, corner)));
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, i) => {
      move(traces.axes + i, [[0, 0, 0], rotate(attitude, axis)]);
    });
    const commanded = data.commanded_wxyz[before(data.time_s, time)];
    move(traces.commanded, data.commanded_axes.map((axis) => rotate(commanded, axis)));
    const tick = before(data.torque_time_s, time);
    const torque = data.torque_time_s.length ? data.torque_drawn[tick] : [0, 0, 0];
    move(traces.torque, [[0, 0, 0], rotate(attitude, torque)]);
    if (this.drawn) await Plotly.restyle(this.scene, update, indices);
    await Plotly.relayout(this.histories, {'shapes[0].x0': time, 'shapes[0].x1': time});
    this.write(time, before(data.time_s, time), tick);
  }

  write(time, state, tick) {
    const {data, fields} = this;
    this.slider.value = time;
    fields.time.textContent = `${time.toFixed(2)} s`;
    const digits = (value, count) => (value === null ? 'no number' : value.toPrecision(count));
    fields.error.textContent = `${digits(data.error_deg[state], 3)}°`;
    fields.rate.textContent = `${digits(data.rate_rad_s[state], 2)} rad/s`;
    fields.mode.textContent = data.mode[Math.min(tick, data.mode.length - 1)] || 'unknown';
  }

  play() {
    const end = Number(this.slider.max);
    const from = Number(this.slider.value) >= end ? 0 : Number(this.slider.value);
    const begun = performance.now();
    this.playing = true;
    this.button.textContent = '❚❚';
    const step = async (now) => {
      if (!this.playing) return;
      const time = Math.min(end, from + Math.max(0, now - begun) / 1000 * end / PLAY_S);
      await this.show(time);
      if (time < end) requestAnimationFrame(step); else this.stop();
    };
    requestAnimationFrame(step);
  }

  stop() {
    this.playing = false;
    this.button.textContent = '▶';
  }
}

// Browsers draw few 3D views at a time: all but the first are drawn when they come into sight.
async function drawScenes(runs) {
  const drawn = [runs[0]];
  await runs[0].drawScene();
  document.body.dataset.drawn = 'true';
  const observer = new IntersectionObserver(async (entries) => {
    for (const entry of entries.filter((each) => each.isIntersecting)) {
      const run = runs.find((each) => each.scene === entry.target);
      if (run.drawn) continue;
      drawn.push(run);
      if (drawn.length > MOST_SCENES) drawn.shift().removeScene();
      await run.drawScene();
    }
  });
  runs.forEach((run) => observer.observe(run.scene));
}

async function main() {
  const page = JSON.parse(document.getElementById('runs').textContent);
  const sections = [...document.querySelectorAll('section.run')];
  const runs = page.runs.map((data, i) => new Run(sections[i], data));
  const comparison = document.querySelector('.comparison');
  if (comparison) await Plotly.newPlot(comparison, page.comparison.data, page.comparison.layout, CONFIG);
  for (const run of runs) await run.drawHistories();
  await drawScenes(runs);
  const fit = () => document.querySelectorAll('.js-plotly-plot').forEach((plot) => Plotly.Plots.resize(plot));
  window.matchMedia('print').addEventListener('change', fit);
}

main();
