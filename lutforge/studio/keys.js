// Ctrl+Z and Ctrl+Shift+Z outside of lines of text, and double clicks on sliders, anywhere in the page.

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
  document.addEventListener("keydown", pressed);
  document.addEventListener("dblclick", clicked);
  model.on("remove", () => {
    document.removeEventListener("keydown", pressed);
    document.removeEventListener("dblclick", clicked);
  });
  return document.createElement("span");
}
