// Saving of figures and their data, and the filters of the scoreboard.
"use strict";

const page = {};

page.save = function (name, url) {
  const link = document.createElement("a");
  link.download = name;
  link.href = url;
  link.click();
};

page.unpack = async function (text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).blob();
};

page.saveData = async function (button) {
  const packed = document.getElementById(`data-${button.dataset.csv}`).textContent;
  const url = URL.createObjectURL(new Blob([await page.unpack(packed)], { type: "text/csv" }));
  page.save(`${button.dataset.csv}.csv`, url);
  setTimeout(() => URL.revokeObjectURL(url), 10000);
};

page.filter = function (board) {
  const shown = new Set([...board.querySelectorAll("[data-verdict][aria-pressed=true]")].map((b) => b.dataset.verdict));
  const words = board.querySelector("input").value.toLowerCase();
  let count = 0;
  for (const row of board.querySelectorAll("tr[data-row]")) {
    row.hidden = !shown.has(row.dataset.row) || !row.textContent.toLowerCase().includes(words);
    count += !row.hidden;
  }
  board.querySelector("[data-count]").textContent = `${count} shown`;
};

// A link to a figure or to the scoreboard opens what is folded around its target.
page.open = function () {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folded = target && target.closest("details");
  if (folded) folded.open = true;
};

addEventListener("hashchange", page.open);
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => (d.open = true)));
addEventListener("DOMContentLoaded", () => {
  document.documentElement.classList.add("scripted");
  page.open();
  for (const button of document.querySelectorAll("[data-svg]")) {
    const image = document.getElementById(button.dataset.svg).querySelector("img");
    button.addEventListener("click", () => page.save(`${button.dataset.svg}.svg`, image.src));
  }
  for (const button of document.querySelectorAll("[data-csv]")) {
    button.addEventListener("click", () => page.saveData(button));
  }
  const board = document.getElementById("scoreboard");
  if (!board) return;
  for (const button of board.querySelectorAll("[data-verdict]")) {
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") !== "true");
      page.filter(board);
    });
  }
  board.querySelector("input").addEventListener("input", () => page.filter(board));
});
