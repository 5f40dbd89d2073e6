// The map that answers to mouse and keyboard. Data: whole numbers, see explorer.rs.
(function () {
  "use strict";
  var box = document.getElementById("explore");
  var D = JSON.parse(document.getElementById("data").textContent);
  var n = D.id.length;
  if (!box || !n) return;
  var canvas = document.getElementById("wall"), tip = document.getElementById("tip");
  var panel = document.getElementById("stone"), pen = canvas.getContext("2d");
  var control = function (id) { return document.getElementById(id); };
  var signed = { along: 1, up: 1, out: 1 };
  var units = { rotation: "mrad", confidence: "%" };
  var byId = new Map(), shapes = new Array(n), boxes = new Float64Array(4 * n);
  var wall = [Infinity, Infinity, -Infinity, -Infinity];
  var view = { scale: 1, x: 0, y: 0 }, width = 0, height = 0, hover = -1, chosen = -1, waiting = false;

  for (var i = 0; i < n; i++) { byId.set(D.id[i], i); build(i); }
  if (!isFinite(wall[0])) return;
  var squares = index();

  // Polygons in millimetres, y up.
  function build(i) {
    var r = D.rings[i], x = 0, y = 0, path = new Path2D(), b = [Infinity, Infinity, -Infinity, -Infinity], points = [];
    for (var k = 0; k + 1 < r.length; k += 2) {
      x += r[k]; y += r[k + 1];
      if (k) path.lineTo(x, y); else path.moveTo(x, y);
      points.push(x, y);
      b = [Math.min(b[0], x), Math.min(b[1], y), Math.max(b[2], x), Math.max(b[3], y)];
    }
    path.closePath();
    shapes[i] = { path: path, points: points };
    boxes.set(b, 4 * i);
    if (points.length) for (var j = 0; j < 4; j++) wall[j] = (j < 2 ? Math.min : Math.max)(wall[j], b[j]);
  }

  // Stones by squares of one metre.
  function index() {
    var map = new Map();
    for (var i = 0; i < n; i++) {
      for (var x = Math.floor(boxes[4 * i] / 1000); x <= Math.floor(boxes[4 * i + 2] / 1000); x++) {
        for (var y = Math.floor(boxes[4 * i + 1] / 1000); y <= Math.floor(boxes[4 * i + 3] / 1000); y++) {
          var key = x + " " + y;
          if (!map.has(key)) map.set(key, []);
          map.get(key).push(i);
        }
      }
    }
    return map;
  }

  function at(px, py) {
    var x = (px - view.x) / view.scale, y = (view.y - py) / view.scale;
    var near = squares.get(Math.floor(x / 1000) + " " + Math.floor(y / 1000)) || [];
    for (var k = 0; k < near.length; k++) if (holds(shapes[near[k]].points, x, y)) return near[k];
    return -1;
  }

  function holds(p, x, y) {
    var inside = false;
    for (var a = 0, b = p.length - 2; a < p.length; b = a, a += 2) {
      if ((p[a + 1] > y) !== (p[b + 1] > y) &&
          x < p[a] + (p[b] - p[a]) * (y - p[a + 1]) / (p[b + 1] - p[a + 1])) inside = !inside;
    }
    return inside;
  }

  // Value on the screen's unit: mm, mrad or percent.
  function value(key, i) {
    if (key === "confidence") return D.confidence[i];
    if (D.out[i] === null) return null;
    if (key === "norm") return Math.hypot(D.along[i], D.up[i], D.out[i]) / 100;
    return D[key][i] === null ? null : D[key][i] / 100;
  }

  var outcomes = ["#4f8fba", "#b8b2a6", "#d2a24c", "#8a6fb0", "#c46a5a", "#6b6f75", "#7d5a50", "#a23b72", "#3f7d6e"];
  function colour(key, i) {
    if (key === "status") return outcomes[D.state[i]];
    var v = value(key, i);
    if (v === null) return null;
    var share = v / D.limits[key];
    if (signed[key]) return D.diverging[Math.round((Math.max(-1, Math.min(1, share)) + 1) / 2 * (D.diverging.length - 1))];
    return D.sequential[Math.round(Math.max(0, Math.min(1, share)) * (D.sequential.length - 1))];
  }

  function css(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

  function draw() {
    waiting = false;
    var ratio = window.devicePixelRatio || 1, key = control("quantity").value, fade = control("fade").checked;
    var ink = css("--ink"), unknown = css("--unknown");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = css("--ground");
    pen.fillRect(0, 0, width, height);
    var world = function () { pen.setTransform(ratio * view.scale, 0, 0, -ratio * view.scale, ratio * view.x, ratio * view.y); };
    world();
    var thin = Math.max(0.4, Math.min(1.8, 25 * view.scale));
    var left = -view.x / view.scale, right = (width - view.x) / view.scale;
    var low = (view.y - height) / view.scale, high = view.y / view.scale;
    for (var i = 0; i < n; i++) {
      if (boxes[4 * i + 2] < left || boxes[4 * i] > right || boxes[4 * i + 3] < low || boxes[4 * i + 1] > high) continue;
      var fill = colour(key, i);
      pen.globalAlpha = fill && fade && key !== "status" && key !== "confidence" && key !== "limit" && !D.significant[i] ? 0.3 : 1;
      pen.fillStyle = fill || unknown;
      pen.fill(shapes[i].path);
      if (D.loose[i]) outline(i, ink, thin);
    }
    pen.globalAlpha = 1;
    if (hover >= 0) outline(hover, ink, 1.5);
    if (chosen >= 0) outline(chosen, css("--accent"), 3.5);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (control("arrows").checked) arrows(ink);
    scaleBar(ink);
    if (key !== "status") colourBar(key, ink);
    canvas.setAttribute("data-drawn", key);
  }

  function outline(i, style, px) {
    pen.globalAlpha = 1;
    pen.strokeStyle = style;
    pen.lineWidth = px / view.scale;
    pen.stroke(shapes[i].path);
  }

  function arrows(ink) {
    var taken = new Set(), longest = 0, i;
    for (i = 0; i < n; i++) if (D.significant[i]) longest = Math.max(longest, Math.hypot(D.along[i], D.up[i]));
    if (!longest) return;
    pen.beginPath();
    for (i = 0; i < n; i++) {
      if (!D.significant[i]) continue;
      var x = view.x + (boxes[4 * i] + boxes[4 * i + 2]) / 2 * view.scale;
      var y = view.y - (boxes[4 * i + 1] + boxes[4 * i + 3]) / 2 * view.scale;
      var cell = Math.round(x / 16) + " " + Math.round(y / 16);
      if (x < 0 || y < 0 || x > width || y > height || taken.has(cell)) continue;
      taken.add(cell);
      arrow(x, y, D.along[i] / longest * 44, -D.up[i] / longest * 44);
    }
    arrow(14, 16, 44, 0);
    pen.lineJoin = pen.lineCap = "round";
    pen.strokeStyle = css("--panel"); pen.lineWidth = 3.5; pen.globalAlpha = 0.7; pen.stroke();
    pen.strokeStyle = ink; pen.lineWidth = 1.3; pen.globalAlpha = 1; pen.stroke();
    label(66, 20, (longest / 100).toFixed(1) + " mm in-plane", ink);
  }

  function arrow(x, y, dx, dy) {
    var l = Math.hypot(dx, dy), h = Math.min(5, 0.45 * l) / (l || 1);
    pen.moveTo(x, y); pen.lineTo(x + dx, y + dy);
    pen.moveTo(x + dx - h * (dx - 0.6 * dy), y + dy - h * (dy + 0.6 * dx)); pen.lineTo(x + dx, y + dy);
    pen.lineTo(x + dx - h * (dx + 0.6 * dy), y + dy - h * (dy - 0.6 * dx));
  }

  function label(x, y, text, ink) {
    pen.font = "12px system-ui, sans-serif";
    pen.lineWidth = 3; pen.strokeStyle = css("--panel"); pen.lineJoin = "round";
    pen.strokeText(text, x, y);
    pen.fillStyle = ink; pen.fillText(text, x, y);
  }

  function scaleBar(ink) {
    var metres = 130 / view.scale / 1000, power = Math.pow(10, Math.floor(Math.log10(metres)));
    var nice = [5, 2, 1].map(function (s) { return s * power; }).find(function (s) { return s <= metres; }) || power;
    var px = nice * 1000 * view.scale;
    pen.fillStyle = ink; pen.fillRect(14, height - 14, px, 3);
    label(14, height - 20, nice < 1 ? Math.round(nice * 100) + " cm" : nice + " m", ink);
  }

  function colourBar(key, ink) {
    var colours = signed[key] ? D.diverging : D.sequential, w = 180, x = width - w - 16, y = height - 18;
    for (var k = 0; k < colours.length; k++) {
      pen.fillStyle = colours[k];
      pen.fillRect(x + k / colours.length * w, y, w / colours.length + 0.6, 8);
    }
    var limit = D.limits[key], unit = " " + (units[key] || "mm");
    pen.textAlign = "center";
    label(x, y - 5, signed[key] ? "\u2212" + limit : "0", ink);
    if (signed[key]) label(x + w / 2, y - 5, "0", ink);
    pen.textAlign = "right";
    label(x + w, y - 5, limit + unit, ink);
    pen.textAlign = "left";
  }

  function later() { if (!waiting) { waiting = true; requestAnimationFrame(draw); } }

  function whole() {
    var w = wall[2] - wall[0] || 1, h = wall[3] - wall[1] || 1;
    view.scale = Math.min((width - 40) / w, (height - 70) / h);
    view.x = (width - w * view.scale) / 2 - wall[0] * view.scale;
    view.y = (height - 20 + h * view.scale) / 2 + wall[1] * view.scale;
    later();
  }

  function zoom(by, px, py) {
    var s = Math.max(1e-4, Math.min(4, view.scale * by));
    view.x = px - (px - view.x) * s / view.scale;
    view.y = py - (py - view.y) * s / view.scale;
    view.scale = s;
    later();
  }

  function resize() {
    width = box.clientWidth;
    height = Math.max(300, Math.min(640, width * (wall[3] - wall[1]) / (wall[2] - wall[0] || 1) + 90));
    var ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    canvas.style.height = height + "px";
    whole();
  }

  function text(v, digits) { return v === null ? "\u2013" : (v < 0 ? "\u2212" : "") + Math.abs(v).toFixed(digits); }

  function facts(i) {
    var mm = function (key) { return text(value(key, i), 2) + " mm"; };
    var rows = [["Outcome", D.words[D.state[i]] + ": " + D.meanings[D.state[i]]]];
    if (D.out[i] !== null) {
      rows.push(["Along, up, out", [mm("along"), mm("up"), mm("out")].join(", ")],
        ["Length", mm("norm") + (D.significant[i] ? ", significant" : ", below the limit")],
        ["Detection limit", mm("limit")], ["Against the neighbours", mm("relative") + (D.loose[i] ? ", moves unlike them" : "")],
        ["Rotation", text(value("rotation", i), 2) + " mrad"]);
    }
    rows.push(["Partner", D.match[i] === null ? "none" : String(D.match[i])],
      ["Face", text(D.area[i], 0) + " cm\u00b2, " + D.points[i][0] + " and " + (D.points[i][1] === null ? "no" : D.points[i][1]) + " points, " +
        D.photos[i] + " photos, confidence " + text(D.confidence[i], 0) + " %"],
      ["Place", text((boxes[4 * i] + boxes[4 * i + 2]) / 2000, 2) + " m along, " +
        text((boxes[4 * i + 1] + boxes[4 * i + 3]) / 2000, 2) + " m up"]);
    return rows;
  }

  function choose(i, move) {
    chosen = i;
    panel.textContent = "";
    if (i >= 0) {
      var title = document.createElement("h3"), list = document.createElement("dl");
      title.textContent = "Stone " + D.id[i];
      facts(i).forEach(function (row) {
        var dt = document.createElement("dt"), dd = document.createElement("dd");
        dt.textContent = row[0]; dd.textContent = row[1];
        list.append(dt, dd);
      });
      panel.append(title, list);
      if (move) {
        view.scale = Math.max(view.scale, Math.min(width, height) / 2500);
        view.x = width / 2 - (boxes[4 * i] + boxes[4 * i + 2]) / 2 * view.scale;
        view.y = height / 2 + (boxes[4 * i + 1] + boxes[4 * i + 3]) / 2 * view.scale;
      }
    }
    later();
  }

  function showTip(i, px, py) {
    tip.hidden = i < 0;
    if (i < 0) return;
    tip.textContent = "Stone " + D.id[i] + ": " + (D.out[i] === null ? D.words[D.state[i]] :
      "along " + text(value("along", i), 1) + ", up " + text(value("up", i), 1) + ", out " + text(value("out", i), 1) +
      " mm, limit " + text(value("limit", i), 1) + " mm");
    tip.style.left = Math.min(px + 14, width - tip.offsetWidth - 4) + "px";
    tip.style.top = Math.max(0, py - 34) + "px";
  }

  var drag = null;
  canvas.addEventListener("pointerdown", function (e) {
    drag = { x: e.offsetX, y: e.offsetY, moved: false };
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointermove", function (e) {
    if (drag) {
      if (Math.hypot(e.offsetX - drag.x, e.offsetY - drag.y) > 3) drag.moved = true;
      if (drag.moved) { view.x += e.offsetX - drag.x; view.y += e.offsetY - drag.y; drag.x = e.offsetX; drag.y = e.offsetY; later(); }
      return;
    }
    var i = at(e.offsetX, e.offsetY);
    showTip(i, e.offsetX, e.offsetY);
    if (i !== hover) { hover = i; later(); }
  });
  canvas.addEventListener("pointerup", function (e) {
    if (drag && !drag.moved) choose(at(e.offsetX, e.offsetY), false);
    drag = null;
  });
  canvas.addEventListener("pointerleave", function () { hover = -1; showTip(-1); later(); });
  canvas.addEventListener("dblclick", function (e) { zoom(2, e.offsetX, e.offsetY); });
  canvas.addEventListener("wheel", function (e) {
    if (document.activeElement !== canvas && !e.ctrlKey) return;
    e.preventDefault();
    zoom(Math.exp(-e.deltaY / 400), e.offsetX, e.offsetY);
  }, { passive: false });
  canvas.addEventListener("keydown", function (e) {
    var moves = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }, move = moves[e.key];
    if (move) { view.x += move[0]; view.y += move[1]; later(); }
    else if (e.key === "+" || e.key === "=") zoom(1.5, width / 2, height / 2);
    else if (e.key === "-") zoom(1 / 1.5, width / 2, height / 2);
    else if (e.key === "Home") whole();
    else if (e.key === "Escape") choose(-1, false);
    else return;
    e.preventDefault();
  });
  control("zoom-in").addEventListener("click", function () { zoom(1.6, width / 2, height / 2); });
  control("zoom-out").addEventListener("click", function () { zoom(1 / 1.6, width / 2, height / 2); });
  control("zoom-all").addEventListener("click", whole);
  ["quantity", "fade", "arrows"].forEach(function (id) { control(id).addEventListener("change", later); });
  control("search").addEventListener("input", function () {
    var i = byId.get(Number(this.value));
    this.setAttribute("aria-invalid", String(this.value !== "" && i === undefined));
    if (this.value !== "" && i !== undefined) choose(i, true);
  });
  document.querySelectorAll("a[data-stone]").forEach(function (link) {
    link.href = "#maps";
    link.addEventListener("click", function () { choose(byId.get(Number(link.dataset.stone)), true); });
  });
  window.addEventListener("resize", resize);
  if (window.matchMedia) window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", later);
  box.hidden = false;
  resize();
}());
