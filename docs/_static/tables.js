/* Tables that fit their page: names may break after a dot or an underscore, and on a phone a table that is still too
   wide shows each row as a block, in which every cell follows the head of its column. */

function breakNames(cell) {
  const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
  const texts = [];
  while (walker.nextNode()) texts.push(walker.currentNode);
  for (const text of texts) {
    const pieces = text.data.split(/(?<=[a-z][._\/])(?=[A-Za-z]{3})/);
    text.replaceWith(...pieces.flatMap((piece) => [piece, document.createElement("wbr")]).slice(0, -1));
  }
}

function stackWideTables() {
  for (const wrapper of document.querySelectorAll("article .table-wrapper")) {
    wrapper.classList.remove("stacked");
    if (window.innerWidth <= 600 && wrapper.scrollWidth > wrapper.clientWidth + 1) {
      wrapper.classList.add("stacked");
    }
  }
}

document.addEventListener("DOMContentLoaded", () => {
  for (const cell of document.querySelectorAll("article table.docutils td")) breakNames(cell);
  for (const table of document.querySelectorAll("article table.docutils")) {
    const heads = [...table.querySelectorAll("thead th")].map((head) => head.textContent.trim());
    for (const row of table.querySelectorAll("tbody tr")) {
      [...row.cells].forEach((cell, column) => {
        cell.dataset.head = heads[column] || "";
        cell.classList.toggle("empty", !cell.textContent.trim());
      });
    }
  }
  stackWideTables();
});
window.addEventListener("resize", stackWideTables);
window.addEventListener("load", () => {
  const formulas = window.MathJax && MathJax.startup && MathJax.startup.promise;
  if (formulas) formulas.then(stackWideTables); // they are as wide as their source before
});
