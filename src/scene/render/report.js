"use strict";
// Tables sort by the column whose heading is pressed; what is missing stays last.
for (const heading of document.querySelectorAll("thead th")) {
  const button = document.createElement("button");
  button.type = "button";
  button.append(...heading.childNodes);
  heading.append(button);
  button.addEventListener("click", () => {
    const body = heading.closest("table").tBodies[0];
    const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    const cell = (row) => row.cells[heading.cellIndex];
    const key = (row) => (cell(row).dataset.value === undefined ? NaN : Number(cell(row).dataset.value));
    const missing = (row) => cell(row).textContent === "–";
    const rows = [...body.rows].sort((a, b) => {
      if (missing(a) !== missing(b)) return missing(a) ? 1 : -1;
      const [x, y] = [key(a), key(b)];
      if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
      if (!Number.isNaN(x)) return x === y ? 0 : sign * (x < y ? -1 : 1);
      return sign * cell(a).textContent.localeCompare(cell(b).textContent, undefined, { numeric: true });
    });
    body.append(...rows);
    for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", sign === 1 ? "ascending" : "descending");
  });
}
// What scrolls can be reached by the keyboard.
for (const box of document.querySelectorAll(".scroll"))
  if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
// What is folded is printed too.
let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  for (const details of opened) details.open = true;
});
addEventListener("afterprint", () => {
  for (const details of opened) details.open = false;
});
// Figures say what is under the pointer, and are enlarged by a double click or by keys.
for (const plot of document.querySelectorAll(".plot")) {
  const svg = plot.querySelector("svg");
  const readout = plot.parentNode.querySelector(".readout");
  const panels = JSON.parse(plot.dataset.panels);
  const whole = svg.getAttribute("viewBox").split(" ").map(Number);
  let view = [...whole];
  const show = () => svg.setAttribute("viewBox", view.join(" "));
  const place = (event) => {
    const box = svg.getBoundingClientRect();
    return [
      view[0] + ((event.clientX - box.left) / box.width) * view[2],
      view[1] + ((event.clientY - box.top) / box.height) * view[3],
    ];
  };
  const value = (share, [low, high, log]) => {
    const at = low + share * (high - low);
    return String(Number((log ? 10 ** at : at).toPrecision(4)));
  };
  plot.addEventListener("pointermove", (event) => {
    const [px, py] = place(event);
    const panel = panels.find(({ box }) => px >= box[0] && px <= box[1] && py >= box[2] && py <= box[3]);
    if (!panel) {
      readout.textContent = "";
      return;
    }
    const { box, x, y, title } = panel;
    const across = value((px - box[0]) / (box[1] - box[0]), x);
    const along = value((box[3] - py) / (box[3] - box[2]), y);
    readout.textContent = `${title ? title + ": " : ""}${panel.names[0] || "x"} = ${across}, ${panel.names[1] || "y"} = ${along}`;
  });
  const zoom = (factor, [px, py]) => {
    const width = Math.min(whole[2], Math.max(whole[2] / 32, view[2] * factor));
    const height = (width / whole[2]) * whole[3];
    const within = (start, size, from, all) => Math.min(from + all - size, Math.max(from, start));
    view = [
      within(px - ((px - view[0]) / view[2]) * width, width, whole[0], whole[2]),
      within(py - ((py - view[1]) / view[3]) * height, height, whole[1], whole[3]),
      width,
      height,
    ];
    show();
  };
  const middle = () => [view[0] + view[2] / 2, view[1] + view[3] / 2];
  plot.addEventListener("dblclick", (event) => zoom(event.shiftKey ? 2 : 0.5, place(event)));
  addEventListener("beforeprint", () => svg.setAttribute("viewBox", whole.join(" ")));
  addEventListener("afterprint", show);
  plot.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (event.key === "+" || event.key === "=") zoom(0.8, middle());
    else if (event.key === "-") zoom(1.25, middle());
    else if (event.key === "0" || event.key === "Escape") zoom(64, middle());
    else if (moves[event.key] && view[2] < whole[2]) {
      const [dx, dy] = moves[event.key];
      view[0] += 0.1 * dx * view[2];
      view[1] += 0.1 * dy * view[3];
      zoom(1, middle());
    } else return;
    event.preventDefault();
  });
}
