// Ctrl+Z and Ctrl+Shift+Z outside of lines of text, sliders that are reset by a double click and whose value can be
// typed, and files dropped anywhere in the page.

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
  const nameOf = (slider, input) => {
    const names = (input.getAttribute("aria-labelledby") || "").split(" ").map(id => slider.getRootNode().getElementById?.(id)?.textContent);
    return input.getAttribute("aria-label") || names.join(" ");
  };
  const clicked = event => {
    const slider = event.composedPath().find(element => element.matches?.(".MuiSlider-root"));
    const input = slider?.querySelector("input[type=range]");
    if (input) model.send_msg({ do: "reset", name: nameOf(slider, input) });
  };

  // A line over the value of a slider, to write another one into: the enter key takes it, Escape leaves it.
  let line = null;
  function close() {
    const closed = line;
    line = null;  // first: to remove it takes the focus from it
    closed?.remove();
  }
  function type(slider, begin) {
    const control = slider.closest(".MuiFormControl-root"), shown = control?.querySelector(".MuiFormLabel-root strong");
    const input = slider.querySelector("input[type=range]");
    if (!shown || !input || input.disabled) return;
    close();
    const box = shown.getBoundingClientRect(), name = nameOf(slider, input), mine = document.createElement("input");
    line = mine;
    mine.className = "typed";
    mine.setAttribute("aria-label", `${name}, value`);
    mine.value = begin ?? shown.textContent;
    Object.assign(mine.style, { left: `${box.left - 4}px`, top: `${box.top - 3}px`, height: `${box.height + 6}px` });
    mine.addEventListener("keydown", event => {
      if (event.key === "Enter") model.send_msg({ do: "set", name, value: mine.value });
      if (!["Enter", "Escape"].includes(event.key)) return;
      event.preventDefault();
      close();
      input.focus();
    });
    mine.addEventListener("blur", () => { if (line === mine) close(); });
    document.body.append(mine);
    mine.focus();
    if (begin === undefined) mine.select();
  }
  const pointed = event => {
    const shown = event.composedPath().find(element => element.matches?.(".MuiFormLabel-root strong"));
    const slider = shown?.closest(".MuiFormControl-root")?.querySelector(".MuiSlider-root");
    if (!slider) return;
    event.preventDefault();
    type(slider);
  };
  const typed = event => {
    const slider = event.composedPath().find(element => element.matches?.(".MuiSlider-root"));
    if (!slider || !/^[-+.\d]$/.test(event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    type(slider, event.key);
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
  const heard = [["keydown", pressed], ["keydown", typed, true], ["dblclick", clicked], ["click", pointed],
    ["dragover", over], ["drop", dropped, true]];
  for (const listener of heard) document.addEventListener(...listener);
  model.on("remove", () => {
    for (const listener of heard) document.removeEventListener(...listener);
    close();
  });
  return document.createElement("span");
}
