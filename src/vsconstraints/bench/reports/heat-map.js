// A click on a heading sorts lines by its column, the greatest first, and again the least first; the first column undoes it.
for (const table of document.querySelectorAll(".heat table")) {
  const body = table.tBodies[0], original = [...body.rows], heads = [...table.tHead.rows[0].cells];
  const value = (row, k) => parseFloat(row.cells[k].dataset.value ?? "-1");
  heads.forEach((head, k) => {
    const button = document.createElement("button");
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const up = head.ariaSort === "descending", order = up ? "ascending" : "descending";
      heads.forEach(other => other.removeAttribute("aria-sort"));
      if (k) head.ariaSort = order;
      body.append(...(k ? original.toSorted((a, b) => (up ? 1 : -1) * (value(a, k) - value(b, k))) : original));
    });
  });
}
