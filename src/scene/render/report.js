"use strict";
// Tables sort by the column whose heading is pressed.
for (const button of document.querySelectorAll("th button")) {
  button.addEventListener("click", () => {
    const heading = button.closest("th");
    const body = heading.closest("table").tBodies[0];
    const column = heading.cellIndex;
    const down = heading.getAttribute("aria-sort") === "ascending";
    const key = (row) => row.cells[column].dataset.value;
    const compare = (a, b) => {
      const [x, y] = [key(a), key(b)];
      if (x !== undefined && y !== undefined) return x - y;
      if (x !== y) return x === undefined ? 1 : -1;
      return a.cells[column].textContent.localeCompare(b.cells[column].textContent);
    };
    const rows = [...body.rows].sort(compare);
    if (down) rows.reverse();
    body.append(...rows);
    for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
  });
}
// What is folded is printed too.
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});
// Figures say what is under the pointer, and are enlarged by the wheel with Ctrl, or by the keys + and -.
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
    return (log ? 10 ** at : at).toPrecision(4).replace(/\.?0+(e|$)/, "$1");
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
  plot.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(event.deltaY > 0 ? 1.25 : 0.8, place(event));
    },
    { passive: false },
  );
  plot.addEventListener("dblclick", (event) => zoom(0.5, place(event)));
  plot.addEventListener("keydown", (event) => {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (event.key === "+") zoom(0.8, middle());
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
