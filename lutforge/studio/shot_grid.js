// Shots as cards, each a button that takes the shot out and in again.
export function render({ model }) {
  const root = document.createElement("div");
  const legend = document.createElement("div"), grid = document.createElement("div");
  legend.className = "legend"; grid.className = "grid"; root.append(legend, grid); root.style.width = "100%";
  const words = (parent, tag, text, name) => {
    const node = document.createElement(tag);
    node.textContent = text; if (name) node.className = name;
    parent.append(node); return node;
  };
  const explain = () => {
    legend.replaceChildren();
    for (const [text, colour] of model.legend) {
      const entry = words(legend, "span", text), mark = document.createElement("i");
      mark.style.background = colour; entry.prepend(mark);
    }
  };
  const mark = () => {
    for (const card of grid.querySelectorAll("button")) {
      const out = model.out.includes(card.dataset.shot);
      card.className = out ? "out" : ""; card.setAttribute("aria-pressed", String(!out));
      card.querySelector(".state").textContent = out ? "left out" : "in";
    }
  };
  const draw = () => {
    grid.replaceChildren();
    if (!model.shots.length) {
      words(grid, "p", "No shots yet. To calibrate a camera takes five photographs or more, each as RAW with its " +
        "JPEG, inside the RAW file or beside it; without RAW, JPEGs of one scene at several exposures.");
    }
    for (const shot of model.shots) {
      const card = document.createElement("button"), row = document.createElement("div");
      card.dataset.shot = shot.name; row.className = "pictures";
      for (const [title, url] of shot.pictures) {
        const image = document.createElement("img");
        image.src = url; image.alt = `${title} of ${shot.name}`; image.title = title; row.append(image);
      }
      words(card, "span", "", "state"); words(card, "b", shot.name); card.append(row);
      for (const fact of shot.facts) words(card, "div", fact);
      card.addEventListener("click", () => {
        const name = shot.name, out = model.out.includes(name);
        model.out = out ? model.out.filter((other) => other !== name) : [...model.out, name];
      });
      grid.append(card);
    }
    mark();
  };
  model.on("shots", draw); model.on("out", mark); model.on("legend", explain);
  explain(); draw();
  return root;
}
