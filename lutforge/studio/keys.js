// Ctrl+Z and Ctrl+Shift+Z outside of lines of text, double clicks on sliders, and files dropped anywhere in the page.

// The first element that a selector names, in the page or in the shadow of any of its elements.
function deep(root, selector) {
  const here = root.querySelector(selector);
  if (here) return here;
  for (const element of root.querySelectorAll("*")) {
    const within = element.shadowRoot && deep(element.shadowRoot, selector);
    if (within) return within;
  }
  return null;
}

export function render({ model }) {
  const writes = element => element.matches?.("textarea, input:not([type=range]):not([type=checkbox]):not([type=radio])");
  const pressed = event => {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || event.altKey || !["z", "y"].includes(key)) return;
    if (event.composedPath().some(writes)) return;
    event.preventDefault();
    model.send_msg({ do: key === "y" || event.shiftKey ? "redo" : "undo" });
  };
  const clicked = event => {
    const slider = event.composedPath().find(element => element.matches?.(".MuiSlider-root"));
    const input = slider?.querySelector("input[type=range]");
    if (!input) return;
    const names = (input.getAttribute("aria-labelledby") || "").split(" ").map(id => slider.getRootNode().getElementById?.(id)?.textContent);
    model.send_msg({ do: "reset", name: input.getAttribute("aria-label") || names.join(" ") });
  };
  const holdsFiles = event => [...event.dataTransfer?.types || []].includes("Files");
  const over = event => { if (holdsFiles(event)) event.preventDefault(); };  // else the browser leaves the page for them
  const dropped = event => {
    if (!holdsFiles(event)) return;
    event.preventDefault();
    event.stopPropagation();
    const input = deep(document, "input[type=file]");
    if (!input) { model.send_msg({ do: "drop" }); return; }
    input.files = event.dataTransfer.files;
    input.dispatchEvent(new Event("change", { bubbles: true }));
  };
  document.addEventListener("keydown", pressed);
  document.addEventListener("dblclick", clicked);
  document.addEventListener("dragover", over);
  document.addEventListener("drop", dropped, true);
  model.on("remove", () => {
    document.removeEventListener("keydown", pressed);
    document.removeEventListener("dblclick", clicked);
    document.removeEventListener("dragover", over);
    document.removeEventListener("drop", dropped, true);
  });
  return document.createElement("span");
}
