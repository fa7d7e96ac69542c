"use strict";
// Draws the data of <script class="chart"> by uPlot, in place of the static drawing beside it. Charts of one group share stretch and cursor.
(() => {
  const FONT = "12px system-ui, sans-serif";
  const POINT = 6; // pixels across a point
  const WHOLE = Array.from({ length: 7 }, (_, k) => [1, 2, 5].map((v) => v * 10 ** k)).flat(); // steps of what is counted
  const RIM = 1.2; // pixels by which a point stands out from under each other that is drawn over it
  const SCALE = 50; // pixels above and below a panel: the numbers of its scale, and what uPlot leaves free
  const groups = new Map(); // name -> {plots, range, whole}

  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (k) => css(`--c${k % 7}`);

  const shown = (value) => {
    if (value == null) return "–";
    const size = Math.abs(value);
    return size && (size < 1e-4 || size >= 1e7) ? value.toExponential(4) : String(+value.toPrecision(6));
  };
  // The digits after the point that tell multiples of `step` exactly: 2 for 0.25.
  const decimals = (step) => {
    let digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    while (digits < 15 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits++;
    return digits;
  };
  const ticks = (u, splits, axis, space, step) =>
    splits.map((v) => {
      if (v == null) return "";
      if (u.scales[u.axes[axis].scale].distr === 3) return v >= 1e-4 && v < 1e5 ? String(+v.toPrecision(3)) : v.toExponential(0);
      const digits = decimals(step);
      if (digits <= 6 && Math.abs(v) < 1e7) return v.toFixed(digits);
      const shown = Math.floor(Math.log10(Math.abs(v))) + Math.max(digits, Math.ceil(-Math.log10(step)));
      return v === 0 ? "0" : v.toExponential(Math.min(Math.max(shown, 0), 8)).replace(/\.?0+e/, "e");
    });
  const width = (u, values, axis, cycle) => {
    if (cycle > 1) return u.axes[axis]._size;
    u.ctx.font = u.axes[axis].font[0];
    const longest = Math.max(0, ...(values || []).map((v) => u.ctx.measureText(v || "").width));
    return Math.max(70, Math.ceil(longest / devicePixelRatio + 16));
  };

  // The pixels that a panel needs so that its label, which runs along its axis, is not cut off.
  const labelled = (label) => {
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = FONT;
    return Math.ceil(pen.measureText(label).width) + SCALE;
  };

  // The stretch that a group shows; every plot of it follows.
  function show(group, min, max, from) {
    const [low, high] = group.whole;
    const span = Math.min(max - min, high - low);
    min = Math.min(Math.max(min, low), high - span);
    group.range = [min, min + span];
    for (const plot of group.plots) if (plot !== from) plot.setScale("x", { min: group.range[0], max: group.range[1] });
  }
  // Zooms about `at` (0 … 1 of the stretch) and moves by a share of it; on a logarithmic axis in decades.
  function move(group, factor, at, by) {
    const [there, back] = group.log ? [Math.log10, (v) => 10 ** v] : [(v) => v, (v) => v];
    const [a, b] = group.range.map(there);
    const [low, high] = group.whole.map(there);
    const span = Math.min((b - a) * factor, high - low);
    const first = Math.min(Math.max(a + (b - a) * at - span * at + (b - a) * by, low), high - span);
    show(group, back(first), back(first + span));
  }

  function backdrop(panel) {
    return (u) => {
      const { left, top, width: w, height: h } = u.bbox;
      const y = (v) => u.valToPos(v, "y", true);
      u.ctx.save();
      u.ctx.beginPath();
      u.ctx.rect(left, top, w, h);
      u.ctx.clip();
      if (panel.band) {
        u.ctx.fillStyle = css("--noise");
        u.ctx.fillRect(left, y(panel.band[1]), w, y(panel.band[0]) - y(panel.band[1]));
      }
      u.ctx.strokeStyle = u.ctx.fillStyle = css("--soft");
      u.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      u.ctx.textAlign = "right";
      for (const [value, what] of panel.rules) {
        u.ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
        u.ctx.beginPath();
        u.ctx.moveTo(left, y(value));
        u.ctx.lineTo(left + w, y(value));
        u.ctx.stroke();
        u.ctx.fillText(what, left + w - 4, y(value) - 3 * devicePixelRatio);
      }
      u.ctx.restore();
    };
  }

  // Marks by matplotlib's letters: the corners of a closed shape, or strokes, about (0, 0) within ± 1.
  const ring = (n, turn = 0, inner = 1) => Array.from({ length: n }, (_, k) => [Math.sin(turn + (2 * Math.PI * k) / n), -Math.cos(turn + (2 * Math.PI * k) / n)].map((v) => v * (k % 2 ? inner : 1)));
  const SHAPES = { o: ring(24), s: ring(4, Math.PI / 4), "^": ring(3), v: ring(3, Math.PI), "<": ring(3, -Math.PI / 2), ">": ring(3, Math.PI / 2), D: ring(4), p: ring(5), h: ring(6), "*": ring(10, 0, 0.4) };
  const STROKES = { x: [[-0.8, -0.8, 0.8, 0.8], [-0.8, 0.8, 0.8, -0.8]], "+": [[-1, 0, 1, 0], [0, -1, 0, 1]] };
  const outline = (name, x, y, r) =>
    SHAPES[name] ? `${SHAPES[name].map(([a, b], k) => `${k ? "L" : "M"}${x + r * a} ${y + r * b}`).join("")}Z` : STROKES[name].map(([a, b, c, d]) => `M${x + r * a} ${y + r * b}L${x + r * c} ${y + r * d}`).join("");

  function mark(u, i, from, to, curve, above) {
    const path = new Path2D();
    const y = (j, k) => u.valToPos(u.data[j][k], "y", true);
    const covers = (j, k) => u.data[j][k] != null && Math.abs(y(j, k) - y(i, k)) < (POINT / 2) * devicePixelRatio;
    for (let k = from; k <= to; k++) {
      if (u.data[i][k] == null) continue;
      const radius = POINT / 2 + RIM * above.filter((j) => covers(j, k)).length;
      path.addPath(new Path2D(outline(curve.mark, u.valToPos(u.data[0][k], "x", true), y(i, k), radius * devicePixelRatio)));
    }
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    u.ctx.fillStyle = u.ctx.strokeStyle = colour(curve.colour);
    u.ctx.lineWidth = 1.2 * devicePixelRatio;
    if (SHAPES[curve.mark]) u.ctx.fill(path);
    else u.ctx.stroke(path);
    u.ctx.restore();
  }

  // The legend shows the line or the mark itself.
  function legend(u, panel) {
    u.root.querySelectorAll(".u-legend .u-marker").forEach((box, i) => {
      const curve = panel.curves[i - (u.root.querySelectorAll(".u-legend .u-marker").length - panel.curves.length)];
      if (!curve) return;
      const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
      svg.setAttribute("viewBox", "0 0 36 12");
      svg.setAttribute("aria-hidden", "true");
      path.setAttribute("d", curve.mark ? outline(curve.mark, 18, 6, 4) : "M0 6H36");
      path.setAttribute("style", `fill:${SHAPES[curve.mark] ? `var(--c${curve.colour % 7})` : "none"};stroke:var(--c${curve.colour % 7});stroke-width:2;stroke-dasharray:${curve.mark ? "none" : curve.dash.join(" ") || "none"}`);
      svg.append(path);
      box.replaceChildren(svg);
    });
  }

  function series(curve, above) {
    const points = curve.mark !== "";
    const drawn = {
      label: curve.name,
      stroke: () => colour(curve.colour),
      width: curve.width,
      dash: curve.dash,
      value: (u, v) => shown(v),
      points: { show: points && ((u, i, from, to) => { mark(u, i, from, to, curve, above); return false; }), size: POINT },
    };
    if (points) drawn.paths = () => null;
    else if (curve.held) drawn.paths = uPlot.paths.stepped({ align: 1 });
    return drawn;
  }

  // Whether the abscissa counts things, such as poses or recordings, between which there is nothing.
  const counted = (chart) => chart.places.length > 0 || (!chart.logX && !chart.x.includes("[") && chart.panels.every((p) => p.x.every((v) => v == null || Number.isInteger(v))));

  function options(chart, panel, group, size, last) {
    const place = chart.places.length ? (v) => (v == null ? "–" : (chart.places[Math.round(v) - 1] || "")) : shown;
    const axis = { stroke: () => css("--ink"), grid: { stroke: () => css("--line"), width: 1 }, ticks: { stroke: () => css("--line"), width: 1 }, font: FONT, labelFont: FONT };
    const levels = panel.rules.map((r) => r[0]).concat(panel.band || []);
    const reach = (u, low, high) => {
      if (low == null) return panel.log ? [0.1, 1] : [-1, 1];
      for (const v of levels) [low, high] = [Math.min(low, v), Math.max(high, v)];
      return uPlot.rangeNum(low, high, { min: { pad: 0.08, soft: 0, mode: 0 }, max: { pad: 0.08, soft: 0, mode: 0 } });
    };
    return {
      width: size,
      height: Math.max(panel.height, labelled(panel.label)) + (last ? 20 : 0),
      scales: { x: { time: false, distr: chart.logX ? 3 : 1, range: (u, min, max) => [min, max] }, y: panel.log ? { distr: 3 } : { range: reach } },
      axes: [
        { ...axis, label: last ? chart.x : undefined, labelSize: last ? 20 : 0, size: 30, values: ticks, incrs: counted(chart) ? WHOLE : undefined },
        { ...axis, label: panel.label, labelSize: 18, size: width, values: ticks },
      ],
      series: [{ label: "at", value: (u, v) => place(v) }, ...panel.curves.map((c, k) => series(c, panel.curves.flatMap((o, j) => (j > k && o.mark ? [j + 1] : []))))],
      legend: { live: true, markers: { width: 0 } },
      cursor: { sync: { key: group.name, scales: ["x", null], filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } }, drag: { x: true, y: false, setScale: true }, bind: { mousedown: (u, t, handler) => (e) => (e.shiftKey ? null : handler(e)), dblclick: () => () => { show(group, ...group.whole); return null; } } },
      hooks: {
        drawClear: panel.band || panel.rules.length ? [backdrop(panel)] : [],
        setScale: [(u, key) => { if (key === "x" && group.ready && u.scales.x.min != null && (u.scales.x.min !== group.range[0] || u.scales.x.max !== group.range[1])) show(group, u.scales.x.min, u.scales.x.max, u); }],
        ready: [(u) => pan(u, group), (u) => legend(u, panel)],
      },
    };
  }

  // Shift and drag moves; control and wheel zooms.
  function pan(u, group) {
    u.over.addEventListener("mousedown", (e) => {
      if (!e.shiftKey || e.button !== 0) return;
      e.preventDefault();
      let last = e.clientX;
      const drag = (m) => {
        move(group, 1, 0, (last - m.clientX) / u.over.clientWidth);
        last = m.clientX;
      };
      const end = () => { removeEventListener("mousemove", drag); removeEventListener("mouseup", end); };
      addEventListener("mousemove", drag);
      addEventListener("mouseup", end);
    });
    u.over.addEventListener("wheel", (e) => {
      if (!e.ctrlKey) return;
      e.preventDefault();
      move(group, e.deltaY < 0 ? 0.8 : 1.25, e.offsetX / u.over.clientWidth, 0);
    }, { passive: false });
  }

  const KEYS = { "+": [0.5, 0.5, 0], "-": [2, 0.5, 0], ArrowLeft: [1, 0, -0.25], ArrowRight: [1, 0, 0.25] };

  function bar(group, title) {
    const row = document.createElement("div");
    row.className = "bar";
    const whole = () => show(group, ...group.whole);
    const buttons = [["+", "zoom in", () => move(group, ...KEYS["+"])], ["−", "zoom out", () => move(group, ...KEYS["-"])], ["◀", "move left", () => move(group, ...KEYS.ArrowLeft)], ["▶", "move right", () => move(group, ...KEYS.ArrowRight)], ["whole", "show the whole", whole]];
    for (const [text, what, act] of buttons) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.title = what;
      button.setAttribute("aria-label", `${what}: ${title}`);
      button.addEventListener("click", act);
      row.append(button);
    }
    return row;
  }

  function build(holder, box, size) {
    const chart = JSON.parse(holder.textContent);
    const at = chart.panels.flatMap((p) => [p.x[0], p.x[p.x.length - 1]]).filter((v) => v != null);
    const ends = [Math.min(...at), Math.max(...at)];
    // points at the ends are drawn whole
    const pointed = !chart.logX && chart.panels.some((p) => p.curves.some((c) => c.mark));
    const pad = chart.places.length ? 0.5 : pointed ? 0.02 * (ends[1] - ends[0]) : 0;
    const whole = [ends[0] - pad, ends[1] + pad];
    if (whole[0] === whole[1]) whole[1] += 1;
    let group = groups.get(chart.group);
    if (!group) groups.set(chart.group, (group = { name: chart.group, plots: [], range: whole, whole, log: chart.logX, ready: false }));
    group.ready = false;
    if (whole[0] < group.whole[0] || whole[1] > group.whole[1]) group.range = group.whole = [Math.min(whole[0], group.whole[0]), Math.max(whole[1], group.whole[1])];
    box.append(bar(group, box.getAttribute("aria-label")));
    const plots = chart.panels.map((panel, k) => {
      const data = [panel.x, ...panel.curves.map((c) => (panel.log ? c.y.map((v) => (v > 0 ? v : null)) : c.y))];
      return new uPlot(options(chart, panel, group, size, k === chart.panels.length - 1), data, box);
    });
    group.plots.push(...plots);
    show(group, ...group.range);
    // uPlot sets its scales after this turn: what it sets itself is no wish of the reader's
    setTimeout(() => { group.ready = true; }, 0);
    box.addEventListener("keydown", (e) => {
      if (e.ctrlKey || e.metaKey || e.altKey) return;
      if (e.key === "0") show(group, ...group.whole);
      else if (KEYS[e.key]) move(group, ...KEYS[e.key]);
      else return;
      e.preventDefault();
    });
    return plots;
  }

  for (const holder of document.querySelectorAll("script.chart")) {
    const figure = holder.closest("figure");
    const box = document.createElement("div");
    box.className = "live";
    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", figure.querySelector("figcaption b").textContent);
    holder.before(box);
    figure.classList.add("alive");
    let plots = null;
    // A folded section has no width until it is opened.
    new ResizeObserver(() => {
      const size = box.clientWidth;
      if (!size) return;
      if (!plots) plots = build(holder, box, size);
      else for (const plot of plots) if (plot.width !== size) plot.setSize({ width: size, height: plot.height });
    }).observe(box);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { for (const plot of plots || []) plot.redraw(false, true); });
  }
})();
