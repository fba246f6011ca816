const FIRST_VIEW = { eye: { x: 1.6, y: -1.6, z: 0.9 }, up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: -0.12 } };
let loading;

function load(address) {
  loading ??= new Promise((done, fail) => {
    const script = document.createElement("script");
    script.src = address;
    script.onload = () => done(window.Plotly);
    script.onerror = () => fail(new Error(`${address} cannot be read`));
    document.head.append(script);
  });
  return loading;
}

// Axes: R to the right, B to the back, G up, so that a slice of constant luminance lies nearly flat.
function traces({ after, change, outline, centres, cube }, ink, size) {
  const line = (ends) => [0, 2, 1].map((channel) => ends.flatMap((two) => [...two.map((end) => end[channel]), null]));
  const [x, y, z] = line(cube);
  const at = ([r, g, b]) => ({ x: r, y: b, z: g });
  return [
    { type: "surface", ...at(after), surfacecolor: change, colorscale: "Cividis", cmin: 0, showlegend: false,
      cmax: Math.max(0.02, ...change.flat()), colorbar: { thickness: size, len: 0.7, title: { text: "change" } },
      hovertemplate: "R %{x:.3f}, G %{z:.3f}, B %{y:.3f}<br>moved by %{surfacecolor:.4f}" },
    { type: "scatter3d", mode: "lines", x, y, z, line: { color: ink, width: 1 }, hoverinfo: "skip", showlegend: false },
    { type: "scatter3d", mode: "lines", ...at(outline), line: { color: "#4f83e0", width: 5 }, name: "the slice" },
    { type: "scatter3d", mode: "markers", ...at(centres), marker: { color: "#e0503c", size: size / 6 }, name: "control points" },
  ];
}

function layout(title, ink, paper, size) {
  const axis = (text) => ({ title: { text }, range: [-0.05, 1.05], color: ink, gridcolor: "#8c8c8c", zeroline: false });
  return {
    title: { text: title, font: { size } }, font: { color: ink, family: "system-ui, sans-serif", size: 0.85 * size },
    paper_bgcolor: paper, margin: { l: 0, r: 0, t: 2.2 * size, b: 0 }, uirevision: "kept",
    legend: { x: 0, y: 0, bgcolor: "rgba(0, 0, 0, 0)", itemclick: false },
    scene: { xaxis: axis("R"), yaxis: axis("B"), zaxis: axis("G"), aspectmode: "cube", camera: FIRST_VIEW,
      dragmode: false },
  };
}

const STEP = Math.PI / 36;
const KEYS = {  // what a key turns around and up, in radians, and how much nearer it goes
  ArrowLeft: [STEP, 0, 1], ArrowRight: [-STEP, 0, 1], ArrowUp: [0, -STEP, 1], ArrowDown: [0, STEP, 1],
  "+": [0, 0, 1.15], "=": [0, 0, 1.15], "-": [0, 0, 1 / 1.15],
};

function turned({ eye, up, center }, around, upward, nearer) {
  const far = Math.hypot(eye.x, eye.y, eye.z), distance = Math.min(Math.max(far / nearer, 0.3), 8);
  const angle = Math.atan2(eye.y, eye.x) + around;
  const height = Math.min(Math.max(Math.asin(eye.z / far) + upward, -1.55), 1.55);
  const flat = distance * Math.cos(height);
  return { up, center, eye: {
    x: flat * Math.cos(angle), y: flat * Math.sin(angle), z: distance * Math.sin(height) } };
}

export function render({ model }) {
  const make = (tag, parent, name) => {
    const node = document.createElement(tag);
    if (name) node.className = name;
    parent?.append(node);
    return node;
  };
  const root = make("div", null, "all"), row = make("div", root, "line"), drawing = make("div", root, "drawing");
  const told = make("span", row);
  drawing.tabIndex = 0;
  drawing.setAttribute("role", "application");
  const buttons = ["png", "svg"].map((format) => {
    const button = make("button", row);
    button.textContent = `Save as ${format.toUpperCase()}`;
    button.addEventListener("click", () => window.Plotly.downloadImage(drawing, {
      format, filename: model.surface.title.replace(/[^\w-]+/g, "_"), scale: 2,
      width: drawing.clientWidth, height: drawing.clientHeight }));
    return button;
  });
  const say = (words) => { told.textContent = words; };
  const show = (shown) => [drawing, ...buttons].forEach((each) => { each.style.display = shown ? "" : "none"; });
  const draw = async () => {
    const there = Boolean(model.surface.after);
    if (!there || !make("canvas").getContext("webgl")) {
      show(false);
      say(there ? "This browser has no WebGL: the slices show the same map, as arrows." : model.missing);
      return;
    }
    show(true);
    say("Drag or arrow keys turn, wheel or + and − zoom, 0 goes back.");
    drawing.setAttribute("aria-label", `${model.surface.title}: arrow keys turn, + and − zoom, 0 goes back`);
    const Plotly = await load(model.library);
    const style = getComputedStyle(root), paper = style.getPropertyValue("--mui-palette-background-paper");
    const size = parseFloat(style.fontSize);  // letters grow with the window
    await Plotly.react(drawing, traces(model.surface, style.color, size),
      layout(model.surface.title, style.color, paper, size), { displayModeBar: false });
    await Plotly.Plots.resize(drawing);
  };
  // plotly's own turning runs on by itself, too far where a frame takes long
  const look = (camera) => window.Plotly.relayout(drawing, { "scene.camera": camera });
  const turn = (...by) => look(turned(drawing.layout.scene.camera, ...by));
  drawing.addEventListener("keydown", (event) => {
    if (!drawing.layout || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "0") look(FIRST_VIEW);
    else if (KEYS[event.key]) turn(...KEYS[event.key]);
    else return;
    event.preventDefault();
  });
  drawing.addEventListener("pointerdown", (event) => drawing.layout && drawing.setPointerCapture(event.pointerId));
  drawing.addEventListener("pointermove", (event) => {
    if (!drawing.hasPointerCapture(event.pointerId)) return;
    const angle = Math.PI / drawing.clientHeight;
    turn(-angle * event.movementX, angle * event.movementY, 1);
  });
  drawing.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (drawing.layout) turn(0, 0, Math.exp(-event.deltaY / 1000));
  }, { passive: false });
  new ResizeObserver(() => drawing.layout && drawing.clientWidth && draw()).observe(drawing);
  root.addEventListener("transitionend", draw);  // the theme has another colour of text: see the style sheet
  model.on("surface", draw);
  draw();
  return root;
}
