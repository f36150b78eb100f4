// Draws and animates the machine from the data in the page, and shows the crank angle in every diagram.
(function () {
  "use strict";
  const find = (id) => document.getElementById(id);
  const stage = find("stage");
  const view = JSON.parse(find("machine-data").textContent);
  const end = 360 * view.cycle_turns;
  const step = end / view.angles;
  const NS = stage.namespaceURI;
  const INK = "#222222", GREY = "#6b6b6b", LOAD = "#d55e00";
  const LEAD = 14; // distance from a point to the middle of its name

  const X = (x) => view.left + view.scale * x;
  const Y = (y) => view.base - view.scale * y;
  const spot = ([x, y]) => X(x).toFixed(2) + "," + Y(y).toFixed(2);

  function make(parent, kind, attributes, text) {
    const element = document.createElementNS(NS, kind);
    set(element, attributes || {});
    if (text !== undefined) element.textContent = text;
    parent.appendChild(element);
    return element;
  }
  function set(element, attributes) {
    for (const name in attributes) element.setAttribute(name, attributes[name]);
  }

  // ---- positions: cubic Hermite interpolation between the tabulated angles, `at` in degrees

  function cell(at) {
    const place = (((at % end) + end) % end) / step;
    const i = Math.min(Math.floor(place), view.angles - 1);
    return { i: i, j: (i + 1) % view.angles, t: place - i };
  }
  function position(machine, name, at) {
    const p = machine.points[name] || machine.headings[name]; // for a link: its direction
    if (!p.dx) return [p.x, p.y];
    const { i, j, t } = cell(at), h = (step * Math.PI) / 180;
    const near = (1 + 2 * t) * (1 - t) * (1 - t), far = t * t * (3 - 2 * t);
    const leave = h * t * (1 - t) * (1 - t), arrive = h * t * t * (t - 1);
    const between = (x, dx) => near * x[i] + far * x[j] + leave * dx[i] + arrive * dx[j];
    return [between(p.x, p.dx), between(p.y, p.dy)];
  }
  function velocity(machine, name, at) {
    const p = machine.points[name];
    if (!p.dx) return [0, 0];
    const { i, j, t } = cell(at);
    return [(1 - t) * p.dx[i] + t * p.dx[j], (1 - t) * p.dy[i] + t * p.dy[j]];
  }

  // ---- fixed parts

  function ground(parent, x1, y1, x2, y2, nx, ny) { // a line hatched on the side (nx, ny), in picture coordinates
    const length = Math.hypot(x2 - x1, y2 - y1), tx = (x2 - x1) / length, ty = (y2 - y1) / length;
    let strokes = "";
    for (let s = 2.3; s < length; s += 4.6) {
      strokes += `M${(x1 + s * tx).toFixed(2)} ${(y1 + s * ty).toFixed(2)}`
        + `l${(4.5 * (nx - tx)).toFixed(2)} ${(4.5 * (ny - ty)).toFixed(2)}`;
    }
    make(parent, "path", { d: strokes, stroke: GREY, "stroke-width": 0.7, fill: "none" });
    make(parent, "line", { x1: x1, y1: y1, x2: x2, y2: y2, stroke: INK, "stroke-width": 1 });
  }
  function drawPaths(parent, machine, look) {
    for (const name of machine.paths) {
      const p = machine.points[name];
      if (!p.dx) continue;
      let d = "", pen = "M";
      for (let i = 0; i <= view.angles; i++) {
        const k = i % view.angles;
        if (machine.lost.includes(k)) { pen = "M"; continue; }
        d += pen + X(p.x[k]).toFixed(1) + " " + Y(p.y[k]).toFixed(1);
        pen = "L";
      }
      make(parent, "path", Object.assign({ d: d, fill: "none" }, look));
    }
  }
  function drawFrame(parent, machine) {
    machine.guides.forEach(([x1, y1, x2, y2], k) => {
      const a = machine.guide_angles[k], tx = Math.cos(a), ty = -Math.sin(a), nx = ty, ny = -tx;
      for (const side of [1, -1]) {
        const ox = 7.8 * side * nx, oy = 7.8 * side * ny;
        ground(parent, X(x1) - 18.5 * tx + ox, Y(y1) - 18.5 * ty + oy, X(x2) + 18.5 * tx + ox, Y(y2) + 18.5 * ty + oy,
          side * nx, side * ny);
      }
    });
    for (const name of machine.pivots) {
      const [x, y] = position(machine, name, 0), px = X(x), py = Y(y);
      make(parent, "path", { d: `M${px} ${py}L${px - 7.2} ${py + 12.5}h14.4z`, fill: "#fff", stroke: INK });
      ground(parent, px - 12.75, py + 12.5, px + 12.75, py + 12.5, 0, 1);
    }
  }
  function drawScale(parent) {
    const long = view.scale * view.bar.length, x = 22, y = view.height - 12;
    make(parent, "path", { d: `M${x} ${y - 3}v6m0 -3h${long}m0 -3v6`, stroke: INK, fill: "none" });
    make(parent, "text", { x: x + long / 2, y: y - 4, "text-anchor": "middle", class: "scale" }, view.bar.text);
  }

  // ---- moving parts: each function creates a part once and returns a function that sets its crank angle

  function bar(parent, machine, link, edge, fill) {
    const lines = [[edge, 10.5], [fill, 8.3]].map(([colour, width]) => make(parent, "polygon", {
      fill: link.corners.length > 2 ? colour : "none", stroke: colour, "stroke-width": width,
      "stroke-linejoin": "round", "stroke-linecap": "round",
    }));
    lines[1].dataset.link = link.name;
    return (at) => {
      const corners = link.corners.map((name) => spot(position(machine, name, at))).join(" ");
      lines.forEach((line) => line.setAttribute("points", corners));
    };
  }
  function block(parent, machine, link, edge, fill, dark) {
    const turn = (at) => {
      if (!link.block) return 0;
      const [x, y] = position(machine, link.name, at);
      return (-Math.atan2(y, x) * 180) / Math.PI;
    };
    const arms = link.arms.map((name) => [name, make(parent, "line", { stroke: dark, "stroke-width": 4.5 })]);
    const box = link.block
      ? make(parent, "rect", { x: -10.5, y: -7, width: 21, height: 14, fill: fill, stroke: edge, "stroke-width": 1.3 })
      : make(parent, "circle", { r: 7, fill: fill, stroke: edge, "stroke-width": 1.3 });
    return (at) => {
      const pin = position(machine, link.pin, at), [x1, y1] = pin;
      box.setAttribute("transform", `translate(${spot(pin)}) rotate(${turn(at)})`);
      arms.forEach(([name, arm]) => {
        const [x2, y2] = position(machine, name, at);
        set(arm, { x1: X(x1), y1: Y(y1), x2: X(x2), y2: Y(y2) });
      });
    };
  }
  function slot(parent, machine, entry, edge) { // the two rails of a guide on a moving link
    const rails = [1, -1].map(() => make(parent, "line", { stroke: edge, "stroke-width": 1 }));
    return (at) => {
      const [c, s] = position(machine, entry.on, at), [ox, oy] = position(machine, entry.origin, at);
      const size = Math.hypot(c, s), turned = ([x, y]) => [ox + (c * x - s * y) / size, oy + (s * x + c * y) / size];
      const [[x1, y1], [x2, y2]] = entry.ends.map(turned).map(([x, y]) => [X(x), Y(y)]);
      const angle = Math.atan2(s, c) + entry.angle, tx = Math.cos(angle), ty = -Math.sin(angle);
      rails.forEach((rail, k) => {
        const nx = 7.8 * (1 - 2 * k) * ty, ny = -7.8 * (1 - 2 * k) * tx;
        set(rail, { x1: x1 - 18.5 * tx + nx, y1: y1 - 18.5 * ty + ny, x2: x2 + 18.5 * tx + nx, y2: y2 + 18.5 * ty + ny });
      });
    };
  }
  function wheel(parent, machine, entry, edge) { // a pitch circle, and a spoke that shows its rotation
    const circle = make(parent, "circle", { r: entry.radius * view.scale, fill: "none", stroke: edge,
      "stroke-dasharray": "9 2 2 2" });
    const spoke = machine.headings[entry.link] ? make(parent, "line", { stroke: edge }) : null;
    return (at) => {
      const [x, y] = position(machine, entry.point, at);
      set(circle, { cx: X(x).toFixed(3), cy: Y(y).toFixed(3) });
      if (!spoke) return;
      const [c, s] = position(machine, entry.link, at), long = entry.radius / Math.hypot(c, s);
      set(spoke, { x1: X(x), y1: Y(y), x2: X(x + long * c), y2: Y(y + long * s) });
    };
  }
  function belt(parent, machine, [one, other, crossed], edge) { // the two straight strands
    const strands = [1, -1].map((side) => [side, make(parent, "line", { stroke: edge })]);
    const far = crossed ? -other.radius : other.radius;
    return (at) => {
      const [x1, y1] = position(machine, one.point, at), [x2, y2] = position(machine, other.point, at);
      const lean = Math.acos(Math.max(-1, Math.min(1, (one.radius - far) / Math.hypot(x2 - x1, y2 - y1))));
      for (const [side, strand] of strands) {
        const out = Math.atan2(y2 - y1, x2 - x1) + side * lean, c = Math.cos(out), s = Math.sin(out);
        set(strand, { x1: X(x1 + one.radius * c), y1: Y(y1 + one.radius * s), x2: X(x2 + far * c), y2: Y(y2 + far * s) });
      }
    };
  }
  function tie(parent, machine, entry, edge) { // a spring or a damper between two points
    const shape = make(parent, "path", { fill: "none", stroke: edge, "stroke-width": 1.3, "stroke-linejoin": "round" });
    const text = make(parent, "text", { fill: edge, "text-anchor": "middle" }, entry.text);
    return (at) => {
      const [[x1, y1], [x2, y2]] = entry.ends.map((name) => position(machine, name, at)).map(([x, y]) => [X(x), Y(y)]);
      const size = Math.hypot(x2 - x1, y2 - y1) || 1, tx = (x2 - x1) / size, ty = (y2 - y1) / size;
      const place = ([f, d, v]) => `${(x1 + f * (x2 - x1) + d * tx + v * ty).toFixed(2)} `
        + `${(y1 + f * (y2 - y1) + d * ty - v * tx).toFixed(2)}`;
      shape.setAttribute("d", entry.lines.map((line) => `M${line.map(place).join("L")}`).join(""));
      const side = tx < 0 ? -1 : 1; // above the middle
      set(text, { x: ((x1 + x2) / 2 + 12 * side * ty).toFixed(2), y: ((y1 + y2) / 2 - 12 * side * tx + 3).toFixed(2) });
    };
  }
  function weight(parent, machine, link, name, radius, edge, fill) {
    const arm = make(parent, "line", { stroke: fill, "stroke-width": 4.5 });
    const disc = make(parent, "circle", { r: radius === null ? 7 : radius * view.scale, fill: fill, stroke: edge,
      "stroke-width": 1.1, "fill-opacity": 0.9 });
    return (at) => {
      const [a, b] = position(machine, link.pin, at), [x, y] = position(machine, name, at);
      set(arm, { x1: X(a), y1: Y(b), x2: X(x), y2: Y(y) });
      set(disc, { cx: X(x), cy: Y(y) });
    };
  }
  function dot(parent, machine, name, radius, look) {
    const circle = make(parent, "circle", Object.assign({ r: radius, "stroke-width": 1.1 }, look));
    circle.dataset.point = name;
    return (at) => {
      const [x, y] = position(machine, name, at);
      set(circle, { cx: X(x).toFixed(3), cy: Y(y).toFixed(3) });
    };
  }
  function centre(parent, machine, name) {
    const symbol = make(parent, "g", {});
    make(symbol, "circle", { r: 5, fill: "#fff", stroke: "#000", "stroke-width": 0.9 });
    make(symbol, "path", { d: "M0 0V-5A5 5 0 0 1 5 0H-5A5 5 0 0 0 0 5z", fill: "#000" });
    symbol.dataset.centre = name;
    return (at) => symbol.setAttribute("transform", `translate(${spot(position(machine, name, at))})`);
  }
  function away(machine, entry, at) { // direction from a point to its name, away from the links at this point
    const [x, y] = position(machine, entry.point, at);
    let sx = 0, sy = 0, first = null;
    for (const name of entry.near) {
      const [a, b] = position(machine, name, at), dx = a - x, dy = y - b, size = Math.hypot(dx, dy) || 1;
      first = first || [dx / size, dy / size];
      sx += dx / size;
      sy += dy / size;
    }
    const across = first ? [first[1], -first[0]] : [0, -1];
    let ox = -sx + 0.45 * across[0], oy = -sy + 0.45 * across[1];
    const size = Math.hypot(ox, oy) || 1;
    return [ox / size, oy / size];
  }
  function nameOf(parent, machine, entry) {
    const text = make(parent, "text", { "text-anchor": "middle", fill: entry.faint ? GREY : INK }, entry.text);
    const wide = 2.3 * (entry.text.length - 1);
    const still = entry.pivot ? [0, 1] : entry.guide === null ? null : [Math.sin(entry.guide), Math.cos(entry.guide)];
    const lead = entry.pivot ? 25 : still ? 22 : LEAD; // clear of ground or guide
    return (at) => {
      const [x, y] = position(machine, entry.point, at), [ox, oy] = still || away(machine, entry, at);
      const px = Math.min(Math.max(X(x) + (lead + wide) * ox, 4 + 2 * wide), view.width - 4 - 2 * wide);
      set(text, { x: px.toFixed(2), y: Math.min(Y(y) + lead * oy + 3, view.height - 4).toFixed(2) });
    };
  }
  function acts(load, at) {
    if (!load.windows) return true;
    const cycle = (end * Math.PI) / 180, angle = (at * Math.PI) / 180;
    const since = (a) => ((a % cycle) + cycle) % cycle;
    return load.windows.some(([on, off]) => since(angle - on) < (off < cycle ? since(off - on) : off - on));
  }
  function covered(machine, at) { // positions that a label should not cover: joints, links, other labels
    const inside = ([x, y]) => [X(x), Y(y)], found = [];
    for (const name of [...machine.joints, ...machine.centres]) {
      const place = inside(position(machine, name, at));
      found.push(place, place, place, place);
    }
    for (const name of machine.pivots) {
      const [x, y] = inside(position(machine, name, at));
      found.push([x, y + 14], [x, y + 25], [x, y + 25]);
    }
    machine.guides.forEach(([x1, y1, x2, y2], k) => {
      const a = machine.guide_angles[k], nx = -10 * Math.sin(a), ny = -10 * Math.cos(a);
      for (let t = 0; t <= 1; t += 0.05) {
        const x = X(x1 + t * (x2 - x1)), y = Y(y1 + t * (y2 - y1));
        found.push([x + nx, y + ny], [x - nx, y - ny]);
      }
    });
    for (const entry of machine.names) {
      if (entry.guide === null) continue;
      const [x, y] = inside(position(machine, entry.point, at));
      const under = [x + 22 * Math.sin(entry.guide), y + 22 * Math.cos(entry.guide)];
      found.push(under, under, under, under);
    }
    for (const link of machine.links) {
      const corners = link.corners.map((name) => inside(position(machine, name, at)));
      corners.forEach(([x1, y1], k) => {
        const [x2, y2] = corners[(k + 1) % corners.length];
        for (let t = 0; t < 1; t += 0.05) found.push([x1 + t * (x2 - x1), y1 + t * (y2 - y1)]);
      });
    }
    return found;
  }
  function load(parent, machine, entry) {
    const group = make(parent, "g", { class: "load" });
    const shaft = make(group, "path", { fill: "none", stroke: LOAD, "stroke-width": 2 });
    const head = make(group, "path", { fill: LOAD, d: "M0 0L-9 3.6V-3.6z" });
    const text = make(group, "text", { fill: LOAD, "text-anchor": "middle" }, [entry.text].flat()[0]);
    let chosen = 0;
    const show = (at, x1, y1, x2, y2, path, places) => { // the label has the least overlap, and moves only if necessary
      const angle = (Math.atan2(y2 - y1, x2 - x1) * 180) / Math.PI;
      shaft.setAttribute("d", path);
      head.setAttribute("transform", `translate(${x2.toFixed(2)} ${y2.toFixed(2)}) rotate(${angle.toFixed(2)})`);
      const half = text.getComputedTextLength() / 2;
      const there = places(half).map(([tx, ty]) => [Math.min(Math.max(tx, half + 4), view.width - half - 4),
        Math.min(Math.max(ty + 3, 11), view.height - 6)]);
      const solid = covered(machine, at);
      const cost = there.map(([tx, ty]) =>
        solid.filter(([x, y]) => Math.abs(x - tx) < half + 6 && Math.abs(y - ty + 3) < 10).length);
      if (cost[chosen] > 0) chosen = cost.indexOf(Math.min(...cost));
      set(text, { x: there[chosen][0].toFixed(2), y: there[chosen][1].toFixed(2) });
    };
    const straight = (at, px, py) => {
      const along = entry.along && (Array.isArray(entry.along[0]) ? entry.along[cell(at).i] : entry.along);
      let [dx, dy] = along || velocity(machine, entry.point, at).map((part) => -part);
      const size = Math.hypot(dx, dy);
      if (size < 1e-12) return false;
      dx /= size;
      dy /= -size;
      let from = -52.5;
      const tx = px + from * dx, ty = py + from * dy;
      if (tx < 8 || ty < 8 || tx > view.width - 8 || ty > view.height - 8) from = 6.5;
      const x1 = px + from * dx, y1 = py + from * dy, x2 = x1 + 46 * dx, y2 = y1 + 46 * dy;
      const path = `M${x1.toFixed(2)} ${y1.toFixed(2)}L${(x2 - 7 * dx).toFixed(2)} ${(y2 - 7 * dy).toFixed(2)}`;
      const sign = Math.sign(from), [ux, uy] = from < 0 ? [x1, y1] : [x2, y2], mx = (x1 + x2) / 2, my = (y1 + y2) / 2;
      show(at, x1, y1, x2, y2, path, (half) => [
        [ux + sign * (10 + half * Math.abs(dx)) * dx, uy + sign * 10 * dy],
        ...[8, -8, 22, -22].map((off) => [mx - (off + Math.sign(off) * half * Math.abs(dy)) * dy, my + 1.5 * off * dx]),
      ]);
      return true;
    };
    const round = (at, px, py) => {
      const sense = Array.isArray(entry.turn) ? entry.turn[cell(at).i] : entry.turn;
      if (!sense) return false;
      const on = (degrees) => {
        const a = (degrees * Math.PI) / 180;
        return [px + 15 * Math.cos(a), py - 15 * Math.sin(a)];
      };
      const [from, to, near] = sense > 0 ? [-25, 205, 190] : [205, -25, -10];
      const [x1, y1] = on(from), [x2, y2] = on(to), [x3, y3] = on(near);
      const path = `M${x1.toFixed(2)} ${y1.toFixed(2)}A15 15 0 1 ${sense > 0 ? 0 : 1} `
        + `${x3.toFixed(2)} ${y3.toFixed(2)}`;
      show(at, x3, y3, x2, y2, path, (half) => [[px, py - 24], [px + half + 22, py], [px - half - 22, py]]);
      return true;
    };
    return (at) => {
      const [x, y] = position(machine, entry.point, at);
      if (Array.isArray(entry.text)) text.textContent = entry.text[cell(at).i];
      const shown = acts(entry, at) && (entry.turn === null ? straight : round)(at, X(x), Y(y));
      group.style.display = shown ? "" : "none";
    };
  }
  function drawMachine(parent, machine, old) {
    const moves = [];
    if (!old) {
      drawPaths(parent, machine, { stroke: "#c3ccd4", "stroke-width": 0.9 });
      drawFrame(parent, machine);
    } else {
      drawPaths(parent, machine, { stroke: "#b5b5b5", "stroke-width": 0.8, "stroke-dasharray": "3 2" });
    }
    const solid = make(parent, "g", {});
    const layer = (link) => (link.upon ? 2 : link.corners.length === 1 ? 0 : 1); // a slider is in front of its guide
    const order = [...machine.links].sort((a, b) => layer(a) - layer(b));
    for (const link of order) {
      const [edge, fill, dark] = old ? ["#a8a8a8", "#f3f3f3", "#f3f3f3"] : [link.colour, link.fill, link.dark];
      for (const name in link.weights) moves.push(weight(solid, machine, link, name, link.weights[name], edge, dark));
      moves.push((link.block || link.corners.length === 1 ? block : bar)(solid, machine, link, edge, fill, dark));
    }
    for (const entry of machine.slots) {
      const on = machine.links.find((link) => link.name === entry.on);
      moves.push(slot(solid, machine, entry, old ? "#a8a8a8" : on.colour));
    }
    const ink = old ? "#a8a8a8" : INK;
    for (const entry of machine.wheels) {
      const on = machine.links.find((link) => link.name === entry.link);
      moves.push(wheel(solid, machine, entry, old || !on ? "#a8a8a8" : on.colour));
    }
    for (const entry of machine.belts) moves.push(belt(solid, machine, entry, GREY));
    for (const entry of machine.ties) moves.push(tie(solid, machine, entry, old ? "#a8a8a8" : LOAD));
    for (const name of machine.dots) moves.push(dot(solid, machine, name, 2, { fill: ink, stroke: ink }));
    for (const name of machine.joints) moves.push(dot(solid, machine, name, 3.4, { fill: "#fff", stroke: ink }));
    if (!old) {
      for (const name of machine.centres) moves.push(centre(solid, machine, name));
      const names = make(parent, "g", { id: "names" });
      for (const entry of machine.names) moves.push(nameOf(names, machine, entry));
      for (const entry of machine.loads) moves.push(load(parent, machine, entry));
    }
    return (at) => {
      const { i, j } = cell(at), gone = machine.lost.includes(i) || machine.lost.includes(j);
      parent.style.opacity = gone ? 0.2 : "";
      moves.forEach((move) => move(at));
      return !gone;
    };
  }

  // ---- diagrams: a line at the crank angle, a dot on every hodograph; a click sets the angle

  function cursors() {
    const moves = [];
    for (const panel of document.querySelectorAll("g[data-panel]")) {
      const [x0, y0, x1, y1] = panel.dataset.panel.split(" ").map(Number);
      const last = Number(panel.dataset.end), svg = panel.ownerSVGElement;
      const line = make(panel, "line", { class: "cursor", y1: y0, y2: y1 });
      moves.push((at) => {
        const x = (x0 + ((x1 - x0) * at) / last).toFixed(2);
        set(line, { x1: x, x2: x });
      });
      const pad = make(panel, "rect", { class: "pad", x: x0, y: y0, width: x1 - x0, height: y1 - y0 });
      const pick = (event) => {
        const inside = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
        go((Math.min(Math.max((inside.x - x0) / (x1 - x0), 0), 1)) * last);
      };
      pad.addEventListener("pointerdown", (event) => { play(false); pick(event); });
      pad.addEventListener("pointermove", (event) => { if (event.buttons === 1) pick(event); });
    }
    for (const group of document.querySelectorAll("g.hodograph")) {
      const path = group.querySelector("path");
      const ends = path.getAttribute("d").match(/-?[\d.]+ -?[\d.]+/g).map((pair) => pair.split(" ").map(Number));
      if (ends.length !== view.angles + 1) continue;
      const mark = make(group, "circle", { class: "spot", r: 3, fill: path.style.stroke });
      moves.push((at) => {
        const place = ((at % end) / end) * view.angles, i = Math.floor(place), t = place - i;
        set(mark, { cx: ((1 - t) * ends[i][0] + t * ends[i + 1][0]).toFixed(2),
          cy: ((1 - t) * ends[i][1] + t * ends[i + 1][1]).toFixed(2) });
      });
    }
    return moves;
  }

  // ---- time: that of the cycle, slowed down; proportional to the angle without an actual motion

  function timeOf(at) {
    if (!view.time) return at / end;
    const { i, t } = cell(at);
    return ((1 - t) * view.time[i] + t * view.time[i + 1]) / view.time[view.angles];
  }
  function angleOf(share) {
    if (!view.time) return share * end;
    const time = share * view.time[view.angles];
    let low = 0, high = view.angles;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (view.time[middle] <= time) low = middle; else high = middle;
    }
    return step * (low + (time - view.time[low]) / (view.time[low + 1] - view.time[low]));
  }

  // ---- controls

  const slider = find("angle"), shown = find("angle-shown"), button = find("play"), pace = find("pace");
  let angle = view.start, before = 0, running = false;

  function go(at) {
    angle = at;
    const text = at.toFixed(1).replace(/\.0$/, "") + "°";
    slider.value = at;
    slider.setAttribute("aria-valuetext", text);
    shown.textContent = text;
    find("stage-angle").textContent = "φ = " + text;
    const whole = moves.map((move) => move(at));
    find("stage-note").textContent = whole[0] ? "" : "cannot be assembled at this angle";
    marks.forEach((mark) => mark(at));
  }
  function frame(now) {
    if (!running) return;
    const share = timeOf(angle) + Math.min(now - before, 200) / (1000 * Number(pace.value));
    before = now;
    go(angleOf(share % 1));
    requestAnimationFrame(frame);
  }
  function play(on) {
    if (on === running) return;
    running = on;
    button.textContent = on ? "Pause" : "Play";
    before = performance.now();
    if (on) requestAnimationFrame(frame);
  }

  set(stage, { viewBox: `0 0 ${view.width} ${view.height}` });
  const groups = view.machines.map(() => null);
  for (let i = groups.length - 1; i >= 0; i--) groups[i] = make(stage, "g", { class: i ? "before" : "machine" });
  const moves = view.machines.map((machine, i) => drawMachine(groups[i], machine, i > 0));
  drawScale(stage);
  make(stage, "text", { id: "stage-angle", x: view.width - 12, y: 18, "text-anchor": "end" });
  make(stage, "text", { id: "stage-note", x: view.width - 12, y: 32, "text-anchor": "end", fill: LOAD });
  const marks = cursors();

  button.addEventListener("click", () => play(!running));
  slider.addEventListener("input", () => { play(false); go(Number(slider.value)); });
  find("show-names").addEventListener("change", (event) => {
    find("names").style.display = event.target.checked ? "" : "none";
  });
  const old = find("show-before");
  if (old) {
    old.addEventListener("change", () => document.body.classList.toggle("alone", !old.checked));
    document.body.classList.toggle("alone", !old.checked);
  }
  for (const control of document.querySelectorAll("#controls [disabled]")) control.disabled = false;
  go(angle);
})();
