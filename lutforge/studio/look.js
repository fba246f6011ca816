// --- The waveform ------------------------------------------------------------------------------------------------------

const SCOPE = 256;

function plotted(canvas, counts, height, tint) {
  const image = new ImageData(counts.length / height / 3, height), { width } = image;
  Object.assign(canvas, { width, height });
  let most = 1;
  for (const count of counts) most = Math.max(most, count);
  for (let n = 0; n < width * height; n++) {
    for (let c = 0; c < 3; c++) image.data[4 * n + c] = Math.min(255, 900 * Math.sqrt(counts[3 * n + c] / most) * tint);
    image.data[4 * n + 3] = 255;
  }
  canvas.getContext("2d").putImageData(image, 0, 0);
}

// Codes over the width of the picture: red, green and blue over each other.
function waveform(canvas, pixels, width) {
  const counts = new Uint32Array(3 * width * SCOPE);
  for (let n = 0; n < pixels.length / 4; n++) {
    for (let c = 0; c < 3; c++) counts[3 * ((255 - pixels[4 * n + c]) * width + n % width) + c] += 1;
  }
  plotted(canvas, counts, SCOPE, 0.5);
  const context = canvas.getContext("2d");
  context.fillStyle = "rgba(255,255,255,.28)";
  for (const share of [0, 0.25, 0.5, 0.75, 1]) context.fillRect(0, Math.round(share * (SCOPE - 1)), width, 1);
}

// How often each code occurs: red, green and blue over each other, the ends, which may hold most pixels, cut off.
function histogram(canvas, pixels) {
  const width = 256, height = 96, counts = [0, 1, 2].map(() => new Uint32Array(width));
  for (let n = 0; n < pixels.length; n++) if (n % 4 < 3) counts[n % 4][pixels[n]] += 1;
  const most = Math.max(1, ...counts.flatMap(channel => [...channel.subarray(1, width - 1)]));
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.globalCompositeOperation = "lighter";
  ["#d04a3a", "#3fa34d", "#4a6fe0"].forEach((colour, c) => {
    context.fillStyle = colour;
    counts[c].forEach((count, code) => {
      const tall = Math.min(height, Math.ceil(height * Math.sqrt(count / most)));
      context.fillRect(code, height - tall, 1, tall);
    });
  });
}

// --- The page's part ---------------------------------------------------------------------------------------------------

function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element && !name.startsWith("aria")) element[name] = value; else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

const KEYS = "Wheel, + and −: zoom. 0: whole picture, 1: single pixels, or double click. Drag or arrows: move. " +
  "[ and ]: wipe. G, O, W, S: graded, original, wipe, side by side. B: keep as B. C: clipping. U: unsure colours. " +
  "H: waveform and histogram. P: pipette at the middle, arrows move it, Escape lifts it.";

export function render({ model, el }) {
  // Elements
  const canvas = make("canvas", { className: "picture", tabIndex: 0, role: "application", "aria-roledescription": "picture",
    "aria-describedby": "keys" });
  const line = make("div", { className: "line", tabIndex: 0, role: "slider", "aria-label": "Wipe", "aria-valuenow": 50, "aria-valuemin": 0,
    "aria-valuemax": 100 }, make("span", { "aria-hidden": "true" }));
  const left = make("div", { className: "side left" }), right = make("div", { className: "side right" });
  const cross = make("div", { className: "cross", hidden: true });
  const empty = make("p", { className: "empty" }, "No picture yet: choose a photograph, or drop one here.");
  const words = make("span", {}), help = make("button", { type: "button" }, "Begin with the usual ones");
  const notice = make("div", { className: "notice", role: "alert", hidden: true }, words, help);
  help.addEventListener("click", () => model.send_msg("help"));
  const stage = make("div", { className: "stage" }, canvas, left, right, line, cross, empty, notice);
  const values = make("output", { className: "values", "aria-live": "off", "aria-label": "Pipette" });
  const news = make("span", { className: "news", role: "status" });
  const waves = make("canvas", { role: "img", "aria-label": "Waveform" }), shares = make("p", {});
  const bins = make("canvas", { className: "histogram", role: "img", "aria-label": "Histogram" });
  const scopes = make("aside", { className: "scopes", "aria-label": "Scopes" }, waves, bins, shares);
  const bar = make("div", { className: "bar", role: "toolbar", "aria-label": "Look" });
  const strip = make("div", { className: "strip", role: "group", "aria-label": "Photographs", hidden: true });
  const root = make("div", { className: "look" }, bar, make("div", { className: "middle" }, stage, scopes),
    make("div", { className: "foot" }, values, news), strip, make("p", { id: "keys", className: "hidden" }, KEYS));

  // Buttons, each with its key
  const buttons = {}, actions = {};
  const button = (name, words, title, key, action) => {
    const made = make("button", { type: "button", title: key ? `${title} (${key})` : title }, words);
    made.addEventListener("click", action);
    if (key) actions[key.toLowerCase()] = () => made.click();  // which does nothing where it is disabled
    buttons[name] = made;
    return made;
  };
  const toggle = (name, words, title, key) => button(name, words, title, key, () => { model[name] = !model[name]; });
  const group = (...made) => bar.append(make("div", { className: "group" }, ...made));
  const MODES = { graded: "Graded", original: "Original", wipe: "Wipe", side: "Side by side" };
  group(...Object.entries(MODES).map(([mode, words]) =>
    button(mode, words, words, words[0], () => { model.mode = mode; })));
  group(button("keep", "Keep as B", "Keep this setting as B, to compare others with", "B", () => { model.kept += 1; }),
    toggle("beside_b", "Beside B", "On the left B, not the original"));
  group(toggle("clipping", "Clipping", "Stripes over clipped colours: orange white, violet black", "C"),
    toggle("unsure", "Unsure", "Green stripes over colours that no calibration shot has shown", "U"),
    toggle("scopes", "Scopes", "Waveform: codes over the width of the picture; histogram: how often each occurs", "H"));
  group(button("fit", "Fit", "The whole picture", "0", () => fit()),
    button("one", "100 %", "A pixel of the picture on a pixel of the screen", "1", () => zoomTo(1)));
  const zoomed = make("span", { className: "zoomed" });
  bar.append(zoomed, make("span", { className: "help", title: KEYS, tabIndex: 0, role: "note", "aria-label": KEYS }, "?"));

  // The renderer
  let grader;
  try {
    grader = new WebGLGrader(canvas);
  } catch {
    const words = "This browser has no WebGL2, which grades the picture: switch on its hardware acceleration, or take another.";
    return make("p", { className: "look missing", role: "alert" }, words);
  }
  canvas.addEventListener("webglcontextlost", event => { event.preventDefault(); });
  canvas.addEventListener("webglcontextrestored", () => { grader = new WebGLGrader(canvas); open(); });

  // What is seen: the centre in pixels of the picture, and how many pixels of the screen one of the picture has.
  const view = { centre: [0, 0], zoom: 1, fitted: true };
  let number = model.number, loaded = false, quality = 1, cost = 0, moved = 0, pending = null, settle, queued = false, again = false;
  let pinned = null, hovered = null, scoped = 0, frames = 0, measured = 0, toll = 0;
  const ratio = () => window.devicePixelRatio || 1;
  let whole = () => [stage.clientWidth * ratio(), stage.clientHeight * ratio()].map(Math.round);
  const seen = () => { const [w, h] = whole(); return model.mode === "side" ? [w / 2, h] : [w, h]; };
  const other = () => model.beside_b && model.b.length ? "b" : "original";
  const opsOf = side => side === "original" ? [] : model[side];
  const nameOf = side => side === "original" ? "Original" : side === "a" ? model.a_name || "Graded" : `B: ${model.b_name}`;

  function regions(width) {
    const a = { left: 0, right: width, middle: width / 2, side: "a" }, b = { ...a, side: other() };
    if (model.mode === "original") return [b];
    if (model.mode === "graded") return [a];
    if (model.mode === "wipe") {
      const cut = Math.round(model.wipe * width);
      return [{ ...b, right: cut }, { ...a, left: cut }];
    }
    const half = Math.round(width / 2);
    return [{ ...b, right: half, middle: width / 4 }, { ...a, left: half, middle: width * 0.75 }];
  }

  function settleView() {
    const [w, h] = seen(), size = grader.size;
    const smallest = Math.min(w / size[0], h / size[1]);
    view.zoom = view.fitted ? smallest : Math.min(32, Math.max(Math.min(smallest, 1), view.zoom));
    [w, h].forEach((length, axis) => {
      const half = length / 2 / view.zoom, inside = size[axis] > 2 * half;
      view.centre[axis] = inside ? Math.min(Math.max(view.centre[axis], half), size[axis] - half) : size[axis] / 2;
      // Whole pixels fall on whole pixels.
      if (view.zoom === 1) view.centre[axis] = Math.round(view.centre[axis] - length / 2) + length / 2;
    });
    zoomed.textContent = `${(100 * view.zoom).toFixed(view.zoom < 0.1 ? 1 : 0)} %`;
  }

  // Draw at the screen's next frame; while much moves on a slow machine, with fewer pixels, and in full after it.
  function draw(moving = true) {
    if (moving) moved = performance.now();
    root.dataset.rests = false;
    if (!queued) { queued = true; requestAnimationFrame(paint); }
  }

  function paint() {
    queued = false;
    root.dataset.rests = false;
    if (!loaded || !stage.clientWidth) return;
    if (pending) { again = true; return; }
    const moving = performance.now() - moved < 150, [w, h] = whole();
    quality = moving && cost > 16 ? Math.max(0.25, Math.sqrt(16 / cost)) : 1;
    const width = Math.max(1, Math.round(w * quality)), height = Math.max(1, Math.round(h * quality));
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    settleView();
    const style = getComputedStyle(root).getPropertyValue("--surround").trim();
    const surround = [1, 3, 5].map(at => parseInt(style.slice(at, at + 2), 16) / 255);
    const shrunk = { ...view, zoom: view.zoom * width / w, surround, clipping: model.clipping, nearest: view.zoom >= 1,
      coverage: model.unsure && model.coverage.length ? model.coverage : null };
    const parts = regions(width).map(part => ({ ...part, ops: opsOf(part.side), marks: part.side !== "original" }));
    if (!complete([...parts.flatMap(part => part.ops), ...(shrunk.coverage || [])])) return;
    const began = performance.now();
    pending = { fence: grader.draw(parts, shrunk, width, height), began, number, full: quality === 1 };
    furnish(regions(w));
    watch();
  }

  function watch() {
    if (!grader.done(pending.fence)) { setTimeout(watch, 1); return; }
    const { began, full } = pending;
    if (full) cost = performance.now() - began;
    Object.assign(root.dataset, { drawn: pending.number, ms: (performance.now() - began).toFixed(1), full, frames: ++frames });
    pending = null;
    if (again) { again = false; draw(false); }
    // While a slider moves the scopes follow, for a fifth of the time at most; at its end they are of the last look.
    if (began - measured > Math.max(80, 4 * toll)) measure();
    clearTimeout(settle);
    settle = setTimeout(() => {
      if (!full) draw(false);
      measure();
      root.dataset.rests = !queued && !pending;
    }, 160);
  }

  // What lies over the picture: the line of the wipe, names of the sides, the pipette.
  function furnish(parts) {
    const share = 1 / ratio(), [first, second] = parts;
    line.hidden = model.mode !== "wipe";
    line.style.left = `${100 * model.wipe}%`;
    line.setAttribute("aria-valuenow", Math.round(100 * model.wipe));
    left.textContent = nameOf(first.side);
    right.hidden = !second;
    if (second) right.textContent = nameOf(second.side);
    left.hidden = first.right * share < 60;
    canvas.setAttribute("aria-label", `${model.title || "picture"}: ${parts.map(part => nameOf(part.side)).join(" beside ")}`);
    cross.hidden = !pinned;
    if (pinned) {
      const part = parts.at(-1);
      cross.style.left = `${((pinned[0] + 0.5 - view.centre[0]) * view.zoom + part.middle) * share}px`;
      cross.style.top = `${((pinned[1] + 0.5 - view.centre[1]) * view.zoom + whole()[1] / 2) * share}px`;
    }
  }

  function measure() {
    if (!loaded || pending) return;
    tell();
    if (!model.scopes || !scopes.clientWidth) return;
    const ops = opsOf(model.mode === "original" ? other() : "a"), width = SCOPE;
    if (!complete(ops)) return;
    const height = Math.max(1, Math.round(width * grader.size[1] / grader.size[0]));
    const began = performance.now(), pixels = grader.read(ops, width, height);
    waveform(waves, pixels, width);
    histogram(bins, pixels);
    let white = 0, black = 0;
    for (let n = 0; n < pixels.length; n += 4) {
      const codes = [pixels[n], pixels[n + 1], pixels[n + 2]];
      white += codes.includes(255); black += codes.includes(0);
    }
    const share = count => `${(400 * count / pixels.length).toFixed(1)} %`;
    shares.textContent = `${share(white)} clipped to white, ${share(black)} to black`;
    root.dataset.scoped = ++scoped;
    root.dataset.measured = number;
    measured = performance.now();
    toll = measured - began;
  }

  // The pipette
  const inside = ([x, y]) => x >= 0 && y >= 0 && x < grader.size[0] && y < grader.size[1];
  function placeOf(event) {
    const box = stage.getBoundingClientRect(), x = (event.clientX - box.left) * ratio(), [w, h] = whole();
    const part = regions(w).find(({ left, right }) => x >= left && x < right) || regions(w)[0];
    const y = (event.clientY - box.top) * ratio();
    return [view.centre[0] + (x - part.middle) / view.zoom, view.centre[1] + (y - h / 2) / view.zoom].map(Math.floor);
  }
  function tell() {
    const at = pinned || hovered;
    if (!at || !loaded || !inside(at)) { values.textContent = ""; return; }
    if (!complete([...model.a, ...model.b])) return;
    const code = side => [...grader.read(opsOf(side), 1, 1, [at[0] + 0.5, at[1] + 0.5], 1)].slice(0, 3);
    const sides = [["JPEG", "original"], ["A", "a"], ...(model.b.length ? [["B", "b"]] : [])];
    values.replaceChildren(make("span", {}, `x ${at[0]}, y ${at[1]}`));
    for (const [name, side] of sides) {
      const codes = code(side), swatch = make("i", { "aria-hidden": "true" });
      swatch.style.background = `rgb(${codes})`;
      values.append(make("span", {}, swatch, make("b", {}, name), " ", codes.join("  ")));
    }
  }

  // Moving and zooming; `at`: a place of the picture that stays where it is
  function zoomTo(zoom, at = [...view.centre]) {
    const [w, h] = seen(), smallest = Math.min(w / grader.size[0], h / grader.size[1]);
    const next = Math.min(32, Math.max(Math.min(smallest, 1), zoom));
    view.centre = view.centre.map((value, axis) => at[axis] + (value - at[axis]) * view.zoom / next);
    view.fitted = next <= smallest && smallest < 1;
    view.zoom = next;
    draw();
  }
  function fit() { view.fitted = true; draw(); }
  function pan(dx, dy) { view.centre = [view.centre[0] + dx / view.zoom, view.centre[1] + dy / view.zoom]; draw(); }
  const wipe = share => { model.wipe = Math.min(1, Math.max(0, share)); };
  const fits = () => { const [w, h] = seen(); return grader.size[0] * view.zoom <= w + 1 && grader.size[1] * view.zoom <= h + 1; };

  let drag = null;
  stage.addEventListener("pointerdown", event => {
    if (event.button > 1 || notice.contains(event.target)) return;
    const box = stage.getBoundingClientRect(), x = event.clientX - box.left;
    const near = Math.abs(x - model.wipe * box.width) < 14;
    drag = { x: event.clientX, y: event.clientY, far: 0, wipes: model.mode === "wipe" && event.button === 0 && (near || fits()) };
    stage.setPointerCapture(event.pointerId);
    (event.target.closest(".line") || canvas).focus({ preventScroll: true });
  });
  stage.addEventListener("pointermove", event => {
    hovered = placeOf(event);
    if (drag) {
      const dx = event.clientX - drag.x, dy = event.clientY - drag.y, box = stage.getBoundingClientRect();
      drag.far += Math.abs(dx) + Math.abs(dy);
      Object.assign(drag, { x: event.clientX, y: event.clientY });
      if (drag.wipes && drag.far > 2) wipe((event.clientX - box.left) / box.width);
      else if (!drag.wipes) pan(-dx * ratio(), -dy * ratio());
    } else if (!pinned && !pending) tell();
  });
  stage.addEventListener("pointerup", event => {
    if (drag && drag.far < 3 && event.button === 0) pin(pinned ? null : placeOf(event));
    drag = null;
  });
  stage.addEventListener("pointercancel", () => { drag = null; });
  stage.addEventListener("pointerleave", () => { hovered = null; if (!drag) tell(); });
  stage.addEventListener("dblclick", event => {
    pinned = null;
    if (view.fitted) { const at = placeOf(event); zoomTo(1, at); } else fit();
  });
  stage.addEventListener("wheel", event => {
    event.preventDefault();
    const at = placeOf(event).map(value => value + 0.5);
    zoomTo(view.zoom * Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), at);
  }, { passive: false });

  const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const pin = place => { pinned = place; draw(false); tell(); };
  Object.assign(actions, {
    "+": () => zoomTo(view.zoom * 1.25), "=": () => zoomTo(view.zoom * 1.25), "-": () => zoomTo(view.zoom / 1.25),
    "[": () => wipe(model.wipe - 0.02), "]": () => wipe(model.wipe + 0.02),
    p: () => pin(view.centre.map(Math.floor)), escape: () => pin(null),
  });
  stage.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = STEPS[event.key], far = event.shiftKey ? 10 : 1;
    const act = step || actions[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    if (!step) act();
    else if (event.target === line) wipe(model.wipe + 0.01 * far * (step[0] - step[1]));
    else if (pinned) {
      const next = [pinned[0] + far * step[0], pinned[1] + far * step[1]];
      if (inside(next)) pin(next);
    } else pan(60 * ratio() * step[0], 60 * ratio() * step[1]);
  });

  // The film strip: one stop of the Tab key, in which the arrows move
  function lay() {
    strip.replaceChildren(...model.strip.map(({ name, url }) => {
      const shown = make("img", { src: url, alt: "", loading: "lazy", draggable: false });
      const frame = make("button", { type: "button", title: name, "aria-label": name }, shown);
      frame.addEventListener("click", () => { model.chosen = name; });
      return frame;
    }));
    strip.hidden = !model.strip.length;
    mark();
  }
  function mark() {
    const frames = [...strip.children], at = Math.max(0, model.strip.findIndex(({ name }) => name === model.present));
    frames.forEach((frame, n) => {
      frame.tabIndex = n === at ? 0 : -1;
      frame.setAttribute("aria-current", model.strip[n].name === model.present);
    });
    frames[at]?.scrollIntoView({ block: "nearest", inline: "nearest" });
  }
  strip.addEventListener("keydown", event => {
    const step = STEPS[event.key], frames = [...strip.children], next = frames[frames.indexOf(event.target) + (step?.[0] || 0)];
    if (step?.[0] && next) { event.preventDefault(); next.focus(); }
  });
  model.on("strip", lay);
  model.on("present", mark);

  // What comes from Python
  const decode = bytes => createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  let opening = 0, size = [0, 0];
  async function open() {
    const mine = ++opening;
    empty.hidden = Boolean(model.picture && model.picture.byteLength);
    if (!empty.hidden) { loaded = false; return; }
    const began = performance.now();
    try {
      const bitmap = await decode(model.picture);
      if (mine !== opening) return;
      const same = size[0] === bitmap.width && size[1] === bitmap.height;
      await grader.load(bitmap);
      size = grader.size;
      if (!same) { view.fitted = true; pinned = null; }
      loaded = true;
      news.textContent = "";
      root.dataset.opened = `${bitmap.width} × ${bitmap.height} in ${(performance.now() - began).toFixed(0)} ms`;
      draw(false);
    } catch (error) {
      news.textContent = "This picture cannot be shown: the browser does not decode it.";
      console.warn(error);
    }
  }
  let asked = 0, lacking = false;
  // Whether all tables have come; those that have not are asked for, at most every 200 ms.
  function complete(ops) {
    const keys = grader.missing(ops);
    lacking = keys.length > 0;
    if (lacking && performance.now() - asked > 200) { asked = performance.now(); model.send_msg(keys); }
    return !lacking;
  }
  function arrived(tables) {
    const began = performance.now();
    tables.forEach(table => grader.put(table));
    root.dataset.upload = (performance.now() - began).toFixed(1);
    if (lacking) { draw(); tell(); }
  }
  function changed() {
    stand();
    grader.keep(model.a, model.b, model.coverage);
    number = model.number;  // which came before the look
    moved = performance.now();
    paint();  // not a frame later
  }
  const pressed = () => { stand(); draw(); };
  function stand() {
    for (const mode of Object.keys(MODES)) buttons[mode].setAttribute("aria-pressed", model.mode === mode);
    for (const name of ["beside_b", "clipping", "unsure", "scopes"]) {
      buttons[name].setAttribute("aria-pressed", model[name]);
    }
    buttons.beside_b.disabled = !model.b.length;
    buttons.unsure.disabled = !model.coverage.length;
    scopes.hidden = !model.scopes;
    notice.hidden = !model.notice;
    words.textContent = model.notice;
  }
  model.on("picture", open);
  model.on("msg:custom", arrived);
  model.on("notice", stand);
  model.on(["a", "b", "coverage"], changed);
  model.on("wipe", () => draw());
  model.on(["mode", "beside_b", "clipping", "unsure", "scopes"], pressed);
  model.on(["a_name", "b_name", "title"], () => { if (loaded) furnish(regions(whole()[0])); });
  const sizes = new ResizeObserver(([entry]) => {
    const exact = entry.devicePixelContentBoxSize?.[0];  // not in Safari
    if (exact) whole = () => [exact.inlineSize, exact.blockSize];
    draw(false);
  });
  try { sizes.observe(stage, { box: "device-pixel-content-box" }); } catch { sizes.observe(stage); }
  model.on("remove", () => sizes.disconnect());
  lay(); pressed(); changed(); open();
  return root;
}
