// Draws rolling bodies from the data in the page and animates them at constant speed.
(function () {
  "use strict";
  const find = (id) => document.getElementById(id);
  const stage = find("stage"), view = JSON.parse(find("machine-data").textContent);
  const X = (x) => view.left + view.scale * x, Y = (y) => view.base - view.scale * y;
  const INK = "#222222", BLUE = "#0072B2", GREEN = "#009E73", MARK = "#CC79A7";

  function make(parent, kind, attributes, text) {
    const element = document.createElementNS(stage.namespaceURI, kind);
    for (const name in attributes) element.setAttribute(name, attributes[name]);
    if (text !== undefined) element.textContent = text;
    parent.appendChild(element);
    return element;
  }

  // a point in the axes of the design, after the line of centres has turned about the fixed point
  function moved(x, y, turn) {
    const c = Math.cos(turn), s = Math.sin(turn), dx = x - view.rest, dy = y;
    return [view.rest + c * dx - s * dy, s * dx + c * dy];
  }

  // creates a member as a group about its centre; returns a function that sets the angle of the driven member
  function member(x, y, ratio, draw) {
    const group = make(stage, "g", {});
    draw(group);
    return (angle) => {
      const [px, py] = moved(x, y, view.ratios.carrier * angle), turn = (-ratio * angle * 180) / Math.PI;
      group.setAttribute("transform", `translate(${X(px).toFixed(3)} ${Y(py).toFixed(3)}) rotate(${turn.toFixed(4)})`);
    };
  }
  function spokes(group, near, far, colour) {
    for (const [c, s] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
      make(group, "line", { x1: c * near, y1: s * near, x2: c * far, y2: s * far, stroke: colour, "stroke-width": 1.4 });
    }
  }

  const outer = view.scale * view.outer_radius, inner = view.scale * view.inner_radius, rim = 0.075 * outer;
  const moves = [
    member(view.eccentricity, 0, view.ratios.outer, (group) => {
      make(group, "circle", { r: outer + rim, fill: "#b3e2d5", stroke: GREEN });
      make(group, "circle", { r: outer, fill: "#fff", stroke: GREEN, id: "outer-ring" });
      spokes(group, outer, outer + rim, GREEN);
    }),
    member(0, 0, view.ratios.inner, (group) => {
      const bore = Math.max(inner - rim, 0.3 * inner);
      make(group, "circle", { r: inner, fill: "#b3d5e8", stroke: BLUE, id: "inner-ring" });
      make(group, "circle", { r: bore, fill: "#fff", stroke: BLUE });
      spokes(group, bore, inner, BLUE);
    }),
    ...view.x.map((x, i) => member(x, view.y[i], view.ratios.bodies[i], (group) => {
      const r = view.scale * view.radius[i], c = Math.cos(view.angle[i]), s = -Math.sin(view.angle[i]);
      make(group, "circle", { r: r, fill: "#f4d58c", "fill-opacity": view.turns > 1 ? 0.5 : 1, stroke: INK,
        "data-body": i });
      make(group, "line", { x1: 0.62 * r * c, y1: 0.62 * r * s, x2: r * c, y2: r * s, stroke: INK, "stroke-width": 1.4 });
    })),
    member(view.centres.x, view.centres.y, view.ratios.carrier, (group) => {
      make(group, "ellipse", { rx: view.scale * view.centres.semi_major, ry: view.scale * view.centres.semi_minor,
        fill: "none", stroke: MARK, "stroke-dasharray": "5 3", id: "centres" });
    }),
  ];
  const names = make(stage, "g", { id: "names" });
  view.x.forEach((x, i) => {
    const name = make(names, "text", { "text-anchor": "middle", "dominant-baseline": "central" }, String(i + 1));
    moves.push((angle) => {
      const [px, py] = moved(x, view.y[i], view.ratios.carrier * angle);
      name.setAttribute("x", X(px).toFixed(2));
      name.setAttribute("y", Y(py).toFixed(2));
    });
  });
  const long = view.scale * view.bar.length, low = view.height - 12;
  make(stage, "path", { d: `M22 ${low - 3}v6m0 -3h${long}m0 -3v6`, stroke: INK, fill: "none" });
  make(stage, "text", { x: 22 + long / 2, y: low - 4, "text-anchor": "middle", class: "scale" }, view.bar.text);

  // ---- controls: the slider is in degrees of the driven member, positive along its rotation

  const slider = find("angle"), button = find("play"), pace = find("pace");
  const end = Number(slider.max);
  let angle = 0, before = 0, running = false;
  function go(at) {
    angle = at;
    const text = at.toFixed(1).replace(/\.0$/, "") + "°";
    slider.value = at;
    slider.setAttribute("aria-valuetext", text);
    find("angle-shown").textContent = text;
    moves.forEach((move) => move((view.sense * at * Math.PI) / 180));
  }
  function frame(now) {
    if (!running) return;
    go((angle + (end * Math.min(now - before, 200)) / (1000 * Number(pace.value))) % end);
    before = now;
    requestAnimationFrame(frame);
  }
  function play(on) {
    if (on === running) return;
    running = on;
    button.textContent = on ? "Pause" : "Play";
    before = performance.now();
    if (on) requestAnimationFrame(frame);
  }
  button.addEventListener("click", () => play(!running));
  slider.addEventListener("input", () => { play(false); go(Number(slider.value)); });
  find("show-names").addEventListener("change", (event) => { names.style.display = event.target.checked ? "" : "none"; });
  [slider, button, pace, find("show-names")].forEach((control) => { control.disabled = false; });
  go(0);
})();
